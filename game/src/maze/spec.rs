//! Size and shape of generated mazes.

use std::ops::RangeInclusive;

use super::{error::MazeError, walls::check_size};

/// Default seeds of the mazes to learn from.
pub const TRAIN_SEEDS: RangeInclusive<u64> = 0..=63;
/// Default seeds of the held-out mazes of the test.
pub const HELD_OUT_SEEDS: RangeInclusive<u64> = 64..=127;

/// Random walls between rooms, from which on two seeds do not draw the same ones.
const UNLIKELY: f64 = 36.0;

/// Size and shape of generated mazes.
///
/// Corridors join rooms of `corridor` x `corridor` cells that stand in a grid, one wall apart. Cells that a row of
/// rooms does not fill thicken the wall at the far side.
#[derive(Clone, Debug, PartialEq)]
pub struct MazeSpec {
    /// Rows of cells, the border included.
    pub rows: usize,
    /// Columns of cells, the border included.
    pub columns: usize,
    /// Share of the walls between neighbouring rooms that is removed once every room can be reached in exactly one way,
    /// 0 to 1. At 0 there is one path between any two rooms, at 1 no wall is left between them.
    pub loops: f64,
    /// Width of the corridors, cells; at least 1.
    pub corridor: usize,
    /// Range of moves of the shortest path from start to goal. `None` puts start and goal as far apart as possible.
    pub difficulty: Option<RangeInclusive<usize>>,
}

impl Default for MazeSpec {
    fn default() -> Self {
        Self { rows: 11, columns: 11, loops: 0.1, corridor: 1, difficulty: None }
    }
}

impl MazeSpec {
    /// Checks everything that does not need a maze.
    ///
    /// # Errors
    ///
    /// [`MazeError`] names the impossible value.
    pub fn check(&self) -> Result<(), MazeError> {
        let Self { rows, columns, loops, corridor, .. } = *self;
        if corridor == 0 {
            return Err(MazeError::NoCorridor);
        }
        let least = corridor.saturating_mul(2).saturating_add(3);
        if rows < least || columns < least {
            return Err(MazeError::TooSmall { rows, columns, corridor, least });
        }
        check_size(rows, columns)?;
        if !(0.0..=1.0).contains(&loops) {
            return Err(MazeError::Loops(loops.to_string()));
        }
        match &self.difficulty {
            Some(wanted) if wanted.is_empty() || *wanted.end() == 0 => {
                Err(MazeError::NoDifficulty { least: *wanted.start(), most: *wanted.end() })
            }
            _ => Ok(()),
        }
    }

    /// Returns true if two seeds are likely to draw the same walls: where there are few rooms, or few walls between
    /// them.
    pub(super) fn may_repeat(&self) -> bool {
        let rooms = [self.rows, self.columns].map(|cells| cells.saturating_sub(1) / (self.corridor + 1));
        rooms.iter().product::<usize>() as f64 * (1.0 - self.loops) <= UNLIKELY
    }
}
