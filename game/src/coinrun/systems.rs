//! System set of a tick of CoinRun.

use bevy::prelude::*;

/// The tick of CoinRun, in `FixedUpdate`. Systems of your game go before or after it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CoinRunSystems;
