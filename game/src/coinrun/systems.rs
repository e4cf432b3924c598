//! When a tick of CoinRun is played.

use bevy::prelude::*;

/// The tick of CoinRun, in `FixedUpdate`. Add what your game adds before or after it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CoinRunSystems;
