//! Tests of one flipped bit anywhere in any file that has a checksum.

use playbot_tests::hostile::{Dice, Reading};

use crate::{KINDS, whole};

/// Tries over all kinds, and those of a kind that is read into a World.
const TRIES: usize = 10_000;
const SLOW_TRIES: usize = 100;

#[test]
fn one_flipped_bit_is_never_accepted_silently() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = folder.path().join("kind");
    let (slow, fast): (Vec<_>, Vec<_>) = KINDS.iter().filter(|kind| kind.is_sealed()).partition(|kind| kind.is_slow);
    let each = (TRIES - SLOW_TRIES * slow.len()).div_ceil(fast.len());
    let (mut dice, mut tried) = (Dice::new(1), 0);
    for kind in slow.into_iter().chain(fast) {
        let parts = whole(kind, &place);
        for _ in 0..if kind.is_slow { SLOW_TRIES } else { each } {
            let mut bytes = kind.bytes().to_vec();
            let at = dice.roll(8 * bytes.len());
            bytes[at / 8] ^= 1 << (at % 8);
            kind.put(&place, &bytes);
            if let Reading::Whole(found) = kind.read(&place) {
                assert!(found == parts, "{}, bit {at}: accepted with other contents", kind.name);
            }
            tried += 1;
        }
    }
    assert!(tried >= TRIES && KINDS.len() > 20, "{tried} tries, {} kinds", KINDS.len());
}
