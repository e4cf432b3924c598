//! Number of visits of each square.

use crate::eval::Trail;
use bevy::math::{Rect, Vec2};

/// Squares along the longer side of a floor.
const SQUARES: f32 = 64.0;

/// The number of ticks that agents spent in each square of a floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Visits {
    bounds: Rect,
    /// Length of a square's side, in the units of the plan.
    side: f32,
    columns: usize,
    /// Row by row, from the least y up.
    ticks: Vec<u64>,
}

impl Visits {
    /// Counts the positions of all trails. Positions outside of the bounds are not counted.
    pub fn count<'a>(bounds: Rect, trails: impl IntoIterator<Item = &'a Trail>) -> Self {
        let side = (bounds.size().max_element() / SQUARES).max(f32::MIN_POSITIVE);
        let squares = |length: f32| ((length / side).ceil() as usize).clamp(1, SQUARES as usize);
        let (columns, rows) = (squares(bounds.width()), squares(bounds.height()));
        let mut visits = Self { bounds, side, columns, ticks: vec![0; rows * columns] };
        for position in trails.into_iter().flat_map(|trail| &trail.positions) {
            if let Some(index) = visits.index(*position) {
                visits.ticks[index] += 1;
            }
        }
        visits
    }

    fn index(&self, position: Vec2) -> Option<usize> {
        let rows = self.ticks.len() / self.columns;
        self.bounds.contains(position).then(|| {
            let at = (position - self.bounds.min) / self.side;
            let (column, row) = ((at.x as usize).min(self.columns - 1), (at.y as usize).min(rows - 1));
            row * self.columns + column
        })
    }

    /// Returns the ticks in the square around a position; 0 outside of the bounds.
    pub fn at(&self, position: Vec2) -> u64 {
        self.index(position).map_or(0, |index| self.ticks[index])
    }

    /// Returns the sum of the ticks in all squares.
    pub fn total(&self) -> u64 {
        self.ticks.iter().sum()
    }

    /// Returns the largest number of ticks in a square.
    pub fn most(&self) -> u64 {
        self.ticks.iter().copied().max().unwrap_or(0)
    }

    /// Returns every visited square with its ticks.
    pub fn visited(&self) -> impl Iterator<Item = (Rect, u64)> + '_ {
        self.ticks.iter().enumerate().filter(|(_, ticks)| **ticks > 0).map(|(index, &ticks)| {
            let corner = Vec2::new((index % self.columns) as f32, (index / self.columns) as f32);
            let min = self.bounds.min + corner * self.side;
            (Rect::from_corners(min, (min + self.side).min(self.bounds.max)), ticks)
        })
    }
}
