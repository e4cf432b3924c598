//! The data of a tick that checks examine.

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
    /// The result of the episode, if it ended in this tick.
    pub end: Option<EpisodeResult>,
    /// Errors that were logged since the tick before, except by the engine.
    pub errors: &'a [String],
}

/// A function that receives every tick of an episode in order, and returns the tick of the finding, once it was seen.
pub type Watcher = Box<dyn FnMut(&Moment) -> Option<u32>>;
