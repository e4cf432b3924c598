//! Games that receive other actions than their agents decided on.

use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionSpace, ActionValue},
    agent::Agent,
    control::Control,
    episode::Episode,
    placement::{TickSchedules, is_tick},
    systems::PlaybotSystems,
};

use super::history::{History, PlantedSystems, remember};

/// An agent after its decision.
pub(super) struct Doing<'a> {
    /// The action space.
    pub(super) space: &'a ActionSpace,
    /// The agent's episode.
    pub(super) episode: &'a Episode,
    /// The agent's actions so far, with that of this tick.
    pub(super) history: &'a History,
    /// The action of this tick.
    pub(super) action: &'a ActionValue,
}

/// Replaces the agent's action by the one that `change` returns; `None` leaves it. Recordings, detectors and learners
/// see the agent's decision, so the difference is a defect of the game.
pub(super) fn change_actions(
    app: &mut App,
    mut change: impl FnMut(&Doing<'_>) -> Option<ActionValue> + Send + Sync + 'static,
) {
    remember(app);
    let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
    let hand_over = move |mut agents: Query<(&Agent, &Control, &Episode, &mut Action, &mut History)>| {
        for (agent, control, episode, mut action, mut history) in &mut agents {
            if !control.is_active() || !episode.is_running() {
                continue;
            }
            let doing = Doing { space: &agent.actions, episode, history: &history, action: &action.0 };
            if let Some(other) = change(&doing) {
                history.meant = Some(std::mem::replace(&mut action.0, other));
            }
        }
    };
    app.add_systems(decide, hand_over.in_set(PlantedSystems::Change))
        .add_systems(judge, give_back.before(PlaybotSystems::Judge).run_if(is_tick));
}

fn give_back(mut agents: Query<(&mut Action, &mut History)>) {
    for (mut action, mut history) in &mut agents {
        if let Some(meant) = history.meant.take() {
            action.0 = meant;
        }
    }
}
