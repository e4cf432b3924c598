//! Counting ticks.

use bevy::prelude::*;

/// Number of fixed ticks since the World began.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct Tick(pub u64);

pub(crate) fn count_tick(mut tick: ResMut<Tick>) {
    tick.0 += 1;
}
