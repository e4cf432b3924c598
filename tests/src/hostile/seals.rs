//! Checksums of files, computed anew: the parts behind them are read only if they fit.

use playbot_learner::{seal_json, seal_text};

/// The beginning of a JSON object with a checksum.
pub(super) const JSON_SEAL: &str = "{\"crc32\":\"";
/// Bytes of the checksum and its surroundings.
pub(super) const JSON_SEAL_LENGTH: usize = "{\"crc32\":\"00000000\",".len();
/// The beginning of the first line of a text with a checksum.
const TEXT_SEAL: &str = "// crc32 ";

/// Returns the CRC-32 of bytes, in the form of files.
pub(super) fn digits(bytes: &[u8]) -> String {
    format!("{:08x}", crc32fast::hash(bytes))
}

/// Returns a JSON object without its checksum, and whether it had one.
pub(super) fn unsealed_object(text: &str) -> (String, bool) {
    match text.get(JSON_SEAL_LENGTH..) {
        Some(rest) if text.starts_with(JSON_SEAL) => (format!("{{{rest}"), true),
        _ => (text.to_owned(), false),
    }
}

/// Returns the text behind the first line, if that is its checksum.
pub(super) fn unsealed_text(text: &str) -> &str {
    match text.split_once('\n') {
        Some((first, rest)) if first.starts_with(TEXT_SEAL) => rest,
        _ => text,
    }
}

/// Returns the object with a new checksum, if it has one.
pub(super) fn reseal_object(text: &str) -> String {
    match unsealed_object(text) {
        (object, true) => seal_json(&object),
        (text, false) => text,
    }
}

/// Returns the text with a new checksum, if it has one.
pub(super) fn reseal_text(text: &str) -> String {
    let rest = unsealed_text(text);
    if rest.len() < text.len() { seal_text(rest) } else { text.to_owned() }
}

/// Returns the lines with new checksums, where they have one.
pub(super) fn reseal_lines(text: &str) -> String {
    text.split('\n').map(reseal_object).collect::<Vec<_>>().join("\n")
}

/// Returns results with the checksum of all lines before the last one, where they end with one.
pub(super) fn reseal_results(text: &str) -> String {
    match text.rfind("\n]") {
        Some(at) => format!("{}],\"crc32\":\"{}\"}}\n", &text[..=at], digits(&text.as_bytes()[..=at])),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use playbot_learner::{unseal_json, unseal_text};

    use super::*;

    #[test]
    fn checksums_fit_again() {
        assert_eq!(digits(b"123456789"), "cbf43926", "the check value of the standard");
        let damaged = seal_json("{\"a\":1}").replace("\"a\":1", "\"a\":2");
        assert!(unseal_json(&damaged).is_err());
        assert_eq!(unseal_json(&reseal_object(&damaged)).expect("it fits").text, "{\"a\":2}");
        let damaged = seal_text("(a: 1)\n").replace("a: 1", "a: 2");
        assert!(unseal_text(&damaged).is_err());
        assert_eq!(unseal_text(&reseal_text(&damaged)).expect("it fits").text, "(a: 2)\n");
        for without in ["", "{\"a\":1}", "x\n\n{"] {
            assert_eq!((reseal_lines(without), reseal_text(without)), (without.to_owned(), without.to_owned()));
        }
        assert_eq!(reseal_results("{\n]x"), format!("{{\n],\"crc32\":\"{}\"}}\n", digits(b"{\n")));
    }
}
