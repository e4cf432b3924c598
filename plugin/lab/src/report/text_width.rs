//! Estimated width of text in a drawing: the reader's font is unknown.

/// Returns the width of `text` in pixels at a font size in pixels; rather too wide than too narrow.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    text.chars().map(|c| char_width(c) * size).sum()
}

fn char_width(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' => 0.32,
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.92,
        'A'..='Z' => 0.70,
        // Beyond Latin, Greek and Cyrillic, characters may be as wide as they are high.
        '\u{1100}'.. if !('\u{2000}'..'\u{2300}').contains(&c) => 1.05,
        _ => 0.60,
    }
}

/// Breaks text into lines of at most `width` pixels at its spaces; a longer word gets its own line.
pub(super) fn wrap(text: &str, width: f64, size: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(line, size) + text_width(word, size) + 0.6 * size <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Positions labels of height `height` near `wanted`, moved apart within `top..=bottom`. The order of the labels
/// along the axis is kept.
pub(super) fn spread(wanted: &[f64], height: f64, top: f64, bottom: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|&a, &b| wanted[a].total_cmp(&wanted[b]));
    let mut placed = vec![0.0; wanted.len()];
    let mut least = top;
    for &i in &order {
        placed[i] = wanted[i].max(least);
        least = placed[i] + height;
    }
    let mut most = bottom;
    for &i in order.iter().rev() {
        placed[i] = placed[i].min(most);
        most = placed[i] - height;
    }
    placed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_at_spaces() {
        assert_eq!(wrap("aa bb cc", 5.5 * 0.6 * 10.0, 10.0), ["aa bb", "cc"]);
        assert_eq!(wrap("", 100.0, 10.0), [] as [&str; 0]);
        assert_eq!(wrap("unbreakable", 1.0, 10.0), ["unbreakable"]);
    }

    #[test]
    fn labels_do_not_overlap() {
        assert_eq!(spread(&[50.0, 51.0, 10.0], 16.0, 0.0, 100.0), [50.0, 66.0, 10.0]);
        assert_eq!(spread(&[99.0, 100.0], 16.0, 0.0, 100.0), [84.0, 100.0]);
    }
}
