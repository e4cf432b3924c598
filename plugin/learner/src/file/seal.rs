//! Checksums inside files, which reveal damage before the contents are used.
//!
//! A seal stands at a fixed position near the start of a text. It is a prefix, the CRC-32 (the one of zip, ISO-HDLC) as
//! eight hexadecimal digits, and a suffix. A text that almost has a seal has a damaged one. A text without any was
//! written by an older version.

use thiserror::Error;

/// Digits of a checksum.
const DIGITS: usize = 8;

/// Bytes in which prefix and suffix may differ from those of a seal and still count as a damaged one. Texts without a
/// seal differ in more.
const ALMOST: usize = 3;

/// The first entry of a JSON object.
const JSON: Form = Form { prefix: b"{\"crc32\":\"", suffix: b"\"," };

/// The first line of a text whose comments begin with two slashes.
const COMMENT: Form = Form { prefix: b"// crc32 ", suffix: b"\n" };

/// The checksum of a text differs from that of its contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the file is damaged: its checksum does not match its contents")]
pub struct BrokenSeal;

/// A text with a verified checksum.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unsealed {
    /// The text without its checksum.
    pub text: String,
    /// True if it had a checksum. Older versions wrote none.
    pub had_seal: bool,
}

/// The form of a seal in some kind of text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    pub(super) prefix: &'static [u8],
    pub(super) suffix: &'static [u8],
}

impl Form {
    /// Returns the digits at the start of `bytes`; `None` without a seal.
    pub(super) fn digits(self, bytes: &[u8]) -> Result<Option<u32>, BrokenSeal> {
        let differences = |known: &[u8], found: &[u8]| {
            let missing = known.len().saturating_sub(found.len());
            known.iter().zip(found).filter(|(known, found)| known != found).count() + missing
        };
        let after = bytes.get(self.prefix.len() + DIGITS..).unwrap_or_default();
        match differences(self.prefix, bytes) + differences(self.suffix, after) {
            0 => Self::number(&bytes[self.prefix.len()..][..DIGITS]).map(Some).ok_or(BrokenSeal),
            1..=ALMOST => Err(BrokenSeal),
            _ => Ok(None),
        }
    }

    /// Returns the position of the digits.
    pub(super) fn place(self) -> std::ops::Range<usize> {
        self.prefix.len()..self.prefix.len() + DIGITS
    }

    /// Returns the length of a whole seal in bytes.
    fn len(self) -> usize {
        self.prefix.len() + DIGITS + self.suffix.len()
    }

    /// Parses digits in lower case only, as they are written: an upper-case digit is a flipped bit.
    fn number(digits: &[u8]) -> Option<u32> {
        let are_digits = digits.iter().all(|digit| matches!(digit, b'0'..=b'9' | b'a'..=b'f'));
        are_digits.then(|| u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok())?
    }
}

/// Returns a JSON object with its checksum as the first entry, `crc32`. The checksum is over the bytes of `object`,
/// which must have an entry.
///
/// ```
/// # use playbot_learner::{seal_json, unseal_json};
/// let sealed = seal_json(r#"{"step":8}"#);
/// assert_eq!(sealed, r#"{"crc32":"c0db16d8","step":8}"#);
/// assert_eq!(unseal_json(&sealed).expect("not damaged").text, r#"{"step":8}"#);
/// assert!(unseal_json(&sealed.replace('8', "9")).is_err());
/// ```
pub fn seal_json(object: &str) -> String {
    let entries = object.strip_prefix('{').unwrap_or(object);
    format!("{{\"crc32\":\"{}\",{entries}", digits_of(object.as_bytes()))
}

/// Returns the object that [`seal_json`] was given.
///
/// # Errors
///
/// [`BrokenSeal`].
pub fn unseal_json(text: &str) -> Result<Unsealed, BrokenSeal> {
    unseal(text, JSON, |rest| format!("{{{rest}"))
}

/// Returns a text with its checksum in a comment on the first line.
pub fn seal_text(text: &str) -> String {
    format!("// crc32 {}\n{text}", digits_of(text.as_bytes()))
}

/// Returns the text that [`seal_text`] was given.
///
/// # Errors
///
/// [`BrokenSeal`].
pub fn unseal_text(text: &str) -> Result<Unsealed, BrokenSeal> {
    unseal(text, COMMENT, str::to_owned)
}

fn unseal(text: &str, form: Form, whole: impl FnOnce(&str) -> String) -> Result<Unsealed, BrokenSeal> {
    let Some(sum) = form.digits(text.as_bytes())? else {
        return Ok(Unsealed { text: text.to_owned(), had_seal: false });
    };
    // The suffix is ASCII, so a character begins behind it.
    let text = whole(&text[form.len()..]);
    if crc32fast::hash(text.as_bytes()) == sum { Ok(Unsealed { text, had_seal: true }) } else { Err(BrokenSeal) }
}

/// Returns the checksum of `bytes` in its written form.
pub(super) fn digits_of(bytes: &[u8]) -> String {
    format!("{:08x}", crc32fast::hash(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flips(text: &str) -> impl Iterator<Item = String> {
        let bytes = text.as_bytes().to_vec();
        let flip = move |at: usize| {
            let mut bytes = bytes.clone();
            bytes[at / 8] ^= 1 << (at % 8);
            // A text that is not UTF-8 is refused before the seal is checked.
            String::from_utf8(bytes).ok()
        };
        (0..text.len() * 8).filter_map(flip)
    }

    #[test]
    fn no_flipped_bit_is_accepted() {
        let sealed = seal_json(r#"{"step":8,"a/b":0.5}"#);
        assert!(flips(&sealed).all(|text| unseal_json(&text).is_err()));
        let sealed = seal_text("(\n    game: \"coinrun\",\n)\n");
        assert!(flips(&sealed).all(|text| unseal_text(&text).is_err()));
    }

    #[test]
    fn no_part_is_accepted() {
        let sealed = seal_json(r#"{"step":8}"#);
        // Less than a seal is not a JSON object.
        assert!((JSON.len() - ALMOST..sealed.len()).all(|length| unseal_json(&sealed[..length]).is_err()));
        let sealed = seal_text("(a: 1)\n");
        assert!((COMMENT.len() - ALMOST..sealed.len()).all(|length| unseal_text(&sealed[..length]).is_err()));
    }

    #[test]
    fn what_was_written_without_a_seal_is_distinguished() {
        for text in
            ["", "{", "{}", r#"{"step":8}"#, r#"{"algorithm":"ppo","seed":1}"#, r#"{"arenas":[[]],"progress":{}}"#]
        {
            let read = unseal_json(text).expect("no seal");
            assert_eq!((read.text.as_str(), read.had_seal), (text, false));
        }
        for text in ["", "(\n    game: \"coinrun\",\n)", "// The settings of a run.\n()"] {
            assert_eq!(unseal_text(text), Ok(Unsealed { text: text.to_owned(), had_seal: false }));
        }
    }
}
