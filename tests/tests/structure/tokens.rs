//! Rust source as words and signs, without comments.

/// A word, a number, a literal or a single sign.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    pub text: String,
    /// Line in its file, from 1.
    pub line: usize,
}

impl Token {
    /// Whether it can be a name or a keyword.
    pub fn is_word(&self) -> bool {
        self.text.starts_with(|first: char| first.is_alphabetic() || first == '_')
    }
}

/// All tokens of a source.
pub fn tokens(source: &str) -> Vec<Token> {
    let bytes: Vec<char> = source.chars().collect();
    let (mut found, mut at, mut line) = (Vec::new(), 0, 1);
    while at < bytes.len() {
        let end = end_of(&bytes, at);
        let text: String = bytes[at..end].iter().collect();
        let is_comment = text.starts_with("//") || text.starts_with("/*");
        if !is_comment && !text.trim().is_empty() {
            found.push(Token { text: text.clone(), line });
        }
        line += text.matches('\n').count();
        at = end;
    }
    found
}

/// Where the token that begins at `at` ends.
fn end_of(source: &[char], at: usize) -> usize {
    let next = |ahead: usize| source.get(at + ahead).copied().unwrap_or('\0');
    match source[at] {
        '/' if next(1) == '/' => run(source, at, |c| c != '\n'),
        '/' if next(1) == '*' => end_of_comment(source, at),
        '"' => end_of_string(source, at + 1),
        'r' | 'b' | 'c' if literal_prefix(source, at).is_some() => literal_prefix(source, at).unwrap_or(at + 1),
        '\'' => end_of_quote(source, at),
        c if c.is_whitespace() => run(source, at, char::is_whitespace),
        c if c.is_alphanumeric() || c == '_' => run(source, at, |c| c.is_alphanumeric() || c == '_'),
        _ => at + 1,
    }
}

fn run(source: &[char], at: usize, belongs: impl Fn(char) -> bool) -> usize {
    at + source[at..].iter().take_while(|&&c| belongs(c)).count()
}

/// Comments nest.
fn end_of_comment(source: &[char], at: usize) -> usize {
    let (mut depth, mut here) = (0, at);
    while here + 1 < source.len() {
        match (source[here], source[here + 1]) {
            ('/', '*') => (depth, here) = (depth + 1, here + 2),
            ('*', '/') => (depth, here) = (depth - 1, here + 2),
            _ => here += 1,
        }
        if depth == 0 {
            return here;
        }
    }
    source.len()
}

/// The end of a string whose first character is at `at`.
fn end_of_string(source: &[char], at: usize) -> usize {
    let mut here = at;
    while here < source.len() {
        match source[here] {
            '\\' => here += 2,
            '"' => return here + 1,
            _ => here += 1,
        }
    }
    source.len()
}

/// The end of `b"…"`, `c"…"`, `b'…'`, `r"…"`, `r#"…"#` and their mixtures, if one begins here.
fn literal_prefix(source: &[char], at: usize) -> Option<usize> {
    let letters = run(source, at, |c| matches!(c, 'r' | 'b' | 'c'));
    let is_raw = source[at..letters].contains(&'r');
    let hashes = if is_raw { run(source, letters, |c| c == '#') - letters } else { 0 };
    let quote = letters + hashes;
    match source.get(quote)? {
        '"' if !is_raw => Some(end_of_string(source, quote + 1)),
        '\'' if !is_raw => Some(end_of_quote(source, quote)),
        '"' => {
            let close: String = std::iter::once('"').chain((0..hashes).map(|_| '#')).collect();
            let rest: String = source[quote + 1..].iter().collect();
            let length =
                rest.find(&close).map_or(rest.chars().count(), |byte| rest[..byte].chars().count() + close.len());
            Some(quote + 1 + length)
        }
        _ => None,
    }
}

/// A character, or the name of a lifetime.
fn end_of_quote(source: &[char], at: usize) -> usize {
    match (source.get(at + 1), source.get(at + 2)) {
        (Some('\\'), Some(_)) => at + 4 + source[at + 3..].iter().take_while(|&&c| c != '\'').count(),
        (Some(_), Some('\'')) => at + 3,
        _ => run(source, at + 1, |c| c.is_alphanumeric() || c == '_'),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(source: &str) -> Vec<String> {
        tokens(source).into_iter().map(|token| token.text).collect()
    }

    #[test]
    fn comments_and_strings_hide_what_looks_like_code() {
        let source = "a /* use /* crate */ b */ \"use crate::c\" // use d\nr#\"e \" f\"# b'\\'' 'g' &'h i";
        assert_eq!(texts(source), ["a", "\"use crate::c\"", "r#\"e \" f\"#", "b'\\''", "'g'", "&", "'h", "i"]);
    }

    #[test]
    fn lines_are_counted_through_everything() {
        let found = tokens("\"a\nb\" /*\n*/ c\n\nd");
        let lines: Vec<_> = found.iter().map(|token| (token.text.as_str(), token.line)).collect();
        assert_eq!(lines, [("\"a\nb\"", 1), ("c", 3), ("d", 5)]);
    }
}
