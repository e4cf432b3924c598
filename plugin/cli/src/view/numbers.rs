//! Drawing of vector observations: a line for each number, with its name, a bar, and the bar's scale.

use super::{
    colours::{DOWN, FAINT, UP, WORDS},
    font,
    screen::Screen,
};

/// Space around everything, pixels.
const MARGIN: usize = 4;
/// Length of the bars from their middle to either side, pixels of the font.
const BAR: usize = 48;
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
pub struct Numbers {
    names: Vec<String>,
    /// The scale of each number's bar.
    reach: Vec<f32>,
    letter: usize,
}

impl Numbers {
    /// Numbers of these names, drawn at a scale of pictures. Each has one scale for all observations that are drawn:
    /// its bar is full at the largest magnitude of any tick, rounded up.
    pub fn new(names: Vec<String>, scale: u32, reach: &Reach) -> Self {
        let reach = (0..names.len()).map(|number| round_up(reach.0.get(number).copied().unwrap_or(0.0))).collect();
        Self { names, reach, letter: (scale / SCALE_PER_LETTER).max(1) as usize }
    }

    fn line(&self) -> usize {
        font::HEIGHT * self.letter + MARGIN
    }

    /// Returns the columns of the values, the bars and their scales.
    fn columns(&self) -> [usize; 3] {
        let name = self.names.iter().map(|name| font::width(name)).max().unwrap_or(0);
        let value = name + font::width("  ");
        let bar = value + font::width("-00000.000  ");
        [value, bar, bar + 2 * BAR + 1 + font::width("  ")].map(|column| MARGIN + column * self.letter)
    }

    /// Returns the width and height, pixels.
    pub fn size(&self) -> [usize; 2] {
        let [.., scales] = self.columns();
        let scale = self.reach.iter().map(|reach| font::width(&describe_scale(*reach))).max().unwrap_or(0);
        [scales + scale * self.letter + MARGIN, MARGIN + self.names.len() * self.line()]
    }

    /// Draws an observation at the upper left.
    pub fn draw(&self, screen: &mut Screen, values: &[f32]) {
        let ([column, bars, scales], letter) = (self.columns(), self.letter);
        let middle = bars + BAR * letter;
        for (row, ((name, value), reach)) in self.names.iter().zip(values).zip(&self.reach).enumerate() {
            let y = MARGIN + row * self.line();
            font::write(screen, name, letter, (MARGIN, y), FAINT);
            font::write(screen, &describe(*value), letter, (column, y), WORDS);
            screen.block(middle, y, letter, font::HEIGHT * letter, FAINT);
            font::write(screen, &describe_scale(*reach), letter, (scales, y), FAINT);
            let length = ((value.abs() / reach).min(1.0) * (BAR * letter) as f32).round() as usize;
            let (left, colour) = if *value > 0.0 { (middle + letter, UP) } else { (middle - length, DOWN) };
            screen.block(left, y, length, font::HEIGHT * letter, colour);
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

/// Returns the next of 1, 2, 5, 10, 20, 50 and so on, larger and smaller ones too, at or above a magnitude: such scales
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_keep_one_scale_and_point_the_other_way_below_zero() {
        let vectors = [[2.0, 0.0], [-1.0, 0.0]];
        let mut reach = Reach::default();
        vectors.iter().for_each(|vector| reach.include(vector));
        let numbers = Numbers::new(vec!["x".to_owned(), "y".to_owned()], 4, &reach);
        let [width, height] = numbers.size();
        for (vector, colour, pixels) in [(vectors[0], UP, BAR), (vectors[1], DOWN, BAR / 2)] {
            let mut screen = Screen::new(width, height, [0; 3]).expect("small");
            numbers.draw(&mut screen, &vector);
            let lit = screen.bytes().chunks_exact(3).filter(|pixel| *pixel == colour).count();
            assert_eq!(lit, pixels * font::HEIGHT, "the other number is 0 and has no bar");
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
            assert!(font::width(&describe(value)) <= font::width("-00000.000  "), "{value}");
        }
    }
}
