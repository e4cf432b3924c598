//! Line numbers of the values of a JSON text.

/// A step from a value of a JSON text to one inside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JsonStep<'a> {
    /// To the value of a key.
    Key(&'a str),
    /// To an entry of a list, counted from 0.
    Index(usize),
}

/// Returns the line, from 1, on which a value of valid JSON begins. If the value is missing, returns the line of the
/// last value on the path to it.
pub(super) fn line_of(text: &str, path: &[JsonStep]) -> usize {
    let mut scanner = Scanner { bytes: text.trim_start_matches('\u{feff}').as_bytes(), at: 0 };
    scanner.skip_space();
    let mut found = scanner.at;
    for step in path {
        let entered = match *step {
            JsonStep::Key(key) => scanner.enter_key(key),
            JsonStep::Index(index) => scanner.enter_index(index),
        };
        if entered.is_none() {
            break;
        }
        found = scanner.at;
    }
    1 + scanner.bytes[..found].iter().filter(|&&byte| byte == b'\n').count()
}

/// Scanner of a JSON text.
struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Scanner<'a> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn take(&mut self, wanted: u8) -> Option<()> {
        (self.peek()? == wanted).then(|| self.at += 1)
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    /// Returns the text between quotation marks, escapes included.
    fn string(&mut self) -> Option<&'a [u8]> {
        self.take(b'"')?;
        let start = self.at;
        loop {
            match self.peek()? {
                b'"' => {
                    let string = &self.bytes[start..self.at];
                    self.at += 1;
                    return Some(string);
                }
                b'\\' => self.at += 2,
                _ => self.at += 1,
            }
        }
    }

    fn skip_value(&mut self) -> Option<()> {
        let mut depth = 0usize;
        loop {
            match self.peek()? {
                b'"' => {
                    self.string()?;
                }
                b'{' | b'[' => {
                    depth += 1;
                    self.at += 1;
                }
                b'}' | b']' => {
                    depth = depth.checked_sub(1)?;
                    self.at += 1;
                }
                _ => {
                    self.at += 1;
                    // Numbers and words end before these characters.
                    let goes_on = self.peek().is_some_and(|byte| !b",]}".contains(&byte));
                    if depth == 0 && goes_on {
                        continue;
                    }
                }
            }
            if depth == 0 {
                return Some(());
            }
        }
    }

    fn enter_key(&mut self, key: &str) -> Option<()> {
        self.take(b'{')?;
        loop {
            self.skip_space();
            let found = self.string()? == key.as_bytes();
            self.skip_space();
            self.take(b':')?;
            self.skip_space();
            if found {
                return Some(());
            }
            self.skip_value()?;
            self.skip_space();
            self.take(b',')?;
        }
    }

    fn enter_index(&mut self, index: usize) -> Option<()> {
        self.take(b'[')?;
        self.skip_space();
        for _ in 0..index {
            self.skip_value()?;
            self.skip_space();
            self.take(b',')?;
            self.skip_space();
        }
        // No entry follows the last one.
        (self.peek()? != b']').then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use JsonStep::{Index, Key};

    const TEXT: &str = r#"
{
  "a": [1, 2.5e3,
    "], \" }"],
  "b": { "c": true, "d":
    [ {}, [],
      -7
    ] },

  "rows": []
}"#;

    #[test]
    fn values_are_found_on_their_lines() {
        for (path, line) in [
            (&[][..], 2),
            (&[Key("a")], 3),
            (&[Key("a"), Index(1)], 3),
            (&[Key("a"), Index(2)], 4),
            (&[Key("b"), Key("c")], 5),
            (&[Key("b"), Key("d")], 6),
            (&[Key("b"), Key("d"), Index(1)], 6),
            (&[Key("b"), Key("d"), Index(2)], 7),
            (&[Key("rows")], 10),
            (&[Key("rows"), Index(0)], 10),
            (&[Key("missing")], 2),
            (&[Key("a"), Index(9)], 3),
        ] {
            assert_eq!(line_of(TEXT, path), line, "{path:?}");
        }
    }

    #[test]
    fn texts_that_are_no_json_lead_nowhere() {
        for text in ["", "{", "[", "{\"a\"", "{\"a\": \"", "[1, ", "nonsense"] {
            assert_eq!(line_of(text, &[Key("a"), Index(3)]), 1, "{text}");
        }
    }
}
