//! Colours of words, bars and their backgrounds.

use super::screen::Colour;

pub const BACKGROUND: Colour = [24, 24, 28];
pub const WORDS: Colour = [235, 235, 235];
/// Words that matter less, and lines.
pub const FAINT: Colour = [170, 170, 180];
/// Above zero.
pub const UP: Colour = [90, 190, 255];
/// Below zero.
pub const DOWN: Colour = [255, 150, 80];

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the relative luminance, as WCAG 2 defines it.
    fn luminance(colour: Colour) -> f64 {
        let linear = colour.map(|value| {
            let share = f64::from(value) / 255.0;
            if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    #[test]
    fn small_words_can_be_read() {
        for colour in [WORDS, FAINT, UP, DOWN] {
            let contrast = (luminance(colour) + 0.05) / (luminance(BACKGROUND) + 0.05);
            assert!(contrast >= 4.5, "{colour:?}: {contrast}");
        }
    }
}
