//! Messages on standard error. Parts of them come from files and from the operating system, so characters that could
//! steer a terminal are replaced.

use playbot_harness::brief::without_long_words;
use serde::de::IgnoredAny;
use std::borrow::Cow;

/// Returns true if a character steers a terminal: a control character other than line feed and tab, or one that
/// reverses the direction of writing.
fn steers(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t')) || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Replaces characters that steer a terminal.
fn replaced(text: &str, escape: impl Fn(char) -> String) -> Cow<'_, str> {
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.chars().map(|c| if steers(c) { escape(c) } else { c.to_string() }).collect())
}

/// Replaces characters that steer a terminal, in the form `\u{1b}`.
pub(crate) fn without_controls(text: &str) -> Cow<'_, str> {
    replaced(text, |c| c.escape_unicode().to_string())
}

/// Replaces characters that steer a terminal in data for standard output. JSON keeps its meaning: the form there is
/// `\u001b`. Such characters occur only within a text, and have at most four digits.
pub(crate) fn for_programs(data: &str) -> Cow<'_, str> {
    if data.contains(steers) && is_json(data) {
        return replaced(data, |c| format!("\\u{:04x}", u32::from(c)));
    }
    without_controls(data)
}

/// Returns true if a text is JSON, of one value or of several.
fn is_json(text: &str) -> bool {
    serde_json::Deserializer::from_str(text).into_iter::<IgnoredAny>().all(|value| value.is_ok())
}

/// Longest word that is printed whole: no path or number is longer.
const LONGEST_WORD: usize = 4096;

/// Prepares a message for people: no control characters, and no word that fills the terminal.
pub(crate) fn for_people(text: &str) -> String {
    without_long_words(&without_controls(text), LONGEST_WORD).into_owned()
}

/// Prints a line on standard error. A closed standard error, or one on a full disk, loses the words: work does not end
/// for that, as it would with `eprintln!`.
macro_rules! report {
    () => { report!("") };
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let words = format!($($words)*);
        let _ = writeln!(std::io::stderr().lock(), "{}", $crate::output::messages::for_people(&words));
    }};
}

/// Prints the beginning of a line, see [`report`].
macro_rules! begin_report {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let words = format!($($words)*);
        let _ = write!(std::io::stderr().lock(), "{}", $crate::output::messages::for_people(&words));
    }};
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_steers_the_terminal() {
        let shown = without_controls("a\u{1b}[2Jb\u{7}\r\n\tc\u{9b}\u{202e}d");
        assert_eq!(shown, "a\\u{1b}[2Jb\\u{7}\\u{d}\n\tc\\u{9b}\\u{202e}d");
        assert!(matches!(without_controls("± 3 – Grün\n"), Cow::Borrowed(_)));
    }

    #[test]
    fn json_without_controls_is_the_same_json() {
        let evil = "a\u{202e}\u{2066}\u{9b}31m\u{7f}\u{1b}[2Jü";
        let value = serde_json::json!({ evil: [evil, 1] });
        for lines in [value.to_string(), format!("{value}\n{value}"), format!("{value:#}")] {
            let shown = for_programs(&lines);
            assert!(
                shown.contains("a\\u202e\\u2066\\u009b31m\\u007f\\u001b[2Jü") && !shown.contains(steers),
                "{shown}"
            );
            let mut values = serde_json::Deserializer::from_str(&shown).into_iter::<serde_json::Value>();
            assert!(values.all(|read| read.expect("JSON") == value), "{shown}");
        }
        assert_eq!(for_programs("not JSON: \"\u{202e}\""), "not JSON: \"\\u{202e}\"");
        assert!(matches!(for_programs("{\"a\":\"ü\"}"), Cow::Borrowed(_)));
    }

    #[test]
    fn no_word_fills_the_screen() {
        let words = for_people(&format!("warning: there is no {}: name another", "k".repeat(10_000_000)));
        assert!(
            words.len() < 4096 && words.starts_with("warning: there is no kkk") && words.ends_with("k: name another")
        );
    }
}
