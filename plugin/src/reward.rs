//! What the game pays an agent.

use bevy::prelude::*;

/// Reward of the current tick. The game adds to it in `FixedUpdate`; it is zero again at the start of the next tick.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component)]
pub struct Reward(f32);

impl Reward {
    /// Pays `amount` on top of what was paid in this tick.
    pub fn add(&mut self, amount: f32) {
        self.0 += amount;
    }

    /// What was paid in this tick.
    pub fn get(&self) -> f32 {
        self.0
    }
}

pub(crate) fn clear_rewards(mut rewards: Query<&mut Reward>) {
    for mut reward in &mut rewards {
        reward.0 = 0.0;
    }
}
