//! AntMaze as a Bevy plugin.

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

use super::{
    arena,
    components::{AntMazeRules, MazeAnt},
    demonstrator_bot,
    mode::AntMazeMode,
    play,
};
use crate::ant::steering;

/// The tick of AntMaze, in `FixedUpdate`. Add what your game adds before or after it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AntMazeSystems;

/// Adds the rules of AntMaze. Agents are made by [`spawn_agent`](super::game::spawn_agent).
#[derive(Clone, Debug)]
pub struct AntMazePlugin {
    /// Mode of the levels.
    pub mode: AntMazeMode,
}

impl Plugin for AntMazePlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(AntMazeRules(self.mode.clone()))
            .add_observer(arena::start_episode)
            .add_systems(ObserveSchedule, play::observe.before(VisionSystems::Sync))
            .add_systems(
                FixedPreUpdate,
                (demonstrator_bot::decide, steering::steer::<MazeAnt>.run_if(resource_exists::<ButtonInput<KeyCode>>))
                    .chain()
                    .after(PlaybotSystems::Decide)
                    .before(PlaybotSystems::Act),
            )
            .add_systems(FixedUpdate, play::play.in_set(AntMazeSystems));
    }
}
