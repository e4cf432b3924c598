//! Texts of JSON and RON in pieces, and their values.

use std::ops::Range;

/// Splits a text into pieces: a string in its quotes, a number, a word, blanks, or a single other character. Joined
/// they are the text.
pub(super) fn pieces(text: &str) -> Vec<String> {
    let (mut found, mut rest) = (Vec::new(), text);
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '"' => string_length(rest),
            _ if first.is_whitespace() => run(rest, char::is_whitespace),
            _ if is_part(first) => run(rest, is_part),
            _ => first.len_utf8(),
        };
        let (piece, after) = rest.split_at(length);
        found.push(piece.to_owned());
        rest = after;
    }
    found
}

/// Returns the bytes of the string in quotes with which a text begins.
pub(super) fn string_length(text: &str) -> usize {
    let mut is_escaped = false;
    for (at, letter) in text.char_indices().skip(1) {
        match letter {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

fn run(text: &str, belongs: impl Fn(char) -> bool) -> usize {
    text.find(|letter: char| !belongs(letter)).unwrap_or(text.len())
}

/// Returns true if a letter is one of a number or a word.
fn is_part(letter: char) -> bool {
    letter.is_alphanumeric() || "_.+-".contains(letter)
}

/// Returns true if a piece is a number.
pub(super) fn is_number(piece: &str) -> bool {
    let digits = piece.strip_prefix('-').unwrap_or(piece);
    digits.starts_with(|first: char| first.is_ascii_digit()) && piece.parse::<f64>().is_ok()
}

/// Returns true if a value begins with a piece.
pub(super) fn is_value(piece: &str) -> bool {
    piece.starts_with(|first: char| "\"[({".contains(first) || is_part(first))
}

/// Returns the value that begins with a piece, up to its closing bracket if it has one. The value of a key belongs to
/// it.
pub(super) fn entry(pieces: &[String], at: usize) -> Range<usize> {
    let end = end_of_value(pieces, at);
    let colon = behind_blanks(pieces, end);
    let value = behind_blanks(pieces, colon + 1);
    match pieces.get(colon) {
        Some(piece) if piece == ":" && value < pieces.len() => at..end_of_value(pieces, value),
        _ => at..end,
    }
}

fn end_of_value(pieces: &[String], at: usize) -> usize {
    // A variant of RON has its contents in round brackets.
    let is_named = pieces[at].starts_with(char::is_alphabetic) && pieces.get(at + 1).is_some_and(|next| next == "(");
    let start = if is_named { at + 1 } else { at };
    let mut depth = 0_i64;
    for (index, piece) in pieces.iter().enumerate().skip(start) {
        match piece.as_str() {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
        if depth <= 0 {
            return index + 1;
        }
    }
    pieces.len()
}

fn behind_blanks(pieces: &[String], at: usize) -> usize {
    let blanks = pieces.iter().skip(at).take_while(|piece| piece.starts_with(char::is_whitespace)).count();
    at + blanks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(text: &str) -> Vec<String> {
        let pieces = pieces(text);
        assert_eq!(pieces.concat(), text);
        let places = (0..pieces.len()).filter(|&at| is_value(&pieces[at]));
        places.map(|at| pieces[entry(&pieces, at)].concat()).collect()
    }

    #[test]
    fn values_go_to_their_closing_bracket_and_keys_have_theirs() {
        let found = entries(r#"{"a\"": [1, -2.5e3], "b":{}}"#);
        let whole = r#"{"a\"": [1, -2.5e3], "b":{}}"#;
        assert_eq!(found, [whole, r#""a\"": [1, -2.5e3]"#, "[1, -2.5e3]", "1", "-2.5e3", r#""b":{}"#, "{}"]);
        let found = entries("(ppo: (lr: 1e-3, cnn: Impala(feature: 256)), demos: None)");
        assert_eq!(found[1], "ppo: (lr: 1e-3, cnn: Impala(feature: 256))");
        assert!(found.contains(&"Impala(feature: 256)".to_owned()) && found.contains(&"demos: None".to_owned()));
    }

    #[test]
    fn numbers_are_distinguished_from_words() {
        assert!(["0", "-1", "2.5", "1e308", "0.5"].into_iter().all(is_number));
        assert!(!["NaN", "inf", "-", "a1", "\"1\"", "1.2.3", ""].into_iter().any(is_number));
    }
}
