//! The data of a tick that detectors examine.

use bevy::prelude::*;
use bevy_playbot::{action::ActionValue, state_hash::StateHash};

use super::proofs::Proofs;

/// A tick of an episode that was just played, with the World after it.
#[derive(Clone, Copy)]
pub struct Moment<'a> {
    /// The World: to be read only. Other agents may play in it.
    pub world: &'a World,
    /// The agent.
    pub agent: Entity,
    /// Level of the episode.
    pub level: u64,
    /// The tick, counted from 0.
    pub tick: u32,
    /// The agent's action.
    pub action: &'a ActionValue,
    /// The observation before the action; may be empty.
    pub observation: &'a [f32],
    /// The game's hash of the state; 0 if it has none.
    pub state_hash: u64,
    /// The reward.
    pub reward: f32,
    /// Position of the agent on its level's plan, if the game reports it.
    pub place: Option<Vec2>,
    /// Whether the level's goal was reached, now or before.
    pub is_success: bool,
    /// The game's proofs.
    pub proofs: &'a dyn Proofs,
}

/// A tick of a World.
#[derive(Clone, Copy)]
pub struct WorldMoment<'a> {
    /// The World: to be read only.
    pub world: &'a World,
    /// Errors that were logged in this tick, except by the engine. Only for detectors that
    /// [read the log](super::WorldWatch::hears_errors).
    pub errors: &'a [String],
}

impl Moment<'_> {
    /// Returns a hash of the known state: the game's own hash, the observation and the position.
    pub fn fingerprint(&self) -> u64 {
        let place = self.place.map_or([0.0; 2], |place| place.to_array());
        let numbers = self.observation.iter().copied().chain(place).map(|number| u64::from(number.to_bits()));
        StateHash::of([self.state_hash].into_iter().chain(numbers)).0
    }

    /// Returns the agent's height: its position on the plan, or else its transform.
    pub fn height(&self) -> Option<f32> {
        let transform = || self.world.get::<Transform>(self.agent).map(|transform| transform.translation.y);
        self.place.map(|place| place.y).or_else(transform)
    }
}
