//! Texts short enough for an error message.

use std::borrow::Cow;

/// Longest word of an error that is printed whole, in characters. Paths and numbers are shorter.
const LONGEST_WORD: usize = 200;

/// Longest text of an error, in characters.
const LONGEST_TEXT: usize = 1800;

/// Returns an error's text without the middle of very long words. The middle of a text that is still too long is left
/// out as well. A huge or damaged file then causes no huge message.
pub fn brief(text: &str) -> Cow<'_, str> {
    match without_long_words(text, LONGEST_WORD) {
        Cow::Borrowed(text) => without_middle(text, LONGEST_TEXT),
        Cow::Owned(text) => Cow::Owned(without_middle(&text, LONGEST_TEXT).into_owned()),
    }
}

/// Returns a text with the middle of each word left out that has more than `most` characters.
pub fn without_long_words(text: &str, most: usize) -> Cow<'_, str> {
    let words = || text.split_inclusive(char::is_whitespace);
    // A text has at least as many bytes as characters.
    if words().all(|word| word.len() <= most) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(words().map(|word| without_middle(word, most)).collect())
}

/// Returns the first and the last characters of a text that has more than `most` of them.
fn without_middle(text: &str, most: usize) -> Cow<'_, str> {
    let count = text.chars().count();
    if count <= most {
        return Cow::Borrowed(text);
    }
    let shown = most / 4;
    let (start, end): (String, String) =
        (text.chars().take(shown).collect(), text.chars().skip(count - shown).collect());
    Cow::Owned(format!("{start}…{end}"))
}

/// Quotes a text as one word of a shell.
pub fn shell_word(text: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./=,:+".contains(letter);
    if text.chars().all(is_plain) { text.to_owned() } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_short_enough_stays_as_it_is() {
        let text = format!("`{}` is unknown; valid: a, b", "ä".repeat(90));
        assert!(matches!(brief(&text), Cow::Borrowed(same) if same == text));
        assert_eq!(brief(""), "");
        let line = "some words ".repeat(20);
        assert_eq!(brief(&line), line);
    }

    #[test]
    fn long_words_and_long_texts_lose_their_middle() {
        let text = format!("unknown key `{}`; valid: a, b", "k".repeat(10_000_000));
        let words = brief(&text);
        assert_eq!(words, format!("unknown key `{}…{}`; valid: a, b", "k".repeat(49), "k".repeat(47)));
        let text = format!("{} end", "many words ".repeat(100_000));
        let words = brief(&text);
        assert!(words.chars().count() < LONGEST_TEXT && words.starts_with("many words ") && words.ends_with(" end"));
        assert_eq!(without_long_words("ab abcdefgh\nabcd", 4), "ab a…\nabcd");
    }

    #[test]
    fn only_words_that_a_shell_would_take_apart_are_quoted() {
        assert_eq!(shell_word("files:levels/a+b.json"), "files:levels/a+b.json");
        assert_eq!(shell_word("it's *"), r"'it'\''s *'");
    }
}
