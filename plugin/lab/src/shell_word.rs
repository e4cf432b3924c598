//! Quoting of words in shell commands.

/// Quotes a text as one word of a shell.
pub fn shell_word(text: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./=,:+".contains(letter);
    if text.chars().all(is_plain) { text.to_owned() } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_words_that_a_shell_would_take_apart_are_quoted() {
        assert_eq!(shell_word("files:levels/a+b.json"), "files:levels/a+b.json");
        assert_eq!(shell_word("it's *"), r"'it'\''s *'");
    }
}
