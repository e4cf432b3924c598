//! Changes of bytes, regardless of their meaning.

use super::dice::Dice;

/// Extreme lengths.
pub(super) const EXTREME_WORDS: [u64; 9] = [0, 1, 7, 255, 1 << 16, u32::MAX as u64, 1 << 40, i64::MAX as u64, u64::MAX];

/// Most bytes that are put in or taken out at once.
const PART: usize = 64;

/// Changes one place of some bytes: a bit, a byte, a part that is removed, doubled or new, or the end.
pub(super) fn change_bytes(bytes: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if bytes.is_empty() {
        return vec![dice.roll(256) as u8];
    }
    let at = dice.roll(bytes.len());
    let end = (at + 1 + dice.roll(PART)).min(bytes.len());
    match dice.roll(7) {
        0 | 1 => bytes[at] ^= 1 << dice.roll(8),
        2 => bytes[at] = *dice.pick(&[0, 1, 0x7f, 0x80, 0xff, b'"', b'\n']),
        3 => drop(bytes.drain(at..end)),
        4 => bytes.truncate(at),
        5 => {
            let part = bytes[at..end].to_vec();
            bytes.splice(at..at, part);
        }
        _ => {
            let part: Vec<u8> = (0..1 + dice.roll(PART)).map(|_| dice.roll(256) as u8).collect();
            bytes.splice(at..at, part);
        }
    }
    bytes
}
