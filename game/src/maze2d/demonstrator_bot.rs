//! The waypoint demonstrator as an agent of the game.

use bevy::prelude::*;
use bevy_playbot::streams::AgentStreams;
use playbot_lab::prelude::*;

use super::{
    components::{MazeArena, MazeBall, PlaysIn},
    demonstrator::Demonstrator,
};

/// Plays by walking from waypoint to waypoint. See [`Demonstrator`].
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct DemonstratorBot {
    noise: f64,
    /// Made anew at the first tick of an episode.
    #[reflect(ignore)]
    walker: Option<Demonstrator>,
}

impl DemonstratorBot {
    /// Takes the standard deviation of normal noise on each axis of its actions.
    pub fn new(noise: f64) -> Self {
        Self { noise, walker: None }
    }
}

pub(super) fn decide(
    mut bots: Query<(&Control, &Episode, &PlaysIn, &MazeBall, &mut DemonstratorBot, &mut AgentStreams, &mut Action)>,
    arenas: Query<&MazeArena>,
) {
    for (control, episode, plays_in, ball, mut bot, mut streams, mut action) in &mut bots {
        if *control != Control::Bot || !episode.is_running() {
            continue;
        }
        let Ok(arena) = arenas.get(plays_in.0) else { continue };
        let (noise, rng) = (bot.noise, &mut streams.action);
        if episode.tick == 0 {
            bot.walker = None;
        }
        let walker =
            bot.walker.get_or_insert_with(|| Demonstrator::new(arena.level.clone(), arena.rules.retarget, rng));
        let push = walker.act(&ball.0, noise, rng);
        action.0 = ActionValue::Continuous(push.map(|axis| axis as f32).to_vec());
    }
}
