//! Chart of the cells of a floor that were reached, by number of visits, and the visits of each square.

use crate::{
    drawing::{Drawing, Rgb, Shape},
    eval::Trail,
    floor_plan::FloorPlan,
    trails::{BELOW, FloorFrame, goal_mark, scales, start_mark},
};
use bevy::math::{Rect, Vec2};
use playbot_report::text_table::{text_width, wrap};

/// Space around each part, pixels.
const GAP: f32 = 20.0;

const TITLE: f32 = 16.0;

const TEXT: f32 = 13.0;

/// Distance of lines, pixels.
const LINE: f32 = 19.0;

/// Width of the letters of pixel images, in font sizes.
const PIXEL_LETTER: f64 = 0.58;

/// Shortest width at which lines of text are broken, pixels.
const SHORTEST: f32 = 360.0;

/// Length of the longer side of a floor, pixels.
const LENGTH: f32 = 640.0;

/// Space between two cells, pixels.
const SEAM: f32 = 0.5;

/// Cells of one floor, coloured by their number of visits, and a path through them.
#[derive(Clone, Debug, PartialEq)]
pub struct CellChart {
    /// Title of the chart.
    pub title: String,
    /// Lines below the title.
    pub captions: Vec<String>,
    /// The bounds and the walls.
    pub plan: FloorPlan,
    /// Area and number of visits of each cell. Darker is more, on a logarithmic scale.
    pub reached: Vec<(Rect, u64)>,
    /// Cells that were not reached: they are crossed.
    pub missed: Vec<Rect>,
    /// Path from the start on; may be empty.
    pub path: Vec<Vec2>,
}

impl CellChart {
    /// Draws the chart.
    pub fn draw(&self) -> Drawing {
        let mut shapes = Vec::new();
        let mut right = write(0.0, TITLE, INK, &self.title, &mut shapes);
        let mut y = LINE;
        let extent = self.extent();
        let share = extent.width() / extent.size().max_element().max(f32::MIN_POSITIVE);
        // Lines are at most as long as the floor is wide, or as the shortest width.
        let room = f64::from((LENGTH * share).max(SHORTEST));
        for caption in self.captions.iter().flat_map(|caption| wrap(caption, room, f64::from(TEXT))) {
            right = right.max(write(y, TEXT, SOFT, &caption, &mut shapes));
            y += LINE;
        }
        right = right.max(self.legend(y, &mut shapes));
        y += LINE;
        let frame = FloorFrame::new(extent, Vec2::new(GAP, GAP + y + GAP / 2.0), LENGTH * share);
        self.floor(&frame, &mut shapes);
        let corner = frame.whole().max;
        let right = right.max(write(corner.y - GAP + BELOW, TEXT, SOFT, &scales(frame.bounds()), &mut shapes));
        Drawing { label: self.title.clone(), size: Vec2::new(right.max(corner.x), corner.y + LINE) + GAP, shapes }
    }

    /// Explains the marks, and returns the lower end.
    fn legend(&self, y: f32, out: &mut Vec<Shape>) -> f32 {
        let middle = GAP + y + TEXT - 4.5;
        out.push(start_mark(Vec2::new(GAP + 8.0, middle), 6.0));
        let right = write_at(GAP + 20.0, y, TEXT, SOFT, "start", out);
        out.push(goal_mark(Vec2::new(right + 24.0, middle), 6.0));
        let right = write_at(right + 36.0, y, TEXT, SOFT, "goal", out);
        if self.path.is_empty() {
            return right;
        }
        let ends = [right + 16.0, right + 40.0].map(|x| Vec2::new(x, middle));
        out.push(line(ends.to_vec(), 2.0, LINES[0]));
        write_at(right + 48.0, y, TEXT, SOFT, "path", out)
    }

    /// Returns the bounds of the plan, extended to everything that was reached.
    fn extent(&self) -> Rect {
        self.reached.iter().fold(self.plan.bounds, |extent, (area, _)| extent.union(*area))
    }

    fn floor(&self, frame: &FloorFrame, out: &mut Vec<Shape>) {
        let most = self.reached.iter().map(|(_, visits)| *visits).max().unwrap_or(0);
        let most = libm::log1p(most as f64).max(f64::MIN_POSITIVE);
        for (area, visits) in &self.reached {
            let area = frame.area(*area).inflate(-SEAM);
            out.push(Shape::Block { area, fill: heat(libm::log1p(*visits as f64) / most) });
        }
        let FloorPlan { walls, hazards, platforms, start, goal, .. } = &self.plan;
        for (areas, fill) in [(walls, WALL), (platforms, PLATFORM), (hazards, HAZARD)] {
            let seen = areas.iter().map(|area| frame.area(*area)).filter(|area| !area.is_empty());
            out.extend(seen.map(|area| Shape::Block { area, fill }));
        }
        for area in &self.missed {
            let Rect { min, max } = frame.area(*area).inflate(-2.0 * SEAM);
            let corners = [[min, max], [Vec2::new(min.x, max.y), Vec2::new(max.x, min.y)]];
            out.extend(corners.map(|points| line(points.to_vec(), 1.5, LINES[1])));
        }
        let positions: Vec<Vec2> =
            self.path.iter().filter(|position| position.is_finite()).map(|at| frame.place(*at)).collect();
        if positions.len() > 1 {
            out.push(line(positions, 2.0, LINES[0]));
        }
        let Rect { min, max } = frame.whole();
        let border = vec![min, Vec2::new(max.x, min.y), max, Vec2::new(min.x, max.y), min];
        out.push(line(border, 1.0, INK));
        out.push(start_mark(frame.place(*start), 6.0));
        out.push(goal_mark(frame.place(*goal), 6.0));
    }
}

/// Writes a line of text and returns its lower end.
fn write(y: f32, size: f32, colour: Rgb, words: &str, out: &mut Vec<Shape>) -> f32 {
    write_at(GAP, y, size, colour, words, out)
}

fn write_at(x: f32, y: f32, size: f32, colour: Rgb, words: &str, out: &mut Vec<Shape>) -> f32 {
    let at = Vec2::new(x, GAP + y + TEXT);
    out.push(Shape::Text { at, size, colour, words: words.to_owned() });
    let pixels = PIXEL_LETTER * f64::from(size) * words.chars().count() as f64;
    x + text_width(words, f64::from(size)).max(pixels) as f32
}

fn line(points: Vec<Vec2>, width: f32, colour: Rgb) -> Shape {
    Shape::Line { points, width, colour, opacity: 1.0 }
}

// Colours on white paper, distinct for every kind of colour vision.

pub(crate) const INK: Rgb = [31, 35, 40];

pub(crate) const SOFT: Rgb = [87, 96, 106];

pub(crate) const PAPER: Rgb = [255, 255, 255];

pub(crate) const WALL: Rgb = [190, 195, 201];

pub(crate) const HAZARD: Rgb = [236, 148, 138];

pub(crate) const PLATFORM: Rgb = [226, 209, 176];

/// The colours of lines, those of the other charts.
pub(crate) const LINES: [Rgb; 7] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [178, 82, 155], [201, 133, 0], [58, 155, 220], [91, 91, 91]];

/// From rarely to often visited: darker at every step.
const HEAT: [Rgb; 5] = [[255, 237, 160], [254, 178, 76], [240, 82, 40], [177, 0, 60], [68, 1, 52]];

/// Returns the colour of a share, 0 to 1, of the most visits.
pub(crate) fn heat(share: f64) -> Rgb {
    let step = share.clamp(0.0, 1.0) * (HEAT.len() - 1) as f64;
    let below = (step as usize).min(HEAT.len() - 2);
    let part = step - below as f64;
    std::array::from_fn(|channel| {
        let (from, to) = (f64::from(HEAT[below][channel]), f64::from(HEAT[below + 1][channel]));
        (from + part * (to - from)).round() as u8
    })
}

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

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> CellChart {
        let plan = FloorPlan {
            bounds: Rect::new(0.0, 0.0, 4.0, 2.0),
            walls: vec![Rect::new(3.0, 0.0, 4.0, 2.0)],
            start: Vec2::splat(0.5),
            goal: Vec2::new(2.5, 1.5),
            ..FloorPlan::default()
        };
        CellChart {
            title: "walk".to_owned(),
            captions: vec!["3 of 4 cells".to_owned()],
            plan,
            reached: vec![(Rect::new(0.0, 0.0, 1.0, 1.0), 100), (Rect::new(1.0, 0.0, 2.0, 1.0), 1)],
            missed: vec![Rect::new(2.0, 0.0, 3.0, 1.0)],
            path: vec![Vec2::splat(0.5), Vec2::new(1.5, 0.5)],
        }
    }

    #[test]
    fn cells_lie_on_the_floor_and_those_that_were_visited_more_are_darker() {
        let drawing = chart().draw();
        let block = |shape: &Shape| match shape {
            Shape::Block { area, fill } => Some((*area, *fill)),
            _ => None,
        };
        let blocks: Vec<(Rect, Rgb)> = drawing.shapes.iter().filter_map(block).collect();
        assert_eq!(blocks.len(), 3, "two cells and a wall");
        assert_eq!((blocks[0].1, blocks[2].1), (heat(1.0), WALL));
        assert_ne!(blocks[0].1, blocks[1].1);
        assert!(blocks[0].0.max.x < blocks[1].0.min.x && blocks[0].0.min.y == blocks[1].0.min.y);
        assert!((blocks[2].0.width() - LENGTH / 4.0).abs() < 0.01);
        let lines = drawing.shapes.iter().filter(|shape| matches!(shape, Shape::Line { .. })).count();
        assert_eq!(lines, 2 + 1 + 1 + 1, "a cross, the path, the border, and the path in the legend");
        let is_there = |wanted: &str| {
            drawing.shapes.iter().any(|shape| matches!(shape, Shape::Text { words, .. } if words == wanted))
        };
        assert!(["start", "goal", "path", "x 0 to 4, y 0 to 2"].into_iter().all(is_there));
    }

    #[test]
    fn long_lines_are_broken_instead_of_leaving_the_paper_blank_beside_the_floor() {
        let mut chart = chart();
        chart.captions = vec!["words ".repeat(60)];
        assert!(chart.draw().size.x <= LENGTH + 2.0 * GAP + 1.0, "{}", chart.draw().size);
    }

    #[test]
    fn everything_is_on_the_paper_even_beyond_the_plan() {
        let mut chart = chart();
        chart.reached.push((Rect::new(4.0, 2.0, 5.0, 3.0), 7));
        chart.path.push(Vec2::NAN);
        let drawing = chart.draw();
        for shape in &drawing.shapes {
            let points = match shape {
                Shape::Block { area, .. } => vec![area.min, area.max],
                Shape::Line { points, .. } => points.clone(),
                Shape::Mark { centre, .. } => vec![*centre],
                Shape::Text { at, .. } => vec![*at],
            };
            let is_on_paper = |point: &Vec2| point.min_element() >= 0.0 && point.cmple(drawing.size).all();
            assert!(points.iter().all(is_on_paper), "{shape:?} on {}", drawing.size);
        }
        assert_eq!(chart.draw().to_svg(), drawing.to_svg());
    }

    #[test]
    fn more_visits_are_darker() {
        let light = |share: f64| {
            let [red, green, blue] = heat(share).map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        for step in 1..=100 {
            assert!(light(f64::from(step) / 100.0) < light(f64::from(step - 1) / 100.0), "{step}");
        }
        assert_eq!((heat(-1.0), heat(2.0)), (HEAT[0], HEAT[4]));
    }
}
