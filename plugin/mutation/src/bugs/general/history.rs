//! The actions of an agent so far, for planted defects that depend on them.

use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionValue},
    agent::{Agent, Control},
    engine::{Renewal, TickSchedules, is_tick},
    episode::{Episode, StartEpisode},
    systems::PlaybotSystems,
};
use std::collections::VecDeque;

/// Number of actions that are kept.
const MEMORY: usize = 8;

/// The actions of an agent in its World, and in the current episode.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub(super) struct History {
    episodes: u32,
    /// The last action first.
    done: VecDeque<ActionValue>,
    held: u32,
    longest: u32,
    /// True if a defect that shows once has already shown in this episode.
    pub(super) has_shown: bool,
    /// The agent's own action, if the game receives another one in this tick.
    pub(super) meant: Option<ActionValue>,
    /// The agent's controller, if the game treats the agent as idle in this tick.
    pub(super) control: Option<Control>,
}

/// The steps between an agent's decision and the game.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum PlantedSystems {
    /// The action is stored.
    Note,
    /// The action is replaced.
    Change,
}

/// Adds a [`History`] to agents that are spawned later.
pub(super) fn remember(app: &mut App) {
    let decide = TickSchedules::of(app).decide;
    let between = (PlantedSystems::Note, PlantedSystems::Change).chain();
    let between = between.after(PlaybotSystems::Decide).before(PlaybotSystems::Act).run_if(is_tick);
    app.register_required_components::<Agent, History>()
        .add_observer(begin)
        .configure_sets(decide, between)
        .add_systems(decide, note.in_set(PlantedSystems::Note));
}

fn begin(event: On<StartEpisode>, mut histories: Query<&mut History>, mut commands: Commands) {
    if let Ok(mut history) = histories.get_mut(event.entity) {
        history.begin();
    }
    // Where Worlds are rebuilt, a leak from one episode into the next needs state outside of them.
    commands.queue(Renewal::carry_component::<History>);
}

fn note(mut agents: Query<(&Control, &Episode, &Action, &mut History)>) {
    for (control, episode, action, mut history) in &mut agents {
        if control.is_active() && episode.is_running() {
            history.note(&action.0);
        }
    }
}

impl History {
    /// Begins an episode.
    pub(super) fn begin(&mut self) {
        *self = Self { episodes: self.episodes.saturating_add(1), ..Self::default() };
    }

    /// Stores the agent's action.
    pub(super) fn note(&mut self, action: &ActionValue) {
        let is_same = self.done.front().is_some_and(|last| push(last) == push(action));
        self.held = if is_same { self.held.saturating_add(1) } else { 1 };
        self.longest = self.longest.max(self.held);
        self.done.push_front(action.clone());
        self.done.truncate(MEMORY);
    }

    /// Returns the number of the agent's episodes in this World, with the current one.
    pub(super) fn episodes(&self) -> u32 {
        self.episodes
    }

    /// Returns for how many ticks the current action has been held.
    pub(super) fn held(&self) -> u32 {
        self.held
    }

    /// Returns the most ticks in a row with one action in this episode.
    pub(super) fn longest(&self) -> u32 {
        self.longest
    }

    /// Returns the action from `ago` ticks ago, up to 7; 0 is this tick.
    pub(super) fn done(&self, ago: usize) -> Option<&ActionValue> {
        self.done.get(ago)
    }

    /// Returns whether the agent went back to the action before the last one.
    pub(super) fn went_back(&self) -> bool {
        let pushed = |ago| self.done(ago).map(push);
        self.done.len() > 2 && pushed(0) == pushed(2) && pushed(0) != pushed(1)
    }
}

/// Reduces an action to the choice or choices, or to the direction of the first value, since continuous values never repeat
/// exactly.
fn push(action: &ActionValue) -> i64 {
    match action {
        ActionValue::Discrete(choice) => i64::from(*choice),
        ActionValue::Mixed { choices, .. } if !choices.is_empty() => {
            choices.iter().fold(0, |all, &option| all * 1000 + i64::from(option))
        }
        ActionValue::Continuous(values) | ActionValue::Mixed { numbers: values, .. } => {
            values.first().map_or(0, |value| i64::from(*value > 0.0) - i64::from(*value < 0.0))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_is_counted_and_going_back_is_seen() {
        let mut history = History::default();
        for value in [0.5, 0.7, -0.1] {
            history.note(&ActionValue::Continuous(vec![value, 0.0]));
        }
        assert_eq!((history.held(), history.longest(), history.went_back()), (1, 2, false));
        history.note(&ActionValue::Continuous(vec![0.2, 0.0]));
        assert!(history.went_back());
        assert_eq!(history.done(1), Some(&ActionValue::Continuous(vec![-0.1, 0.0])));
    }
}
