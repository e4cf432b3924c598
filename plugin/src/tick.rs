//! The count of ticks.
//!
//! ```
//! use bevy_playbot::{prelude::*, tick::Tick};
//!
//! let mut app = headless_app();
//! app.ticks(3).expect("no agent broke its contract");
//! assert_eq!(app.world().resource::<Tick>(), &Tick(3));
//! ```

use bevy::prelude::*;

/// Number of fixed ticks since the World began.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct Tick(pub u64);

pub(crate) fn count_tick(mut tick: ResMut<Tick>) {
    tick.0 += 1;
}
