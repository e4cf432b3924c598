//! A fingerprint of a running episode.

use super::body::Body;

/// Start value and factor of 64-bit FNV-1a.
const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

/// FNV-1a over 32-bit words instead of bytes: the step number, then the bit patterns of x, y, vx
/// and vy of the player and of every enemy in creation order. Negative zero counts as zero.
pub fn hash_state<'a>(player: &'a Body, enemies: impl IntoIterator<Item = &'a Body>, step: u32) -> u64 {
    let mut hash = mix(FNV_OFFSET, step);
    for body in std::iter::once(player).chain(enemies) {
        for value in [body.x, body.y, body.vx, body.vy] {
            // Adding zero turns negative zero into zero and changes nothing else.
            hash = mix(hash, (value + 0.0).to_bits());
        }
    }
    hash
}

fn mix(hash: u64, word: u32) -> u64 {
    (hash ^ u64::from(word)).wrapping_mul(FNV_PRIME)
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
