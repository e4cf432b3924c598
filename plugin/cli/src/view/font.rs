//! A built-in font, five pixels high.

use super::screen::{Colour, Screen};

/// Height of a letter, pixels.
pub const HEIGHT: usize = 5;

/// Letters with their rows from top to bottom. Small letters are drawn as capitals.
const GLYPHS: &[(char, [&str; HEIGHT])] = &[
    ('A', [".#.", "#.#", "###", "#.#", "#.#"]),
    ('B', ["##.", "#.#", "##.", "#.#", "##."]),
    ('C', [".##", "#..", "#..", "#..", ".##"]),
    ('D', ["##.", "#.#", "#.#", "#.#", "##."]),
    ('E', ["###", "#..", "##.", "#..", "###"]),
    ('F', ["###", "#..", "##.", "#..", "#.."]),
    ('G', [".###", "#...", "#.##", "#..#", ".###"]),
    ('H', ["#.#", "#.#", "###", "#.#", "#.#"]),
    ('I', ["#", "#", "#", "#", "#"]),
    ('J', ["..#", "..#", "..#", "#.#", ".#."]),
    ('K', ["#.#", "#.#", "##.", "#.#", "#.#"]),
    ('L', ["#..", "#..", "#..", "#..", "###"]),
    ('M', ["#...#", "##.##", "#.#.#", "#...#", "#...#"]),
    ('N', ["#..#", "##.#", "#.##", "#..#", "#..#"]),
    ('O', [".##.", "#..#", "#..#", "#..#", ".##."]),
    ('P', ["##.", "#.#", "##.", "#..", "#.."]),
    ('Q', [".##.", "#..#", "#..#", "#.#.", ".#.#"]),
    ('R', ["##.", "#.#", "##.", "#.#", "#.#"]),
    ('S', [".##", "#..", ".#.", "..#", "##."]),
    ('T', ["###", ".#.", ".#.", ".#.", ".#."]),
    ('U', ["#.#", "#.#", "#.#", "#.#", "###"]),
    ('V', ["#.#", "#.#", "#.#", "#.#", ".#."]),
    ('W', ["#...#", "#...#", "#.#.#", "##.##", "#...#"]),
    ('X', ["#.#", "#.#", ".#.", "#.#", "#.#"]),
    ('Y', ["#.#", "#.#", ".#.", ".#.", ".#."]),
    ('Z', ["###", "..#", ".#.", "#..", "###"]),
    ('0', ["###", "#.#", "#.#", "#.#", "###"]),
    ('1', [".#", "##", ".#", ".#", ".#"]),
    ('2', ["##.", "..#", ".#.", "#..", "###"]),
    ('3', ["##.", "..#", ".#.", "..#", "##."]),
    ('4', ["#.#", "#.#", "###", "..#", "..#"]),
    ('5', ["###", "#..", "##.", "..#", "##."]),
    ('6', [".##", "#..", "###", "#.#", "###"]),
    ('7', ["###", "..#", "..#", ".#.", ".#."]),
    ('8', ["###", "#.#", "###", "#.#", "###"]),
    ('9', ["###", "#.#", "###", "..#", "##."]),
    ('+', ["...", ".#.", "###", ".#.", "..."]),
    ('±', [".#.", "###", ".#.", "...", "###"]),
    ('-', ["...", "...", "###", "...", "..."]),
    ('_', ["...", "...", "...", "...", "###"]),
    ('.', [".", ".", ".", ".", "#"]),
    (',', ["..", "..", "..", ".#", "#."]),
    (':', [".", "#", ".", "#", "."]),
    (';', ["..", ".#", "..", ".#", "#."]),
    ('%', ["#.#", "..#", ".#.", "#..", "#.#"]),
    ('=', ["...", "###", "...", "###", "..."]),
    ('/', ["..#", "..#", ".#.", "#..", "#.."]),
    ('(', [".#", "#.", "#.", "#.", ".#"]),
    (')', ["#.", ".#", ".#", ".#", "#."]),
    (' ', ["..", "..", "..", "..", ".."]),
];

/// Stands for a letter that is not in the font.
const UNKNOWN: [&str; HEIGHT] = ["###", "#.#", "#.#", "#.#", "###"];

fn rows(letter: char) -> [&'static str; HEIGHT] {
    let capital = letter.to_ascii_uppercase();
    GLYPHS.iter().find(|(known, _)| *known == capital).map_or(UNKNOWN, |(_, rows)| *rows)
}

/// Returns the width of a text, pixels.
pub fn width(text: &str) -> usize {
    text.chars().map(|letter| rows(letter)[0].len() + 1).sum()
}

/// Writes a text, each pixel of the font `scale` wide and high, with the upper left corner at (x, y).
pub fn write(screen: &mut Screen, text: &str, scale: usize, (x, y): (usize, usize), colour: Colour) {
    let mut left = x;
    for letter in text.chars() {
        let rows = rows(letter);
        for (down, row) in rows.iter().enumerate() {
            for (across, pixel) in row.bytes().enumerate() {
                if pixel == b'#' {
                    screen.block(left + across * scale, y + down * scale, scale, scale, colour);
                }
            }
        }
        left += (rows[0].len() + 1) * scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_as_wide_in_every_row_and_differ() {
        for (at, (letter, rows)) in GLYPHS.iter().enumerate() {
            assert!(rows.iter().all(|row| row.len() == rows[0].len()), "{letter}");
            assert!(GLYPHS[..at].iter().all(|(_, other)| other != rows), "{letter} looks like another");
            assert!(*letter == ' ' || rows.concat().contains('#'), "{letter}");
        }
    }

    #[test]
    fn texts_take_the_width_that_was_announced() {
        let text = "Tick 12: right+jump?";
        let mut screen = Screen::new(2 * width(text), 2 * HEIGHT, [0; 3]).expect("small");
        write(&mut screen, text, 2, (0, 0), [255; 3]);
        let lit = |x: usize| (0..screen.height).any(|y| screen.bytes()[3 * (y * screen.width + x)] > 0);
        assert!(lit(screen.width - 3) && !lit(screen.width - 1), "a free column after the last letter");
    }
}
