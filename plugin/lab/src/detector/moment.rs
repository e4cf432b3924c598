//! What detectors see of a tick.

use bevy::prelude::*;
use bevy_playbot::{action::ActionValue, state_hash::StateHash};

use super::proofs::Proofs;

/// A tick of an episode that was just played, as it left the World.
#[derive(Clone, Copy)]
pub struct Moment<'a> {
    /// The World: to be read only. Other agents may play in it.
    pub world: &'a World,
    /// Who plays.
    pub agent: Entity,
    /// Level of the episode.
    pub level: u64,
    /// The tick, counted from 0.
    pub tick: u32,
    /// What the agent did.
    pub action: &'a ActionValue,
    /// What it had seen before; may be empty.
    pub observation: &'a [f32],
    /// The game's hash of the state; 0 if it keeps none.
    pub state_hash: u64,
    /// What was paid.
    pub reward: f32,
    /// Where the agent is on its level's plan, if the game says.
    pub place: Option<Vec2>,
    /// Whether the level's aim was reached, now or before.
    pub is_success: bool,
    /// What the game can prove.
    pub proofs: &'a dyn Proofs,
}

/// A tick of a World.
#[derive(Clone, Copy)]
pub struct WorldMoment<'a> {
    /// The World: to be read only.
    pub world: &'a World,
    /// What was logged as an error in this tick, by anybody but the engine. Only for who
    /// [hears errors](super::WorldWatch::hears_errors).
    pub errors: &'a [String],
}

impl Moment<'_> {
    /// A hash of all that is known of the state: the game's own hash, the observation and the place.
    pub fn fingerprint(&self) -> u64 {
        let place = self.place.map_or([0.0; 2], |place| place.to_array());
        let numbers = self.observation.iter().copied().chain(place).map(|number| u64::from(number.to_bits()));
        StateHash::of([self.state_hash].into_iter().chain(numbers)).0
    }

    /// How high the agent is: its place on the plan, or else its transform.
    pub fn height(&self) -> Option<f32> {
        let transform = || self.world.get::<Transform>(self.agent).map(|transform| transform.translation.y);
        self.place.map(|place| place.y).or_else(transform)
    }
}
