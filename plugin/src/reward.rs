//! What the game pays an agent.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! /// The game's own system: time costs a little, and a coin in the second tick is worth a point.
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
