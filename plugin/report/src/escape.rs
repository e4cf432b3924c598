//! Text that is safe in HTML, in SVG, in addresses and on a terminal, and pictures as text.

use std::fmt::Write;

/// Returns whether a character is invisible and changes how others are shown: a control character, or one that changes
/// the direction of writing.
pub(crate) fn steers(c: char) -> bool {
    c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Escapes text for the content and the attributes of HTML and SVG.
///
/// Control characters, which are invalid in both, and those that change the direction of writing become U+FFFD. Tabs
/// and line feeds stay.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(c),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c if steers(c) => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// Returns a path as a URI reference (RFC 3986): all but letters, digits, `-._~` and `/` is escaped.
///
/// ```
/// assert_eq!(playbot_report::escape::uri_path("my levels/ü.json"), "my%20levels/%C3%BC.json");
/// ```
pub fn uri_path(path: &str) -> String {
    let mut out = String::with_capacity(path.len());
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte) {
            out.push(char::from(byte));
        } else {
            // Writing into a string cannot fail.
            let _ = write!(out, "%{byte:02X}");
        }
    }
    out
}

/// Returns text on one line without control characters and those that change the direction of writing, so that it
/// cannot control a terminal.
pub(crate) fn one_line(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_whitespace() { ' ' } else { c })
        .map(|c| if steers(c) { '\u{fffd}' } else { c })
        .collect()
}

/// Returns escaped text with `code` between backticks set as code. A backtick without a partner stays.
pub(crate) fn with_code_spans(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, (code, after))) =
        rest.split_once('`').and_then(|(before, tail)| Some((before, tail.split_once('`')?)))
    {
        out.push_str(&escape(before));
        out.push_str(&format!("<code>{}</code>", escape(code)));
        rest = after;
    }
    out.push_str(&escape(rest));
    out
}

/// The letters of Base64.
const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Encodes bytes in Base64 with padding (RFC 4648).
///
/// ```
/// assert_eq!(playbot_report::base64(b"foob"), "Zm9vYg==");
/// ```
pub fn base64(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let bits = three.iter().fold(0_usize, |bits, byte| (bits << 8) | usize::from(*byte)) << (8 * (3 - three.len()));
        for place in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * place)) & 63];
            text.push(if place <= three.len() { char::from(letter) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_becomes_text() {
        assert_eq!(
            escape("<script a=\"1\" b='2'>&\u{0}\u{1b}[31m\n"),
            "&lt;script a=&quot;1&quot; b=&#39;2&#39;&gt;&amp;\u{fffd}\u{fffd}[31m\n"
        );
    }

    #[test]
    fn terminals_are_not_steered() {
        assert_eq!(one_line("a\nb\u{1b}[2J"), "a b\u{fffd}[2J");
    }

    #[test]
    fn the_direction_of_writing_is_not_turned_around() {
        assert_eq!(one_line("a\u{202e}b\u{2066}"), "a\u{fffd}b\u{fffd}");
        assert_eq!(escape("a\u{202e}b\u{2069}\u{9b}\u{7f}"), "a\u{fffd}b\u{fffd}\u{fffd}\u{fffd}");
        assert_eq!(escape("ä – ש"), "ä – ש", "letters that are written from the right are letters");
    }

    #[test]
    fn code_spans() {
        assert_eq!(with_code_spans("run `a<b` now"), "run <code>a&lt;b</code> now");
        assert_eq!(with_code_spans("a ` b & c"), "a ` b &amp; c");
    }

    #[test]
    fn base64_is_that_of_the_standard() {
        // The examples of RFC 4648.
        let coded = ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"];
        for (length, expected) in coded.iter().enumerate() {
            assert_eq!(base64(&b"foobar"[..length]), *expected);
        }
        assert_eq!(base64(&[0xfb, 0xff]), "+/8=");
    }
}
