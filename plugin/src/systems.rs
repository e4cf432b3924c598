//! System sets of the plugin, and the schedule of sensors.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! /// Hits are known after the physics, and still count in this tick.
//! fn pay_for_hits(mut rewards: Query<&mut Reward>) {
//!     rewards.iter_mut().for_each(|mut reward| reward.add(-1.0));
//! }
//!
//! let mut app = headless_app();
//! app.add_systems(FixedPostUpdate, pay_for_hits.before(PlaybotSystems::Judge));
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human)).id();
//! app.tick().expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Episode>(agent).expect("every agent has one").total_reward, -1.0);
//! ```

use bevy::{ecs::schedule::ScheduleLabel, prelude::*};

/// Parts of a tick, in this order, in the schedules that
/// [`TickSchedules`](crate::placement::TickSchedules) names: by default `FixedPreUpdate` and
/// `FixedPostUpdate`.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlaybotSystems {
    /// `FixedPreUpdate`: agents without a level get one.
    Begin,
    /// `FixedPreUpdate`: a game whose levels take several frames marks those that are ready:
    /// [`Episode::ready`](crate::episode::Episode::ready).
    Load,
    /// `FixedPreUpdate`: [`ObserveSchedule`] fills the observations.
    Observe,
    /// `FixedPreUpdate`: the source of the agent's [`Control`](crate::control::Control) writes the
    /// action.
    Decide,
    /// `FixedPreUpdate`: actions are checked and handed to the game's input.
    Act,
    /// `FixedPostUpdate`: reward and length are counted.
    Judge,
    /// `FixedPostUpdate`: the tick is recorded, for demonstrations and for the learner.
    Record,
    /// `FixedPostUpdate`: ended episodes are announced.
    Reset,
}

/// The game's sensors. Runs in [`PlaybotSystems::Observe`], and once more after a tick that
/// truncated an episode, since the learner needs the value of the last state.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObserveSchedule;

/// Runs the sensors.
// Hidden: planted defects of playbot_lab come right behind it; games need none of it.
#[doc(hidden)]
pub fn run_observe_schedule(world: &mut World) {
    world.run_schedule(ObserveSchedule);
}
