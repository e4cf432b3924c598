//! What the game pays an agent.

use bevy::prelude::*;

/// Reward of the current tick. The game adds to it in `FixedUpdate`; it is zero again at the start of the next tick.
///
/// What is paid after the tick was judged, such as in `Update`, counts in the next tick. Once the episode has ended there is
/// no next tick: that is a fault.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component)]
pub struct Reward {
    now: f32,
    /// Paid after this tick was judged.
    next: f32,
    is_judged: bool,
    /// The last judged tick was the last of its episode.
    is_over: bool,
}

impl Reward {
    /// Pays `amount` on top of what was paid in this tick.
    pub fn add(&mut self, amount: f32) {
        if self.is_judged {
            self.next += amount;
        } else {
            self.now += amount;
        }
    }

    /// What was paid in this tick.
    pub fn get(&self) -> f32 {
        self.now
    }

    /// This tick is counted: whatever is paid now belongs to the next one.
    pub(crate) fn close(&mut self) {
        self.is_judged = true;
    }

    /// The episode is over: whatever is paid now is too late.
    pub(crate) fn end_episode(&mut self) {
        self.is_over = true;
    }

    /// Begins an episode with nothing, and returns what came too late for the one before.
    pub(crate) fn start_episode(&mut self) -> f32 {
        let before = std::mem::take(self);
        if before.is_over { before.now } else { 0.0 }
    }
}

/// Begins a tick with what was paid since the last one was judged.
pub(crate) fn clear_rewards(mut rewards: Query<&mut Reward>) {
    for mut reward in &mut rewards {
        *reward = Reward { now: reward.next, is_over: reward.is_over, ..default() };
    }
}
