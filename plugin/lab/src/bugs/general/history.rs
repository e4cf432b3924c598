//! What agents have done so far, as planted defects remember it.

use std::collections::VecDeque;

use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionValue},
    agent::Agent,
    control::Control,
    episode::{Episode, StartEpisode},
    placement::{TickSchedules, is_tick},
    renewal::Renewal,
    systems::PlaybotSystems,
};

/// Actions that are remembered.
const MEMORY: usize = 8;

/// What an agent has done in its World, and in the episode that it plays.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub(super) struct History {
    episodes: u32,
    /// The last action first.
    done: VecDeque<ActionValue>,
    held: u32,
    longest: u32,
    /// Whether the defect has already shown in this episode, for those that show once.
    pub(super) has_shown: bool,
    /// What the agent meant to do, where the game is given something else in this tick.
    pub(super) meant: Option<ActionValue>,
    /// Who decides, where the game takes the agent for idle in this tick.
    pub(super) control: Option<Control>,
}

/// Where planted defects come between an agent's decision and the game.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum PlantedSystems {
    /// The action is noted.
    Note,
    /// The game is given another one.
    Change,
}

/// Lets agents that are spawned later have a [`History`].
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
    // Where Worlds are built anew, what leaks from one episode into the next does so outside of them.
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
    /// An episode begins.
    pub(super) fn begin(&mut self) {
        *self = Self { episodes: self.episodes.saturating_add(1), ..Self::default() };
    }

    /// The agent decides for an action.
    pub(super) fn note(&mut self, action: &ActionValue) {
        let is_same = self.done.front().is_some_and(|last| push(last) == push(action));
        self.held = if is_same { self.held.saturating_add(1) } else { 1 };
        self.longest = self.longest.max(self.held);
        self.done.push_front(action.clone());
        self.done.truncate(MEMORY);
    }

    /// The agent's episodes in this World, with the one that is played.
    pub(super) fn episodes(&self) -> u32 {
        self.episodes
    }

    /// For how many ticks the same has been done up to now.
    pub(super) fn held(&self) -> u32 {
        self.held
    }

    /// For how many ticks in a row the same has been done at most in this episode.
    pub(super) fn longest(&self) -> u32 {
        self.longest
    }

    /// What was decided so many ticks ago, up to 7; 0 is this tick.
    pub(super) fn done(&self, ago: usize) -> Option<&ActionValue> {
        self.done.get(ago)
    }

    /// Whether the agent went back to what it did before the last tick.
    pub(super) fn went_back(&self) -> bool {
        let pushed = |ago| self.done(ago).map(push);
        self.done.len() > 2 && pushed(0) == pushed(2) && pushed(0) != pushed(1)
    }
}

/// What is meant by an action: the choice, or the way in which the first value goes. Nobody repeats numbers to the bit.
fn push(action: &ActionValue) -> i64 {
    match action {
        ActionValue::Discrete(choice) => i64::from(*choice),
        ActionValue::Continuous(values) => {
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
