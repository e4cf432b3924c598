//! Changes of files of tensors: models, checkpoints and policies.

use super::{
    bytes::{EXTREME_WORDS, change_bytes},
    dice::Dice,
    pieces::string_length,
    seals::{JSON_SEAL, JSON_SEAL_LENGTH, digits},
    texts::mutate_text,
};

/// Bytes of the header's length.
const LENGTH: usize = 8;
/// The text in the header before the description, which is JSON in a string.
const DESCRIPTION: &str = "\"playbot\":";
/// The beginning of a header with a checksum.
const SEALED: &[u8] = br#"{"__metadata__":{"playbot":"{\"crc32\":\""#;
/// Digits of a checksum.
const DIGITS: usize = 8;

/// Floats that are no numbers, or extreme ones.
const FLOATS: [f32; 6] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, -0.0];

/// Changes one thing about a file: its description, its list of tensors, its lengths or its numbers. `None` if it is no
/// file of tensors any more.
pub(super) fn mutate_tensors(bytes: &[u8], dice: &mut Dice) -> Option<Vec<u8>> {
    let (header, data) = parts(bytes)?;
    Some(match dice.roll(8) {
        0..=2 => joined(&with_description(&header, |text| mutate_text(text, dice))?, data),
        3 | 4 => joined(&mutate_text(&header, dice), data),
        5 => joined(&header, &with_float(data, dice)),
        6 => joined(&header, &change_bytes(data, dice)),
        _ => {
            let length = (*dice.pick(&EXTREME_WORDS)).to_le_bytes();
            [&length[..], &bytes[LENGTH..]].concat()
        }
    })
}

/// Returns the header and what follows it.
fn parts(bytes: &[u8]) -> Option<(String, &[u8])> {
    let length = usize::try_from(u64::from_le_bytes(*bytes.first_chunk()?)).ok()?;
    let end = length.checked_add(LENGTH)?;
    let header = String::from_utf8(bytes.get(LENGTH..end)?.to_vec()).ok()?;
    Some((header, &bytes[end..]))
}

fn joined(header: &str, data: &[u8]) -> Vec<u8> {
    [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), data].concat()
}

/// Returns the header with another description behind the checksum in it.
fn with_description(header: &str, change: impl FnOnce(&str) -> String) -> Option<String> {
    let start = header.find(DESCRIPTION)? + DESCRIPTION.len();
    let end = start + string_length(&header[start..]);
    let description: String = serde_json::from_str(&header[start..end]).ok()?;
    let (seal, rest) = match description.starts_with(JSON_SEAL) {
        true => description.split_at_checked(JSON_SEAL_LENGTH)?,
        false => ("{", description.strip_prefix('{')?),
    };
    let changed = change(&format!("{{{rest}"));
    let changed = changed.strip_prefix('{').unwrap_or(&changed);
    let literal = serde_json::to_string(&format!("{seal}{changed}")).ok()?;
    Some(format!("{}{literal}{}", &header[..start], &header[end..]))
}

fn with_float(data: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut data = data.to_vec();
    let at = 4 * dice.roll(data.len() / 4);
    if let Some(place) = data.get_mut(at..at + 4) {
        place.copy_from_slice(&dice.pick(&FLOATS).to_le_bytes());
    }
    data
}

/// Returns the file with a new checksum, if it has one.
pub(super) fn reseal_tensors(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let place = LENGTH + SEALED.len()..LENGTH + SEALED.len() + DIGITS;
    if bytes.len() >= place.end && bytes[LENGTH..].starts_with(SEALED) {
        bytes[place.clone()].fill(b'0');
        let sum = digits(&bytes);
        bytes[place].copy_from_slice(sum.as_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = r#"{"__metadata__":{"playbot":"{\"crc32\":\"00000000\",\"a\":1}"},"t":{"dtype":"F32"}}"#;

    #[test]
    fn the_description_changes_within_its_string() {
        let changed = with_description(HEADER, |text| text.replace("{\"a\":1}", "{\"b\":\"c\"}")).expect("there");
        let expected = r#"{"__metadata__":{"playbot":"{\"crc32\":\"00000000\",\"b\":\"c\"}"},"t":{"dtype":"F32"}}"#;
        assert_eq!(changed, expected);
    }

    #[test]
    fn a_checksum_is_over_all_bytes_with_zeros_in_its_place() {
        let bytes = joined(HEADER, &[1, 2, 3]);
        let sealed = reseal_tensors(&bytes);
        let sum = digits(&bytes);
        assert_eq!(String::from_utf8_lossy(&sealed[8..]), HEADER.replace("00000000", &sum) + "\u{1}\u{2}\u{3}");
        assert_eq!(reseal_tensors(&sealed), sealed);
        assert_eq!(parts(&sealed).expect("whole").1, [1, 2, 3]);
        assert_eq!(reseal_tensors(b"short"), b"short");
    }
}
