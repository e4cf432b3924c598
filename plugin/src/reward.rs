//! The reward of an agent.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! /// A system of the game: time costs a little, and a coin in the second tick is worth a point.
//! fn pay(mut agents: Query<(&Episode, &mut Reward)>) {
//!     for (episode, mut reward) in &mut agents {
//!         reward.add(-0.25);
//!         if episode.tick == 1 {
//!             reward.add(1.0);
//!         }
//!     }
//! }
//!
//! let mut app = headless_app();
//! app.add_systems(FixedUpdate, pay);
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human)).id();
//! app.ticks(2).expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Reward>(agent).expect("every agent has one").get(), 0.75);
//! assert_eq!(app.world().get::<Episode>(agent).expect("every agent has one").total_reward, 0.5);
//! ```

use bevy::prelude::*;

/// Reward of the current tick. The game adds to it in `FixedUpdate`; it is zero again at the start of the next tick.
///
/// Reward added after the tick was counted, such as in `Update`, counts in the next tick. After the
/// end of the episode there is no next tick, so reward is a fault then.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component)]
pub struct Reward {
    now: f32,
    /// Reward added after this tick was counted.
    next: f32,
    is_judged: bool,
    /// True if the last counted tick was the last of its episode.
    is_over: bool,
}

impl Reward {
    /// Adds `amount` to the reward of this tick.
    pub fn add(&mut self, amount: f32) {
        if self.is_judged {
            self.next += amount;
        } else {
            self.now += amount;
        }
    }

    /// Returns the reward of this tick.
    pub fn get(&self) -> f32 {
        self.now
    }

    /// Closes the count of this tick: later reward belongs to the next one.
    pub(crate) fn close(&mut self) {
        self.is_judged = true;
    }

    /// Ends the episode: later reward is too late.
    pub(crate) fn end_episode(&mut self) {
        self.is_over = true;
    }

    /// Begins an episode with zero, and returns reward that came too late for the episode before.
    pub(crate) fn start_episode(&mut self) -> f32 {
        let before = std::mem::take(self);
        if before.is_over { before.now } else { 0.0 }
    }
}

/// Begins a tick with the reward that was added since the last tick was counted.
pub(crate) fn clear_rewards(mut rewards: Query<&mut Reward>) {
    for mut reward in &mut rewards {
        *reward = Reward { now: reward.next, is_over: reward.is_over, ..default() };
    }
}
