//! What is said to people, on standard error. Words of files and of the operating system are among it, so that nothing that
//! could steer a terminal gets through.

use std::borrow::Cow;

use playbot_lab::brief::without_long_words;

/// A text without what steers a terminal: control characters other than line feeds and tabs, and those that turn the
/// direction of writing around, are shown as `\u{1b}` is.
pub fn without_controls(text: &str) -> Cow<'_, str> {
    let steers = |c: char| {
        (c.is_control() && !matches!(c, '\n' | '\t')) || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let shown = |c: char| if steers(c) { c.escape_unicode().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(shown).collect())
}

/// Longest word that is said whole: no path or number is longer.
const LONGEST_WORD: usize = 4096;

/// What people are told: nothing that steers their terminal, and no word that fills it.
pub fn for_people(text: &str) -> String {
    without_long_words(&without_controls(text), LONGEST_WORD).into_owned()
}

/// A line on standard error. Whoever has closed it, or keeps it on a disk that is full, misses the words: work does not end
/// because nobody listens, as it would with `eprintln!`.
macro_rules! tell {
    () => { tell!("") };
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let words = format!($($words)*);
        let _ = writeln!(std::io::stderr().lock(), "{}", $crate::tell::for_people(&words));
    }};
}

/// The beginning of a line, see [`tell`].
macro_rules! begin_to_tell {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let words = format!($($words)*);
        let _ = write!(std::io::stderr().lock(), "{}", $crate::tell::for_people(&words));
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
    fn no_word_fills_the_screen() {
        let told = for_people(&format!("warning: there is no {}: name another", "k".repeat(10_000_000)));
        assert!(told.len() < 4096 && told.starts_with("warning: there is no kkk") && told.ends_with("k: name another"));
    }
}
