//! A fingerprint of a running episode.

use bevy_playbot::state_hash::StateHash;

use super::body::Body;

/// Returns the hash of the step number, then of the bit patterns of x, y, vx and vy of the player and of every enemy.
/// Enemies come in creation order. Negative zero counts as zero.
pub fn hash_state<'a>(player: &'a Body, enemies: impl IntoIterator<Item = &'a Body>, step: u32) -> u64 {
    let bodies = std::iter::once(player).chain(enemies);
    // Adding zero turns negative zero into zero and changes nothing else.
    let words =
        bodies.flat_map(|body| [body.x, body.y, body.vx, body.vy].map(|value| u64::from((value + 0.0).to_bits())));
    StateHash::of(std::iter::once(u64::from(step)).chain(words)).0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_counts() {
        let player = Body::player();
        let enemy = Body::enemy([4, 1], 1);
        let base = hash_state(&player, [&enemy], 3);
        assert_eq!(base, hash_state(&Body { vx: -0.0, ..player }, [&enemy], 3));
        assert_ne!(base, hash_state(&player, [&enemy], 4));
        assert_ne!(base, hash_state(&player, [], 3));
        let nudged = Body { x: enemy.x + 1e-6, ..enemy };
        assert_ne!(base, hash_state(&player, [&nudged], 3));
    }
}
