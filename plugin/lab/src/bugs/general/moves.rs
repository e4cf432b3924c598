//! The actions of a game's agents, ranked by how much they matter.

use bevy_playbot::{
    action::{ActionSpace, ActionValue},
    bot::BlindBot,
};

use crate::{game::Game, idle::is_named_idle};

/// The actions of an agent.
#[derive(Clone, Debug)]
pub(super) struct Moves {
    space: ActionSpace,
    /// The choice that does nothing; the last one if no choice has such a name.
    idle: u32,
    /// The other choices: first those that the game's blind bots hold, then from the last to the first.
    choices: Vec<u32>,
}

impl Moves {
    /// Returns the actions of a game.
    pub(super) fn of(game: &dyn Game) -> Self {
        let space = game.actions();
        let ActionSpace::Discrete(count) = space else { return Self { space, idle: 0, choices: Vec::new() } };
        let names = game.tools().input.action_names();
        let is_idle = |choice: &u32| is_named_idle(&names, *choice);
        let last = (count as u32).saturating_sub(1);
        let idle = (0..=last).find(is_idle).unwrap_or(last);
        let bots = game.tools().bots.blind_bots().into_iter().filter_map(|(_, bot)| match bot {
            BlindBot::Constant(ActionValue::Discrete(choice)) => Some(choice),
            _ => None,
        });
        let mut choices: Vec<u32> = Vec::new();
        for choice in bots.chain((0..=last).rev()) {
            if choice != idle && !is_idle(&choice) && !choices.contains(&choice) {
                choices.push(choice);
            }
        }
        Self { space, idle, choices }
    }

    /// Returns the action that does nothing.
    pub(super) fn idle(&self) -> ActionValue {
        match self.space {
            ActionSpace::Discrete(_) => ActionValue::Discrete(self.idle),
            ActionSpace::Continuous(count) => ActionValue::Continuous(vec![0.0; count]),
        }
    }

    /// Returns the action without its effect, if it is the n-th choice that matters or has an n-th value; `None` if
    /// that changes nothing.
    pub(super) fn without(&self, n: usize, action: &ActionValue) -> Option<ActionValue> {
        match action {
            ActionValue::Discrete(choice) => {
                let dead = self.choices.get(n % self.choices.len().max(1))?;
                (choice == dead).then(|| self.idle())
            }
            ActionValue::Continuous(values) => {
                let mut values = values.clone();
                let at = n % values.len().max(1);
                *values.get_mut(at)? = 0.0;
                Some(ActionValue::Continuous(values))
            }
        }
    }

    /// Returns whether an action is the one that a reward farm pays for: doing nothing. With continuous actions it is a
    /// first value near the top, since exact zeros are never drawn.
    pub(super) fn is_farming(&self, action: &ActionValue) -> bool {
        match action {
            ActionValue::Discrete(choice) => *choice == self.idle,
            ActionValue::Continuous(values) => values.first().is_some_and(|value| *value > 0.5),
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::App;

    use super::*;
    use crate::{bugs::general::testing::Track, foreign::ForeignGame};

    #[test]
    fn the_choice_that_does_nothing_is_known_by_its_name_and_held_ones_come_first() {
        let game =
            ForeignGame::new("keys", 1, |_: &mut App| {}).keys_by_name([vec!["ArrowUp"], vec![], vec!["ArrowLeft"]]);
        let moves = Moves::of(&game);
        assert_eq!((moves.idle, moves.choices.as_slice()), (1, &[2, 0][..]));
        let moves = Moves::of(&Track);
        assert_eq!((moves.idle(), moves.choices.as_slice()), (ActionValue::Discrete(0), &[1, 2][..]));
        assert_eq!(moves.without(0, &ActionValue::Discrete(1)), Some(ActionValue::Discrete(0)));
        assert_eq!(moves.without(0, &ActionValue::Discrete(2)), None);
    }

    #[test]
    fn a_value_of_continuous_actions_can_be_dead() {
        let moves = Moves { space: ActionSpace::Continuous(2), idle: 0, choices: Vec::new() };
        let action = ActionValue::Continuous(vec![1.0, -1.0]);
        assert_eq!(moves.without(3, &action), Some(ActionValue::Continuous(vec![1.0, 0.0])));
        assert_eq!(moves.idle(), ActionValue::Continuous(vec![0.0; 2]));
    }
}
