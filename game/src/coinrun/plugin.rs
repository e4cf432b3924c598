//! CoinRun as a Bevy plugin.

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

use super::{
    arena, components::CoinRunMode, demonstrator_bot, level::Mode, physics::CoinRunPhysicsPlugin, play,
    systems::CoinRunSystems,
};

/// Adds the rules of CoinRun. Agents are made by [`spawn_agent`](super::game::spawn_agent).
#[derive(Clone, Copy, Debug)]
pub struct CoinRunPlugin {
    /// Difficulty of the generated levels.
    pub mode: Mode,
    /// Adds rapier colliders to bodies; see [`CoinRunPhysicsPlugin`].
    pub physics: bool,
}

impl Default for CoinRunPlugin {
    fn default() -> Self {
        Self { mode: Mode::Hard, physics: true }
    }
}

impl Plugin for CoinRunPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(CoinRunMode(self.mode))
            .add_observer(arena::start_episode)
            .add_observer(demonstrator_bot::start_episode)
            .add_systems(ObserveSchedule, play::observe.before(VisionSystems::Sync))
            .add_systems(
                FixedPreUpdate,
                (
                    // Each agent has one decider, so the order of deciders of different agents does not matter.
                    demonstrator_bot::decide.in_set(PlaybotSystems::Decide).ambiguous_with(PlaybotSystems::Decide),
                    demonstrator_bot::follow.after(PlaybotSystems::Act),
                ),
            )
            .add_systems(FixedUpdate, play::play.in_set(CoinRunSystems));
        if self.physics {
            app.add_plugins(CoinRunPhysicsPlugin);
        }
    }
}
