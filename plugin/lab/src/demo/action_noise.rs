//! Noise on the actions of a recorded player, so that recordings also show how to recover.

use bevy::prelude::*;
use bevy_playbot::{
    bot::with_noise,
    placement::{TickSchedules, is_tick},
    prelude::*,
};
use playbot_learner::{Streams, rng::ChaCha8Rng};

/// Replaces some of an agent's actions, or adds noise to them, for any controller.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub(super) struct ActionNoise {
    noise: f64,
    rng: ChaCha8Rng,
}

impl ActionNoise {
    /// Creates noise with this share of random actions, or with this standard deviation for continuous ones, drawn from
    /// `seed`.
    pub(super) fn new(noise: f64, seed: u64) -> Self {
        Self { noise, rng: Streams::new(seed).stream("demo.noise", 0) }
    }

    /// Installs the system in a World. It runs after the controllers, and before the game reads the action.
    pub(super) fn install(world: &mut World) {
        let TickSchedules { decide, .. } = *world.resource::<TickSchedules>();
        let system = add_noise.after(PlaybotSystems::Decide).before(PlaybotSystems::Act).run_if(is_tick);
        world.resource_mut::<Schedules>().add_systems(decide, system);
    }
}

fn add_noise(mut agents: Query<(&Agent, &Episode, &mut ActionNoise, &mut Action)>) {
    for (agent, episode, mut noise, mut action) in &mut agents {
        if episode.is_running() {
            let share = noise.noise;
            action.0 = with_noise(action.0.clone(), &agent.actions, share, &mut noise.rng);
        }
    }
}
