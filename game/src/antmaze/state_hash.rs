//! A fingerprint of a running episode.

use crate::ant::AntState;

/// Start value and factor of 64-bit FNV-1a.
const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

/// FNV-1a over 32-bit words instead of bytes: the tick, then the bit patterns of the 29 numbers of the ant's state.
/// Negative zero counts as zero.
///
/// What else decides how the ant goes on, contacts and the like, follows from earlier states: where it differs, the states
/// do so one tick later.
pub fn hash_state(state: &AntState, tick: u32) -> u64 {
    // Adding zero turns negative zero into zero and changes nothing else.
    let numbers = state.qpos.iter().chain(&state.qvel).map(|value| (value + 0.0).to_bits());
    std::iter::once(tick).chain(numbers).fold(FNV_OFFSET, |hash, word| (hash ^ u64::from(word)).wrapping_mul(FNV_PRIME))
}
