//! Maze2D as a Bevy plugin.

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

use super::{
    arena::{self, WithPhysics},
    components::Maze2dRules,
    demonstrator_bot,
    mode::Maze2dMode,
    play,
};

/// The tick of Maze2D, in `FixedUpdate`. Add what your game adds before or after it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Maze2dSystems;

/// Adds the rules of Maze2D. Agents are made by [`spawn_agent`](super::game::spawn_agent).
#[derive(Clone, Debug)]
pub struct Maze2dPlugin {
    /// Map and rules.
    pub mode: Maze2dMode,
    /// Adds a rapier context to arenas even where the contact does not need it; see
    /// [`MazePhysics`](super::physics::MazePhysics).
    pub physics: bool,
}

impl Maze2dPlugin {
    /// Takes a mode, and adds a physics context to every arena.
    pub fn new(mode: Maze2dMode) -> Self {
        Self { mode, physics: true }
    }
}

impl Plugin for Maze2dPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Maze2dRules(self.mode.clone()))
            .insert_resource(WithPhysics(self.physics))
            .add_observer(arena::start_episode)
            .add_systems(ObserveSchedule, play::observe.before(VisionSystems::Sync))
            // Each agent has one decider, so the order of deciders of different agents does not matter.
            .add_systems(
                FixedPreUpdate,
                demonstrator_bot::decide.in_set(PlaybotSystems::Decide).ambiguous_with(PlaybotSystems::Decide),
            )
            .add_systems(FixedUpdate, play::play.in_set(Maze2dSystems));
    }
}
