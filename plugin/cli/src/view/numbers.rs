//! Observations that are vectors: a line for each number, with its name and a bar.

use super::{
    font,
    screen::{Colour, Screen},
    stage::Shot,
};

/// Space around everything, pixels.
const MARGIN: usize = 4;
/// Length of the bars from their middle to either side, pixels of the font.
const BAR: usize = 48;
/// Pictures are enlarged so many times for each time that letters are.
const SCALE_PER_LETTER: u32 = 4;

const WORDS: Colour = [235, 235, 235];
const FAINT: Colour = [120, 120, 130];
const UP: Colour = [90, 190, 255];
const DOWN: Colour = [255, 150, 80];

/// How the numbers of an observation are drawn.
pub struct Numbers {
    names: Vec<String>,
    /// For each number, what fills its bar.
    reach: Vec<f32>,
    letter: usize,
}

impl Numbers {
    /// Numbers of these names, drawn at a scale of pictures. Their bars are full at the largest value in any of the shots.
    pub fn new(names: Vec<String>, scale: u32, shots: &[Shot]) -> Self {
        let largest = |number: usize| {
            let values = shots.iter().filter_map(|shot| shot.vector.get(number));
            values.fold(0.0_f32, |largest, value| largest.max(value.abs()))
        };
        let reach = (0..names.len()).map(largest).collect();
        Self { names, reach, letter: (scale / SCALE_PER_LETTER).max(1) as usize }
    }

    fn line(&self) -> usize {
        font::HEIGHT * self.letter + MARGIN
    }

    /// Where the values begin, and where the bars do.
    fn columns(&self) -> [usize; 2] {
        let name = self.names.iter().map(|name| font::width(name)).max().unwrap_or(0);
        let value = font::width("-00000.000  ");
        [MARGIN + (name + font::width("  ")) * self.letter, MARGIN + (name + font::width("  ") + value) * self.letter]
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [usize; 2] {
        let [_, bars] = self.columns();
        [bars + (2 * BAR + 1) * self.letter + MARGIN, MARGIN + self.names.len() * self.line()]
    }

    /// Draws an observation at the upper left.
    pub fn draw(&self, screen: &mut Screen, values: &[f32]) {
        let ([column, bars], letter) = (self.columns(), self.letter);
        let middle = bars + BAR * letter;
        for (row, ((name, value), reach)) in self.names.iter().zip(values).zip(&self.reach).enumerate() {
            let y = MARGIN + row * self.line();
            font::write(screen, name, letter, (MARGIN, y), FAINT);
            font::write(screen, &describe(*value), letter, (column, y), WORDS);
            screen.block(middle, y, letter, font::HEIGHT * letter, FAINT);
            let share = if *reach > 0.0 { (value.abs() / reach).min(1.0) } else { 0.0 };
            let length = (share * (BAR * letter) as f32).round() as usize;
            let (left, colour) = if *value > 0.0 { (middle + letter, UP) } else { (middle - length, DOWN) };
            screen.block(left, y, length, font::HEIGHT * letter, colour);
        }
    }
}

/// Short enough for its column.
fn describe(value: f32) -> String {
    if value.abs() < 99_999.5 { format!("{value:.3}") } else { format!("{value:.1e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shot(vector: Vec<f32>) -> Shot {
        Shot { tick: 0, image: Vec::new(), vector, action: String::new(), value: None, skill: Vec::new(), reward: 0.0 }
    }

    #[test]
    fn bars_are_full_at_the_largest_value_and_point_the_other_way_below_zero() {
        let shots = [shot(vec![2.0, 0.0]), shot(vec![-1.0, 0.0])];
        let numbers = Numbers::new(vec!["x".to_owned(), "y".to_owned()], 4, &shots);
        let [width, height] = numbers.size();
        for (shot, colour, pixels) in [(&shots[0], UP, BAR), (&shots[1], DOWN, BAR / 2)] {
            let mut screen = Screen::new(width, height, [0; 3]).expect("small");
            numbers.draw(&mut screen, &shot.vector);
            let lit = screen.bytes().chunks_exact(3).filter(|pixel| *pixel == colour).count();
            assert_eq!(lit, pixels * font::HEIGHT, "the other number is 0 and has no bar");
        }
    }

    #[test]
    fn values_fit_their_column() {
        for value in [0.0, -1.5, 99_999.0, -99_999.0, 1e9, -3.4e38] {
            assert!(font::width(&describe(value)) <= font::width("-00000.000  "), "{value}");
        }
    }
}
