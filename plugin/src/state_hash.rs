//! A hash of the game's state, by which a replay proves that it is the same run.
//!
//! ```
//! use bevy_playbot::prelude::*;
//!
//! let ball = |x: f32, y: f32| StateHash::of([x.to_bits().into(), y.to_bits().into()]);
//! assert_eq!(ball(1.0, 2.0), ball(1.0, 2.0));
//! assert_ne!(ball(1.0, 2.0), ball(2.0, 1.0), "the order counts");
//! assert_ne!(ball(1.0, 2.0), ball(1.0, 2.000_001), "and so does every bit");
//! ```

use crate::carry_over::ReflectCarryComponent;
use bevy::prelude::*;

/// Hash of all state that decides how the agent's arena goes on, written by the game after its own
/// step.
///
/// A game that leaves it at zero can be recorded and replayed, but then a replay proves nothing.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct StateHash(pub u64);

/// Start value and factor of 64-bit FNV-1a.
const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;

const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

impl StateHash {
    /// Returns FNV-1a over words instead of bytes. The order of the words counts.
    pub fn of(words: impl IntoIterator<Item = u64>) -> Self {
        Self(words.into_iter().fold(FNV_OFFSET, |hash, word| (hash ^ word).wrapping_mul(FNV_PRIME)))
    }

    /// Returns the 32 bits that recordings keep: both halves folded together.
    pub fn folded(&self) -> u32 {
        (self.0 ^ (self.0 >> 32)) as u32
    }
}
