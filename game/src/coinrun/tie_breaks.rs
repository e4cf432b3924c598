//! The tie-breaking random numbers of a level, as text.

/// One bit for each of the first 1024 steps, as [`LevelParts`](super::LevelParts) has them.
type TieBreaks = [u64; 16];

/// Digits to a word.
const DIGITS: usize = 16;

/// Writes sixteen hexadecimal digits to a word, the first word first.
pub(super) fn to_text(tie_breaks: &TieBreaks) -> String {
    tie_breaks.iter().map(|word| format!("{word:016x}")).collect()
}

/// Parses the output of [`to_text`].
pub(super) fn from_text(text: &str) -> Option<TieBreaks> {
    let mut tie_breaks = TieBreaks::default();
    if text.len() != DIGITS * tie_breaks.len() || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    for (index, word) in tie_breaks.iter_mut().enumerate() {
        *word = u64::from_str_radix(&text[DIGITS * index..DIGITS * (index + 1)], 16).ok()?;
    }
    Some(tie_breaks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back() {
        let mut some = TieBreaks::default();
        (some[0], some[15]) = (1, u64::MAX);
        let text = to_text(&some);
        assert!(text.starts_with("0000000000000001") && text.ends_with("ffffffffffffffff"));
        assert_eq!(from_text(&text), Some(some));
        for bad in ["", "0", &text[1..], &text.replace('f', "g"), &text.replace('f', "+")] {
            assert_eq!(from_text(bad), None, "{bad}");
        }
    }
}
