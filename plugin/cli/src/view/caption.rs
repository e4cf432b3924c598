//! Caption of a picture: tick, action, value, and the skill as bars.

use playbot_lab::report::readable;

use super::{
    colours::{DOWN, FAINT, UP, WORDS},
    episode_world::EpisodeStep,
    font,
    screen::Screen,
};

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
pub const NARROWEST: usize = 160;

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
        font::HEIGHT * self.letter + MARGIN
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
        font::write(screen, &tick, letter, (MARGIN, first), FAINT);
        // The action always begins at the same place.
        let column = MARGIN + font::width("tick 9999  ") * letter;
        font::write(screen, &step.action, letter, (column, first), WORDS);
        let second = first + self.line();
        if let Some(value) = step.value {
            font::write(screen, &format!("value {value:.2}"), letter, (MARGIN, second), WORDS);
        }
        if step.reward != 0.0 {
            let reward = readable(f64::from(step.reward));
            font::write(screen, &format!("reward {reward}"), letter, (column, second), UP);
        }
        self.bars(screen, second + self.line(), &step.skill);
    }

    fn bars(&self, screen: &mut Screen, top: usize, skill: &[f32]) {
        if skill.is_empty() {
            return;
        }
        font::write(screen, &format!("skill, bars full at ±{FULL}"), self.letter, (MARGIN, top), FAINT);
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
