//! The course of a path, regardless of hazards.

use super::{ground::Ground, held::STEPS, swept::Swept, walker::Walker};
use crate::coinrun::view_size::REACH;

/// Half the width and height of the view, in tiles.
pub(super) const HALF_VIEW: f32 = REACH as f32 + 0.5;

/// Positions of a player after each step, until it lands or leaves the view.
#[derive(Clone, Debug)]
pub(super) struct Course {
    walker: Walker,
    start: [f32; 2],
    x: [f32; STEPS as usize],
    y: [f32; STEPS as usize],
    steps: usize,
    flew: bool,
    lands: bool,
}

impl Course {
    /// Returns a course of no steps.
    pub fn new(walker: Walker) -> Self {
        let none = [0.0; STEPS as usize];
        Self { walker, start: [walker.x, walker.y], x: none, y: none, steps: 0, flew: false, lands: false }
    }

    /// Goes on to the end with a direction held (-1, 0 or 1), and perhaps the jump button.
    ///
    /// Hands the course to `fork` before the first step in which the jump button makes a difference.
    #[inline(always)]
    pub fn go_on<const JUMPS: bool>(&mut self, ground: &Ground, ax: i8, mut fork: impl FnMut(&Course)) {
        let (mut walker, [x, y], mut is_alike) = (self.walker, self.start, true);
        while self.steps < STEPS as usize && (walker.x - x).abs() < HALF_VIEW && (walker.y - y).abs() < HALF_VIEW {
            if is_alike && walker.supported {
                is_alike = false;
                self.walker = walker;
                fork(self);
            }
            let before = walker;
            walker = walker.step(ground, ax, JUMPS);
            (self.x[self.steps], self.y[self.steps]) = (walker.x, walker.y);
            self.steps += 1;
            if self.flew && walker.supported {
                self.lands = true;
                break;
            }
            self.flew |= !walker.supported && walker.vy.abs() > 0.5;
            // State that one step leaves unchanged stays unchanged in every further step.
            if walker == before {
                self.x[self.steps..].fill(walker.x);
                self.y[self.steps..].fill(walker.y);
                self.steps = STEPS as usize;
            }
        }
        self.walker = walker;
    }

    /// Returns the positions after each step.
    pub fn places(&self) -> (&[f32], &[f32]) {
        (&self.x[..self.steps], &self.y[..self.steps])
    }

    /// Returns the span of these positions.
    pub fn swept(&self) -> Swept {
        let (xs, ys) = self.places();
        let mut swept = Swept::between([xs[0], ys[0]], [xs[0], ys[0]]);
        for at in xs.iter().zip(ys) {
            swept.add([*at.0, *at.1]);
        }
        swept
    }

    /// Returns the start of the path.
    pub fn start(&self) -> [f32; 2] {
        self.start
    }

    /// Returns true if the last step ended a flight on firm ground.
    pub fn lands(&self) -> bool {
        self.lands
    }
}
