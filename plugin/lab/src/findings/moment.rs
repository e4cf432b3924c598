//! What a check sees of an episode.

use bevy::prelude::*;
use bevy_playbot::episode::EpisodeResult;

use crate::game::Game;

/// An episode after one of its ticks.
#[derive(Clone, Copy)]
pub struct Moment<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Its mode.
    pub mode: &'a str,
    /// Its World, with one agent.
    pub world: &'a World,
    /// The agent.
    pub agent: Entity,
    /// The tick that has just been played, from 0.
    pub tick: u32,
    /// What came of the episode, if it ended in this tick.
    pub end: Option<EpisodeResult>,
    /// What was logged as an error since the tick before, by anybody but the engine.
    pub errors: &'a [String],
}

/// Hears every tick of an episode in their order, and says in which tick the finding was seen, once it was.
pub type Watcher = Box<dyn FnMut(&Moment) -> Option<u32>>;
