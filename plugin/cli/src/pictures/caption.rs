//! Caption of a picture: tick, action, value, and the skill as bars.

use crate::pictures::{Colour, Screen, episode_world::EpisodeStep};
use playbot_report::readable;

/// Space around everything, pixels.
const MARGIN: usize = 4;

/// Height of the bars from their middle up and down, pixels.
const BAR: usize = 12;

/// The number that fills a bar. Skills are about normally distributed.
const FULL: f32 = 3.0;

/// Enlargement of letters where there is room for it.
const ENLARGED: usize = 2;

/// Below this width letters keep their size.
const ROOMY: usize = 300;

/// Least width of a picture with a caption.
pub(crate) const NARROWEST: usize = 160;

/// Positions of the parts in captions of a width.
pub struct Caption {
    letter: usize,
    skills: usize,
}

impl Caption {
    /// Lays out captions of pictures `width` pixels wide and skills of `skills` numbers.
    pub fn new(width: usize, skills: usize) -> Self {
        Self { letter: if width < ROOMY { 1 } else { ENLARGED }, skills }
    }

    fn line(&self) -> usize {
        HEIGHT * self.letter + MARGIN
    }

    /// Returns the pixels from top to bottom.
    pub fn height(&self) -> usize {
        let bars = if self.skills > 0 { self.line() + 2 * BAR + 1 + MARGIN } else { 0 };
        MARGIN + 2 * self.line() + bars
    }

    /// Draws it from row `top` on.
    pub fn draw(&self, screen: &mut Screen, top: usize, step: &EpisodeStep) {
        let (letter, first) = (self.letter, top + MARGIN);
        let tick = format!("tick {}", step.tick);
        write(screen, &tick, letter, (MARGIN, first), FAINT);
        // The action always begins at the same place.
        let column = MARGIN + width("tick 9999  ") * letter;
        write(screen, &step.action, letter, (column, first), WORDS);
        let second = first + self.line();
        if let Some(value) = step.value {
            write(screen, &format!("value {value:.2}"), letter, (MARGIN, second), WORDS);
        }
        if step.reward != 0.0 {
            let reward = readable(f64::from(step.reward));
            write(screen, &format!("reward {reward}"), letter, (column, second), UP);
        }
        self.bars(screen, second + self.line(), &step.skill, step.skill_name.as_deref());
    }

    fn bars(&self, screen: &mut Screen, top: usize, skill: &[f32], name: Option<&str>) {
        if skill.is_empty() {
            return;
        }
        let words = name.map_or_else(|| format!("skill, bars full at ±{FULL}"), |name| format!("skill: {name}"));
        write(screen, &words, self.letter, (MARGIN, top), FAINT);
        let (middle, room) = (top + self.line() + BAR, screen.width - 2 * MARGIN);
        screen.block(MARGIN, middle, room, 1, FAINT);
        let step = room / skill.len();
        for (number, z) in skill.iter().enumerate() {
            let length = ((z.abs() / FULL).min(1.0) * BAR as f32).round() as usize;
            let (y, colour) = if *z > 0.0 { (middle - length, UP) } else { (middle + 1, DOWN) };
            screen.block(MARGIN + number * step, y, (step * 3 / 4).max(1), length, colour);
        }
    }
}

// Drawing of vector observations: a line for each number, with its name, a bar, and the bar's scale.

/// Length of the bars from their middle to either side, pixels of the font.
const NUMBERS_BAR: usize = 48;

/// Enlargement of pictures per enlargement of letters.
const SCALE_PER_LETTER: u32 = 4;

/// The largest magnitude of each number of an observation, over all ticks that were seen.
#[derive(Default)]
pub struct Reach(Vec<f32>);

impl Reach {
    /// Includes the observation of another tick.
    pub fn include(&mut self, vector: &[f32]) {
        self.0.resize(self.0.len().max(vector.len()), 0.0);
        for (largest, value) in self.0.iter_mut().zip(vector) {
            *largest = largest.max(value.abs());
        }
    }
}

/// The drawing of the numbers of an observation.
pub struct NumberBars {
    names: Vec<String>,
    /// The scale of each number's bar.
    reach: Vec<f32>,
    letter: usize,
}

impl NumberBars {
    /// Numbers of these names, drawn at a scale of pictures. Each has one scale for all observations that are drawn:
    /// its bar is full at the largest magnitude of any tick, rounded up.
    pub fn new(names: Vec<String>, scale: u32, reach: &Reach) -> Self {
        let reach = (0..names.len()).map(|number| round_up(reach.0.get(number).copied().unwrap_or(0.0))).collect();
        Self { names, reach, letter: (scale / SCALE_PER_LETTER).max(1) as usize }
    }

    fn line(&self) -> usize {
        HEIGHT * self.letter + MARGIN
    }

    /// Returns the columns of the values, the bars and their scales.
    fn columns(&self) -> [usize; 3] {
        let name = self.names.iter().map(|name| width(name)).max().unwrap_or(0);
        let value = name + width("  ");
        let bar = value + width("-00000.000  ");
        [value, bar, bar + 2 * NUMBERS_BAR + 1 + width("  ")].map(|column| MARGIN + column * self.letter)
    }

    /// Returns the width and height, pixels.
    pub fn size(&self) -> [usize; 2] {
        let [.., scales] = self.columns();
        let scale = self.reach.iter().map(|reach| width(&describe_scale(*reach))).max().unwrap_or(0);
        [scales + scale * self.letter + MARGIN, MARGIN + self.names.len() * self.line()]
    }

    /// Draws an observation at the upper left.
    pub fn draw(&self, screen: &mut Screen, values: &[f32]) {
        let ([column, bars, scales], letter) = (self.columns(), self.letter);
        let middle = bars + NUMBERS_BAR * letter;
        for (row, ((name, value), reach)) in self.names.iter().zip(values).zip(&self.reach).enumerate() {
            let y = MARGIN + row * self.line();
            write(screen, name, letter, (MARGIN, y), FAINT);
            write(screen, &describe(*value), letter, (column, y), WORDS);
            screen.block(middle, y, letter, HEIGHT * letter, FAINT);
            write(screen, &describe_scale(*reach), letter, (scales, y), FAINT);
            let length = ((value.abs() / reach).min(1.0) * (NUMBERS_BAR * letter) as f32).round() as usize;
            let (left, colour) = if *value > 0.0 { (middle + letter, UP) } else { (middle - length, DOWN) };
            screen.block(left, y, length, HEIGHT * letter, colour);
        }
    }
}

/// Formats a value for its column.
fn describe(value: f32) -> String {
    if value.abs() < 99_999.5 { format!("{value:.3}") } else { format!("{value:.1e}") }
}

/// Formats the scale of a bar.
fn describe_scale(reach: f32) -> String {
    if (1e-3..1e5).contains(&reach) { format!("±{reach}") } else { format!("±{reach:e}") }
}

/// Returns the next of 1, 2, 5, 10, 20, 50 and so on, larger and smaller ones too, at or above a magnitude. Such scales
/// stay as they are from one picture to the next where magnitudes differ a little. 1 for 0.
fn round_up(largest: f32) -> f32 {
    if largest == 0.0 {
        return 1.0;
    }
    // In decimal, where these numbers are exact.
    let text = format!("{largest:e}");
    let Some((mantissa, exponent)) = text.split_once('e') else { return largest };
    let mantissa: f32 = mantissa.parse().unwrap_or(1.0);
    let step = [1, 2, 5].into_iter().find(|step| mantissa <= *step as f32).unwrap_or(10);
    format!("{step}e{exponent}").parse().unwrap_or(largest)
}

// A built-in font, five pixels high.

/// Height of a letter, pixels.
pub(crate) const HEIGHT: usize = 5;

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
pub(crate) fn width(text: &str) -> usize {
    text.chars().map(|letter| rows(letter)[0].len() + 1).sum()
}

/// Writes a text, each pixel of the font `scale` wide and high, with the upper left corner at (x, y).
pub(crate) fn write(screen: &mut Screen, text: &str, scale: usize, (x, y): (usize, usize), colour: Colour) {
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

// Colours of words, bars and their backgrounds.

pub(crate) const BACKGROUND: Colour = [24, 24, 28];

pub(crate) const WORDS: Colour = [235, 235, 235];

/// Words that matter less, and lines.
pub(crate) const FAINT: Colour = [170, 170, 180];

/// Above zero.
pub(crate) const UP: Colour = [90, 190, 255];

/// Below zero.
pub(crate) const DOWN: Colour = [255, 150, 80];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_keep_one_scale_and_point_the_other_way_below_zero() {
        let vectors = [[2.0, 0.0], [-1.0, 0.0]];
        let mut reach = Reach::default();
        vectors.iter().for_each(|vector| reach.include(vector));
        let numbers = NumberBars::new(vec!["x".to_owned(), "y".to_owned()], 4, &reach);
        let [width, height] = numbers.size();
        for (vector, colour, pixels) in [(vectors[0], UP, NUMBERS_BAR), (vectors[1], DOWN, NUMBERS_BAR / 2)] {
            let mut screen = Screen::new(width, height, [0; 3]).expect("small");
            numbers.draw(&mut screen, &vector);
            let lit = screen.bytes().chunks_exact(3).filter(|pixel| *pixel == colour).count();
            assert_eq!(lit, pixels * HEIGHT, "the other number is 0 and has no bar");
        }
    }

    #[test]
    fn scales_are_round_and_never_too_small() {
        for (largest, reach, words) in [
            (0.0, 1.0, "±1"),
            (1.0, 1.0, "±1"),
            (0.03, 0.05, "±0.05"),
            (0.000_4, 0.000_5, "±5e-4"),
            (350.25, 500.0, "±500"),
            (7e7, 1e8, "±1e8"),
        ] {
            assert_eq!((round_up(largest), describe_scale(reach).as_str()), (reach, words), "{largest}");
        }
    }

    #[test]
    fn values_fit_their_column() {
        for value in [0.0, -1.5, 99_999.0, -99_999.0, 1e9, -3.4e38] {
            assert!(width(&describe(value)) <= width("-00000.000  "), "{value}");
        }
    }

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

    /// Returns the relative luminance, as WCAG 2 defines it.
    fn luminance(colour: Colour) -> f64 {
        let linear = colour.map(|value| {
            let share = f64::from(value) / 255.0;
            if share <= 0.04045 { share / 12.92 } else { libm::pow((share + 0.055) / 1.055, 2.4) }
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
