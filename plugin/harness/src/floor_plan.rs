//! The floor plan of a level, for pictures of paths and for detectors.

use crate::drawing::{Drawing, MarkForm, Rgb, Shape};
use bevy::math::{Rect, Vec2};

/// The most letters along the longer side of a plan.
const LETTERS: f32 = 72.0;

/// Length of the longer side of a picture, pixels.
const PIXELS: f32 = 640.0;

/// The shape of a level from above, or from the side, in any units: x to the right, y up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloorPlan {
    /// The area of the plan.
    pub bounds: Rect,
    /// Walls, ground and everything else that agents cannot pass.
    pub walls: Vec<Rect>,
    /// Areas that kill.
    pub hazards: Vec<Rect>,
    /// Areas that agents can stand on and walk through, such as crates.
    pub platforms: Vec<Rect>,
    /// Start of the agents.
    pub start: Vec2,
    /// Goal of the agents.
    pub goal: Vec2,
}

impl FloorPlan {
    /// Creates the plan of a level of tiles with walls only. `square` returns the area of a tile, by row and column.
    /// Adjacent walls in a row become one rectangle. There must be a tile.
    pub fn of_tiles(
        [rows, columns]: [usize; 2],
        is_wall: impl Fn(usize, usize) -> bool,
        square: impl Fn(usize, usize) -> Rect,
        [start, goal]: [Vec2; 2],
    ) -> Self {
        let walls = joined_tiles([rows, columns], is_wall, &square);
        let bounds = square(0, 0).union(square(rows - 1, columns - 1));
        Self { bounds, walls, start, goal, ..Self::default() }
    }

    /// Returns the plan as rows of letters from the top: `S` the start, `G` the goal, `#` walls, `^` what kills, `=`
    /// platforms. A letter is one unit wide, or more in a plan that is longer than 72 units.
    ///
    /// ```
    /// use bevy::math::{Rect, Vec2};
    /// use playbot_harness::floor_plan::FloorPlan;
    ///
    /// let plan = FloorPlan {
    ///     bounds: Rect::new(0.0, 0.0, 4.0, 2.0),
    ///     walls: vec![Rect::new(0.0, 0.0, 2.0, 1.0), Rect::new(3.0, 0.0, 4.0, 1.0)],
    ///     start: Vec2::new(0.5, 1.5),
    ///     goal: Vec2::new(3.5, 1.5),
    ///     ..FloorPlan::default()
    /// };
    /// assert_eq!(plan.rows(), ["S..G", "##.#"]);
    /// ```
    pub fn rows(&self) -> Vec<String> {
        self.rows_with_path(&[])
    }

    /// Returns the plan as [`rows`](Self::rows) does, with a path in it: `*` where it leads through free cells and over
    /// platforms, and `X` at its end. Positions outside the plan are left out.
    ///
    /// ```
    /// # use bevy::math::{Rect, Vec2};
    /// # use playbot_harness::floor_plan::FloorPlan;
    /// # let plan = FloorPlan {
    /// #     bounds: Rect::new(0.0, 0.0, 4.0, 2.0),
    /// #     walls: vec![Rect::new(0.0, 0.0, 2.0, 1.0), Rect::new(3.0, 0.0, 4.0, 1.0)],
    /// #     start: Vec2::new(0.5, 1.5),
    /// #     goal: Vec2::new(3.5, 1.5),
    /// #     ..FloorPlan::default()
    /// # };
    /// assert_eq!(plan.rows_with_path(&[plan.start, Vec2::new(2.5, 1.5), Vec2::new(2.5, 0.5)]), ["S**G", "##X#"]);
    /// ```
    pub fn rows_with_path(&self, positions: &[Vec2]) -> Vec<String> {
        /// Longest step between two positions that is drawn as a line, in letters: beyond it the agent was put elsewhere.
        const LONGEST_STEP: f32 = 4.0;
        let (min, size, side) = (self.bounds.min, self.bounds.size(), self.letter());
        // A plan may be smaller than a letter, or have no bounds.
        let count = |length: f32| (length / side).ceil().clamp(1.0, LETTERS) as usize;
        let (columns, rows) = (count(size.x), count(size.y));
        let mut letters = vec![vec!['.'; columns]; rows];
        for (areas, letter) in [(&self.platforms, '='), (&self.hazards, '^'), (&self.walls, '#')] {
            for area in areas {
                // Areas that only touch a cell are not in it.
                let first = ((area.min - min) / side + 0.01).floor().max(Vec2::ZERO);
                let last = ((area.max - min) / side - 0.01).ceil().max(Vec2::ZERO);
                for row in letters.iter_mut().take(last.y as usize).skip(first.y as usize) {
                    row.iter_mut().take(last.x as usize).skip(first.x as usize).for_each(|free| *free = letter);
                }
            }
        }
        let mut set = |at: Vec2, letter: char| {
            let cell = ((at - min) / side).floor();
            if cell.cmpge(Vec2::ZERO).all()
                && let Some(row) = letters.get_mut(cell.y as usize)
                && let Some(old) = row.get_mut(cell.x as usize)
                && (letter != '*' || ['.', '='].contains(old))
            {
                *old = letter;
            }
        };
        for step in positions.windows(2) {
            let length = step[0].distance(step[1]) / side;
            let parts = if length <= LONGEST_STEP { (2.0 * length).ceil().max(1.0) } else { 1.0 };
            (0..=parts as u32).for_each(|part| set(step[0].lerp(step[1], part as f32 / parts), '*'));
        }
        let end = positions.last().map(|end| (*end, 'X'));
        [(self.start, 'S'), (self.goal, 'G')].into_iter().chain(end).for_each(|(at, letter)| set(at, letter));
        letters.iter().rev().map(String::from_iter).collect()
    }

    /// Returns the width and height of a letter of [`rows`](Self::rows).
    pub fn letter(&self) -> f32 {
        (self.bounds.size().max_element() / LETTERS).max(1.0)
    }

    /// Draws the plan. `label` describes it for readers that do not see it.
    pub fn picture(&self, label: &str) -> Drawing {
        let bounds = self.bounds;
        let scale = PIXELS / bounds.size().max_element().max(f32::MIN_POSITIVE);
        let at = |point: Vec2| Vec2::new(point.x - bounds.min.x, bounds.max.y - point.y) * scale;
        let blocks = |areas: &[Rect], fill: Rgb| -> Vec<Shape> {
            let block = |area: &Rect| Shape::Block { area: Rect::from_corners(at(area.min), at(area.max)), fill };
            areas.iter().map(block).collect()
        };
        let mark = |form, centre: Vec2, fill: Rgb| Shape::Mark {
            form,
            centre: at(centre),
            radius: PIXELS / 80.0,
            fill,
            outline: [255; 3],
        };
        let mut shapes = blocks(&[bounds], [238, 238, 238]);
        shapes.extend(blocks(&self.platforms, [170, 136, 102]));
        shapes.extend(blocks(&self.walls, [96, 96, 96]));
        shapes.extend(blocks(&self.hazards, [213, 94, 0]));
        shapes.push(mark(MarkForm::Disc, self.start, [0, 114, 178]));
        shapes.push(mark(MarkForm::Diamond, self.goal, [0, 158, 115]));
        Drawing { label: label.to_owned(), size: bounds.size() * scale, shapes }
    }
}

/// Returns the areas of the tiles of one kind. Adjacent tiles in a row become one rectangle.
pub fn joined_tiles(
    [rows, columns]: [usize; 2],
    is_one: impl Fn(usize, usize) -> bool,
    square: impl Fn(usize, usize) -> Rect,
) -> Vec<Rect> {
    let mut areas: Vec<Rect> = Vec::new();
    for row in 0..rows {
        let mut goes_on = false;
        for column in 0..columns {
            let is_one = is_one(row, column);
            match areas.last_mut() {
                Some(area) if is_one && goes_on => *area = area.union(square(row, column)),
                _ if is_one => areas.push(square(row, column)),
                _ => {}
            }
            goes_on = is_one;
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_leads_over_free_cells_and_its_end_is_seen_everywhere() {
        let plan = FloorPlan {
            bounds: Rect::new(0.0, 0.0, 9.0, 2.0),
            walls: vec![Rect::new(2.0, 0.0, 3.0, 1.0)],
            platforms: vec![Rect::new(4.0, 0.0, 5.0, 1.0)],
            start: Vec2::new(0.5, 0.5),
            goal: Vec2::new(8.5, 0.5),
            ..FloorPlan::default()
        };
        let at = |x: f32| Vec2::new(x, 0.5);
        assert_eq!(plan.rows_with_path(&[at(0.5), at(3.5), at(4.5)])[1], "S*#*X...G");
        assert_eq!(plan.rows_with_path(&[at(0.5), at(6.5)])[1], "S.#.=.X.G", "a jump of six cells is no path");
        assert_eq!(plan.rows_with_path(&[at(7.5), at(8.5)])[1], "S.#.=..*X");
        let outside = [Vec2::new(-5.0, 9.0), Vec2::new(f32::NAN, 0.0)];
        assert_eq!(plan.rows_with_path(&outside), plan.rows());
    }

    #[test]
    fn a_long_plan_has_72_letters_in_a_row_and_what_stands_outside_is_left_out() {
        let plan = FloorPlan {
            bounds: Rect::new(-720.0, 0.0, 720.0, 60.0),
            walls: vec![Rect::new(-800.0, 0.0, 900.0, 20.0), Rect::new(0.0, -50.0, 20.0, -10.0)],
            hazards: vec![Rect::new(-720.0, 40.0, -700.0, 60.0)],
            start: Vec2::new(-705.0, 30.0),
            goal: Vec2::new(5_000.0, 30.0),
            ..FloorPlan::default()
        };
        let rows = plan.rows();
        assert_eq!(rows, [format!("^{}", ".".repeat(71)), format!("S{}", ".".repeat(71)), "#".repeat(72)]);
        assert_eq!(FloorPlan::default().rows(), ["G"], "start and goal share its only letter");
    }

    #[test]
    fn walls_side_by_side_become_one() {
        let rows = ["##.#", "...."];
        let square = |row: usize, column: usize| {
            Rect::from_center_size(Vec2::new(2.0 * column as f32, 2.0 * row as f32), Vec2::splat(2.0))
        };
        let is_wall = |row: usize, column: usize| rows[row].as_bytes()[column] == b'#';
        let plan = FloorPlan::of_tiles([2, 4], is_wall, square, [Vec2::ZERO, Vec2::ONE]);
        assert_eq!(plan.walls, [Rect::new(-1.0, -1.0, 3.0, 1.0), Rect::new(5.0, -1.0, 7.0, 1.0)]);
        assert_eq!(plan.bounds, Rect::new(-1.0, -1.0, 7.0, 3.0));
    }
}
