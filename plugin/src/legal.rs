//! Action masks: the discrete actions that are legal in a tick.
//!
//! A game keeps the [`LegalActions`] of its agents up to date in [`ObserveSchedule`](crate::systems::ObserveSchedule).
//! Random bots, the noise of demonstrators and explorers then draw among legal actions. Policies give illegal actions
//! probability 0, in play and in training. A person may press anything, so the game has to ignore illegal actions.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{legal::LegalActions, prelude::*};
//!
//! let mut app = headless_app();
//! let mask = LegalActions::new([false, true, false]);
//! let agent = (Agent::new(0, ActionSpace::Discrete(3)), mask, Control::Bot, BlindBot::Uniform);
//! let agent = app.world_mut().spawn(agent).id();
//! app.ticks(5).expect("one action is legal");
//! assert_eq!(app.world().get::<Action>(agent).and_then(Action::discrete), Some(1));
//! ```

use crate::{
    action::{Action, ActionSpace, ActionValue},
    agent::{Agent, Control},
    carry_over::ReflectCarryComponent,
    episode::Episode,
    fault::Faults,
};
use bevy::prelude::*;

/// The legal actions of an agent in this tick. An agent without it may take any action.
///
/// Each discrete action has an entry. At least one must be legal, in each tick. Continuous actions have no mask.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, CarryComponent, Clone, Debug, Default, PartialEq)]
pub struct LegalActions(Vec<bool>);

impl LegalActions {
    /// Creates the mask from an entry for each action: true if it is legal.
    pub fn new(mask: impl IntoIterator<Item = bool>) -> Self {
        Self(mask.into_iter().collect())
    }

    /// Returns the entries.
    pub fn mask(&self) -> &[bool] {
        &self.0
    }

    /// Returns whether an action is legal. Continuous actions always are.
    pub fn allows(&self, action: &ActionValue) -> bool {
        match action {
            ActionValue::Discrete(index) => self.0.get(*index as usize).copied().unwrap_or(false),
            ActionValue::Continuous(_) => true,
        }
    }

    /// Returns the number of legal actions.
    pub fn count(&self) -> usize {
        self.0.iter().filter(|&&is_legal| is_legal).count()
    }

    /// Returns the legal action that `number` falls on, counted round and round; `None` if no action is legal.
    pub(crate) fn pick(&self, number: u32) -> Option<ActionValue> {
        let legal: Vec<u32> = (0..).zip(&self.0).filter_map(|(index, &is_legal)| is_legal.then_some(index)).collect();
        let number = number as usize % legal.len().max(1);
        legal.get(number).map(|&index| ActionValue::Discrete(index))
    }

    /// Returns why the mask does not fit an agent's actions.
    fn misfit(&self, space: &ActionSpace) -> Option<String> {
        match space {
            ActionSpace::Continuous(_) => {
                Some("it has `LegalActions` and continuous actions: a mask is for discrete ones".to_owned())
            }
            ActionSpace::Discrete(n) if self.0.len() != *n => Some(format!(
                "its `LegalActions` have {} entries, and it has {space}: give each action one",
                self.0.len()
            )),
            ActionSpace::Discrete(_) if !self.0.contains(&true) => Some(
                "its `LegalActions` forbid every action: allow one that does nothing, or end the episode".to_owned(),
            ),
            ActionSpace::Discrete(_) => None,
        }
    }
}

/// Replaces an illegal action of this tick by a legal one, for random actions that are drawn before the tick, when its
/// mask is not known yet. Has no effect without [`LegalActions`].
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, CarryComponent, Clone, Debug, PartialEq)]
pub struct RedrawsIllegal {
    /// A random number, which decides between the legal actions.
    pub random: u32,
}

/// Reports masks that do not fit their agents, with agent and tick, and stops those agents.
pub(crate) fn check_legal_actions(
    mut agents: Query<(&Agent, &LegalActions, &Episode, &mut Control)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, legal, episode, mut control) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if let Some(why) = legal.misfit(&agent.actions) {
            faults.report(format!("{}: {why}", episode.moment(agent)));
            *control = Control::Idle;
        }
    }
}

/// Draws again for agents with [`RedrawsIllegal`].
pub(crate) fn redraw_illegal(mut agents: Query<(&Control, &Episode, &LegalActions, &RedrawsIllegal, &mut Action)>) {
    for (control, episode, legal, redraw, mut action) in &mut agents {
        if *control != Control::Bot || !episode.is_running() || legal.allows(&action.0) {
            continue;
        }
        if let Some(drawn) = legal.pick(redraw.random) {
            action.0 = drawn;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;

    /// Returns an app with a bot that has this mask.
    fn masked(bot: BlindBot, mask: &[bool]) -> (App, Entity) {
        let mut app = headless_app();
        let legal = LegalActions::new(mask.iter().copied());
        let agent = (Agent::new(0, ActionSpace::Discrete(4)), legal, Control::Bot, bot);
        let agent = app.world_mut().spawn(agent).id();
        (app, agent)
    }

    /// Returns the actions of a bot with this mask.
    fn drawn(bot: BlindBot, mask: [bool; 4]) -> Vec<u32> {
        let (mut app, agent) = masked(bot, &mask);
        let mut next = || {
            app.tick().expect("some action is legal");
            app.world().get::<Action>(agent).and_then(Action::discrete)
        };
        let mut seen: Vec<u32> = (0..200).filter_map(|_| next()).collect();
        seen.sort_unstable();
        seen.dedup();
        seen
    }

    #[test]
    fn random_bots_draw_among_all_legal_actions_and_no_others() {
        for bot in [BlindBot::Uniform, BlindBot::Chaos] {
            assert_eq!(drawn(bot.clone(), [false, true, false, true]), [1, 3], "{bot:?}");
        }
    }

    #[test]
    fn chaos_lets_go_of_an_action_that_becomes_illegal() {
        let (mut app, agent) = masked(BlindBot::Chaos, &[true, false, false, false]);
        app.tick().expect("one is legal");
        app.world_mut().entity_mut(agent).insert(LegalActions::new([false, false, true, false]));
        app.tick().expect("one is legal");
        assert_eq!(app.world().get::<Action>(agent).and_then(Action::discrete), Some(2));
    }

    #[test]
    fn a_mask_that_forbids_everything_is_a_fault_with_agent_and_tick() {
        let (mut app, agent) = masked(BlindBot::Uniform, &[true; 4]);
        app.ticks(2).expect("all are legal");
        app.world_mut().entity_mut(agent).insert(LegalActions::new([false; 4]));
        let text = app.tick().expect_err("none is legal").to_string();
        assert!(text.contains("agent 0") && text.contains("tick 2") && text.contains("forbid every action"), "{text}");
        assert_eq!(app.world().get::<Control>(agent), Some(&Control::Idle));
    }

    #[test]
    fn a_mask_of_another_length_is_a_fault_with_both_numbers() {
        let (mut app, _) = masked(BlindBot::Uniform, &[true; 3]);
        let text = app.tick().expect_err("too short").to_string();
        assert!(text.contains("3 entries") && text.contains("give each action one"), "{text}");
    }

    #[test]
    fn illegal_actions_are_redrawn_and_legal_ones_are_kept() {
        let mask = [false, true, false, true];
        for (planned, random, expected) in [(1, 7, 1), (3, 0, 3), (0, 0, 1), (2, 1, 3), (2, 2, 1)] {
            let mut app = headless_app();
            let legal = LegalActions::new(mask);
            let action = Action(ActionValue::Discrete(planned));
            let agent =
                (Agent::new(0, ActionSpace::Discrete(4)), legal, Control::Bot, action, RedrawsIllegal { random });
            let agent = app.world_mut().spawn(agent).id();
            app.tick().expect("some action is legal");
            let played = app.world().get::<Action>(agent).and_then(Action::discrete);
            assert_eq!(played, Some(expected), "{planned} with {random}");
        }
    }
}
