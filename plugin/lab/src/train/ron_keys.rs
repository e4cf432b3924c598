//! Taking a RON struct apart into its keys and their values as text, so that files can be laid over one another key by
//! key without knowing the types of the values.

/// A field of a struct: `key: value` as it stands in the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Field<'a> {
    pub key: &'a str,
    /// Byte at which the key begins.
    pub key_at: usize,
    pub value: &'a str,
    /// Byte at which the value begins.
    pub value_at: usize,
}

/// The fields of the struct `(key: value, ...)`, with or without a name before it, that begins at byte `at` of a text;
/// `None` if there is something else. The text must be RON: a reader of RON has found nothing wrong with it.
pub(super) fn fields(text: &str, at: usize) -> Option<Vec<Field<'_>>> {
    let mut at = skip_extensions(text, skip_blank(text, at));
    at = skip_blank(text, at + word(&text[at..]).len());
    at = skip_blank(text, eat(text, at, '(')?);
    let mut fields = Vec::new();
    while !text[at..].starts_with(')') {
        let key = word(&text[at..]);
        let key_at = at;
        at = skip_blank(text, at + key.len());
        at = skip_blank(text, eat(text, at, ':')?);
        let end = value_end(text, at);
        let value = text[at..end].trim_end();
        fields.push(Field { key, key_at, value, value_at: at });
        at = end;
        if let Some(after) = eat(text, at, ',') {
            at = skip_blank(text, after);
        } else if !text[at..].starts_with(')') {
            return None;
        }
    }
    Some(fields)
}

/// Line and column, both from 1, of a byte.
pub(super) fn position(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..at];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (line_feeds(before) + 1, before[line_start..].chars().count() + 1)
}

/// Number of line feeds, counted as fast as a file of a million of them asks for.
pub(super) fn line_feeds(text: &str) -> usize {
    text.bytes().filter(|byte| *byte == b'\n').count()
}

fn eat(text: &str, at: usize, token: char) -> Option<usize> {
    text[at..].starts_with(token).then_some(at + token.len_utf8())
}

/// The first byte from `at` behind lines such as `#![enable(implicit_some)]`, which is always on here.
fn skip_extensions(text: &str, mut at: usize) -> usize {
    while text[at..].starts_with("#![") {
        let end = text[at..].find(']').map_or(text.len(), |end| at + end + 1);
        at = skip_blank(text, end);
    }
    at
}

/// The identifier with which a text begins; empty if there is none.
pub(super) fn word(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    &text[..end]
}

/// The first byte from `at` that is neither space nor comment.
fn skip_blank(text: &str, mut at: usize) -> usize {
    loop {
        let rest = &text[at..];
        let skipped = match rest {
            _ if rest.starts_with(char::is_whitespace) => rest.len() - rest.trim_start().len(),
            _ if rest.starts_with("//") || rest.starts_with("/*") => comment(rest),
            _ => return at,
        };
        at += skipped;
    }
}

/// Length of the comment at the beginning; comments in `/* */` nest.
fn comment(text: &str) -> usize {
    if text.starts_with("//") {
        return text.find('\n').unwrap_or(text.len());
    }
    let (mut depth, mut at) = (0, 0);
    loop {
        let rest = &text[at..];
        let Some(token) = rest.find("/*").into_iter().chain(rest.find("*/")).min() else { return text.len() };
        depth = if rest[token..].starts_with("/*") { depth + 1 } else { depth - 1 };
        at += token + 2;
        if depth == 0 {
            return at;
        }
    }
}

/// The byte after the value that begins at `at`: a comma or a closing bracket that is not part of it.
fn value_end(text: &str, mut at: usize) -> usize {
    let mut depth = 0;
    while let Some(next) = text[at..].chars().next() {
        let rest = &text[at..];
        at += match next {
            ',' | ')' | ']' | '}' if depth == 0 => return at,
            '(' | '[' | '{' => {
                depth += 1;
                1
            }
            ')' | ']' | '}' => {
                depth -= 1;
                1
            }
            '"' => quoted(rest, '"'),
            '\'' => quoted(rest, '\''),
            '/' if rest.starts_with("//") || rest.starts_with("/*") => comment(rest),
            'r' | 'b' if raw_string(rest).is_some() => raw_string(rest).unwrap_or(1),
            _ if !word(rest).is_empty() => word(rest).len(),
            _ => next.len_utf8(),
        };
    }
    at
}

/// Length of a text in quotes with `\` as its escape.
fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        if c == quote && !escaped {
            return at + 1;
        }
        escaped = c == '\\' && !escaped;
    }
    text.len()
}

/// Length of a raw string such as `r#"..."#`.
fn raw_string(text: &str) -> Option<usize> {
    let body = text.strip_prefix("br").or_else(|| text.strip_prefix('r'))?;
    let hashes = body.len() - body.trim_start_matches('#').len();
    let inner = body[hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    let length = inner.find(&end).map_or(inner.len(), |at| at + end.len());
    Some(text.len() - inner.len() + length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(text: &str) -> Vec<(&str, &str)> {
        fields(text, 0).expect("a struct").into_iter().map(|field| (field.key, field.value)).collect()
    }

    #[test]
    fn values_of_every_kind_come_out_as_written() {
        let text = r##"// a comment, with ( and "
        Experiment( /* and /* another ) */ one */ a: 1, b : -0.5e-3 , c: "x, ) \" y", d: r#"raw " )"#,
            e: [1, (2, 3)], f: Some(Relu), g: ')', h: { "k": (z: 1) }, i: (x: 1, y: (w: 2)), // last )
            j: Named(x: "//"), k: '"',
        )"##;
        let expected = [
            ("a", "1"),
            ("b", "-0.5e-3"),
            ("c", r#""x, ) \" y""#),
            ("d", r##"r#"raw " )"#"##),
            ("e", "[1, (2, 3)]"),
            ("f", "Some(Relu)"),
            ("g", "')'"),
            ("h", r#"{ "k": (z: 1) }"#),
            ("i", "(x: 1, y: (w: 2))"),
            ("j", r#"Named(x: "//")"#),
            ("k", "'\"'"),
        ];
        assert_eq!(pairs(text), expected);
        assert_eq!(pairs("()"), []);
        assert_eq!(pairs("#![enable(implicit_some)]\n#![enable(unwrap_newtypes)] // on\n(a: 1)"), [("a", "1")]);
    }

    #[test]
    fn what_is_no_struct_with_keys_is_told_apart() {
        for text in ["3", "[1]", "(1, 2)", "\"a: 1\"", "Relu", "Some(3)", ""] {
            assert_eq!(fields(text, 0), None, "{text}");
        }
    }

    #[test]
    fn positions_count_from_one_in_characters() {
        let text = "(\n  ä: 1,\n  b: 2)";
        let fields = fields(text, 0).expect("a struct");
        assert_eq!(position(text, fields[0].value_at), (2, 6));
        assert_eq!(position(text, fields[1].key_at), (3, 3));
    }
}
