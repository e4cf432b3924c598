//! Charts of where agents went: trajectories on the floor plan, and a map of visits.
//!
//! In the folder:
//!
//! - [`cells`]: chart of the cells of a floor that were reached, number of visits of each square, and the colours of all
//!   charts.

pub mod cells;

use crate::{
    drawing::{Drawing, MarkForm, Rgb, Shape},
    eval::Trail,
    floor_plan::FloorPlan,
    trails::cells::{HAZARD, INK, LINES, PAPER, PLATFORM, SOFT, WALL, heat},
};
use bevy::math::{Rect, Vec2};
use playbot_report::{counted, text_table::text_width};

pub use crate::trails::cells::{CellChart, Visits};

/// Trajectories and visits of one or more players on one or more floors.
#[derive(Clone, Debug, PartialEq)]
pub struct TrailChart {
    /// Title of the chart.
    pub title: String,
    /// The floors, below each other. Only the first 6 are drawn.
    pub floors: Vec<Floor>,
}

impl TrailChart {
    /// Draws the chart: for each player its trajectories, and a map of the squares visited in all its episodes.
    /// Trajectories are coloured lines, one per episode and at most 24.
    pub fn draw(&self) -> Drawing {
        draw(self)
    }
}

/// Levels with the same walls, and the players that walked there.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// Description of the levels.
    pub name: String,
    /// The bounds and the walls.
    pub plan: FloorPlan,
    /// Start positions of agents on these levels.
    pub starts: Vec<Vec2>,
    /// Goal positions on these levels.
    pub goals: Vec<Vec2>,
    /// The players, side by side.
    pub players: Vec<PlayerTrails>,
}

impl Floor {
    /// Returns the bounds of the plan, extended to everything that was walked on.
    fn extent(&self) -> Rect {
        let positions = self.players.iter().flat_map(|player| &player.trails).flat_map(|trail| &trail.positions);
        positions
            .filter(|position| position.is_finite())
            .fold(self.plan.bounds, |extent, &position| extent.union_point(position))
    }
}

/// The trails of one player on one floor.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayerTrails {
    /// Name of the player.
    pub name: String,
    /// Its episodes.
    pub trails: Vec<Trail>,
}

// Layout of a chart.

/// Largest number of floors that are drawn.
const MOST_FLOORS: usize = 6;

/// Space around and between drawings, pixels.
const GAP: f32 = 20.0;

/// Font size and distance of lines, pixels.
const TEXT: f32 = 13.0;

const TITLE: f32 = 16.0;

const LINE: f32 = 19.0;

/// Ratio of the widths of letters in pixel images and in drawings.
const WIDEST: f32 = 1.4;

/// Space between a drawing and the words below it.
pub(crate) const BELOW: f32 = 2.0;

/// Room for the words above a drawing.
const HEAD: f32 = 3.0 * LINE + 2.0;

/// A chart on paper.
struct Paper {
    shapes: Vec<Shape>,
    width: f32,
    y: f32,
}

pub(crate) fn draw(chart: &TrailChart) -> Drawing {
    let mut paper = Paper { shapes: Vec::new(), width: 0.0, y: GAP };
    paper.text(0.0, TITLE, INK, &chart.title);
    let has = |kind: fn(&Floor) -> bool| chart.floors.iter().take(MOST_FLOORS).any(kind);
    let tiles = [
        ("hazards", HAZARD, has(|floor| !floor.plan.hazards.is_empty())),
        ("crates and the like", PLATFORM, has(|floor| !floor.plan.platforms.is_empty())),
    ];
    paper.legend(&tiles);
    for floor in chart.floors.iter().take(MOST_FLOORS) {
        paper.floor(floor);
    }
    let left_out = chart.floors.len().saturating_sub(MOST_FLOORS);
    if left_out > 0 {
        let are = if left_out == 1 { "is" } else { "are" };
        paper.text(0.0, TEXT, SOFT, &format!("{} {are} not drawn", counted(left_out as u64, "more floor")));
    }
    let size = Vec2::new(paper.width + GAP, paper.y + GAP / 2.0);
    Drawing { label: chart.title.clone(), size, shapes: paper.shapes }
}

impl Paper {
    /// Writes a line of text, and moves below it.
    fn text(&mut self, x: f32, size: f32, colour: [u8; 3], words: &str) {
        self.words(x, size, colour, words);
        self.y += LINE;
    }

    /// Writes on this line, and stays there.
    fn words(&mut self, x: f32, size: f32, colour: [u8; 3], words: &str) -> f32 {
        let at = Vec2::new(GAP + x, self.y + TEXT);
        self.shapes.push(Shape::Text { at, size, colour, words: words.to_owned() });
        let right = GAP + x + text_width(words, f64::from(size)) as f32;
        self.width = self.width.max(right);
        right - GAP
    }

    /// Writes the legend; tile kinds only if they occur.
    fn legend(&mut self, tiles: &[(&str, Rgb, bool)]) {
        let middle = self.y + TEXT - 4.5;
        self.shapes.push(start_mark(Vec2::new(GAP + 8.0, middle), 6.0));
        let x = self.words(20.0, TEXT, SOFT, "start") + 24.0;
        self.shapes.push(goal_mark(Vec2::new(GAP + x, middle), 6.0));
        let mut x = self.words(x + 12.0, TEXT, SOFT, "goal") + 16.0;
        for &(words, fill, _) in tiles.iter().filter(|(.., is_there)| *is_there) {
            let corner = Vec2::new(GAP + x, middle - 6.0);
            self.shapes.push(Shape::Block { area: Rect::from_corners(corner, corner + 12.0), fill });
            x = self.words(x + 20.0, TEXT, SOFT, words) + 16.0;
        }
        for step in 0..8 {
            let corner = Vec2::new(GAP + x, middle - 6.0);
            let fill = heat(f64::from(step) / 7.0);
            self.shapes.push(Shape::Block { area: Rect::from_corners(corner, corner + Vec2::new(9.0, 12.0)), fill });
            x += 9.0;
        }
        self.text(x + 8.0, TEXT, SOFT, "few to most ticks in a square, logarithmic");
        self.y += GAP / 2.0;
    }

    /// Draws all players on a floor: a single one with both drawings side by side, several side by side with the
    /// drawings below each other.
    fn floor(&mut self, floor: &Floor) {
        self.text(0.0, TEXT, INK, &floor.name);
        let extent = floor.extent();
        let width = panel_width(extent);
        let contents = [Content::Trajectories, Content::Visits];
        let rows: Vec<Vec<(&PlayerTrails, Content)>> = match floor.players.as_slice() {
            [one] => vec![contents.map(|content| (one, content)).to_vec()],
            several => contents.map(|content| several.iter().map(|player| (player, content)).collect()).to_vec(),
        };
        for row in rows {
            let top = self.y;
            for (column, (player, content)) in row.into_iter().enumerate() {
                self.y = top;
                let frame = FloorFrame::new(extent, Vec2::new(GAP + column as f32 * (width + GAP), top + HEAD), width);
                self.panel(floor, player, content, &frame);
            }
        }
    }

    /// Draws a frame with a caption above it, and moves below it.
    fn panel(&mut self, floor: &Floor, player: &PlayerTrails, content: Content, frame: &FloorFrame) {
        let area = frame.whole();
        let reached = player.trails.iter().filter(|trail| trail.result.success).count();
        self.text(area.min.x - GAP, TEXT, INK, &fitted(&player.name, area.width()));
        self.text(area.min.x - GAP, TEXT, INK, &format!("goal reached in {reached} of {}", player.trails.len()));
        self.text(area.min.x - GAP, TEXT, SOFT, &content.caption(player));
        content.draw(floor, player, frame, &mut self.shapes);
        self.width = self.width.max(area.max.x);
        self.y = area.max.y + BELOW;
        self.text(area.min.x - GAP, TEXT, SOFT, &scales(frame.bounds()));
        self.y += GAP / 2.0;
    }
}

/// Shortens a name to one line of this width. The end is kept, since paths differ there.
fn fitted(name: &str, width: f32) -> String {
    let fits = |words: &str| text_width(words, f64::from(TEXT * WIDEST)) <= f64::from(width);
    if fits(name) {
        return name.to_owned();
    }
    let ends = name.char_indices().skip(1).map(|(at, _)| format!("..{}", &name[at..]));
    ends.into_iter().find(|words| fits(words)).unwrap_or_else(|| "..".to_owned())
}

/// Returns the width of a panel, larger for wide floors.
fn panel_width(extent: Rect) -> f32 {
    let shape = extent.width() / extent.height().max(f32::MIN_POSITIVE);
    (330.0 * shape.sqrt()).clamp(260.0, 900.0)
}

/// A floor on the paper: converts its units to pixels, with y turned around.
#[derive(Clone, Copy, Debug)]
pub struct FloorFrame {
    bounds: Rect,
    corner: Vec2,
    scale: f32,
}

impl FloorFrame {
    /// Makes a floor with its upper left corner here, this wide.
    pub fn new(bounds: Rect, corner: Vec2, width: f32) -> Self {
        Self { bounds, corner, scale: width / bounds.width().max(f32::MIN_POSITIVE) }
    }

    /// Returns the drawn part of the floor, in its units.
    pub fn bounds(&self) -> Rect {
        self.bounds
    }

    /// Returns the pixel of a position on the floor.
    pub fn place(&self, at: Vec2) -> Vec2 {
        self.corner + Vec2::new(at.x - self.bounds.min.x, self.bounds.max.y - at.y) * self.scale
    }

    /// Returns the pixels of an area of the floor, cut at the bounds.
    pub fn area(&self, area: Rect) -> Rect {
        let seen = area.intersect(self.bounds);
        Rect::from_corners(self.place(seen.min), self.place(seen.max))
    }

    /// Returns the pixels of the whole floor.
    pub fn whole(&self) -> Rect {
        self.area(self.bounds)
    }
}

/// Describes the ends of both axes of a drawing, from left to right and from below, in the units of positions.
pub fn scales(bounds: Rect) -> String {
    let Rect { min, max } = bounds;
    let [left, right, below, above] = [min.x, max.x, min.y, max.y].map(short);
    format!("x {left} to {right}, y {below} to {above}")
}

/// Returns a number with at most two decimals.
fn short(number: f32) -> String {
    let text = format!("{number:.2}");
    match text.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_owned(),
        short => short.to_owned(),
    }
}

// Drawing of a floor: trajectories, or visits.

/// Largest number of trajectories in one drawing: more are indistinct.
const MOST_LINES: usize = 24;

/// Points of a line are at least this far apart, pixels.
const STEP: f32 = 0.7;

const LINE_WIDTH: f32 = 1.8;

const OPACITY: f32 = 0.75;

/// Content of a drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// The paths of agents.
    Trajectories,
    /// Ticks per square.
    Visits,
}

impl Content {
    /// Returns the caption above the drawing.
    pub fn caption(self, player: &PlayerTrails) -> String {
        let all = player.trails.len();
        let episodes = if all == 1 { "episode" } else { "episodes" };
        match self {
            Self::Trajectories if all > MOST_LINES => format!("trajectories: {MOST_LINES} of {all} {episodes}"),
            Self::Trajectories => format!("trajectories: {all} {episodes}"),
            Self::Visits => format!("visits: {all} {episodes}"),
        }
    }

    /// Draws it.
    pub fn draw(self, floor: &Floor, player: &PlayerTrails, frame: &FloorFrame, out: &mut Vec<Shape>) {
        if self == Self::Visits {
            visits(&player.trails, frame, out);
        }
        let FloorPlan { walls, hazards, platforms, .. } = &floor.plan;
        for (areas, fill) in [(walls, WALL), (platforms, PLATFORM), (hazards, HAZARD)] {
            let seen = areas.iter().map(|&area| frame.area(area)).filter(|area| !area.is_empty());
            out.extend(seen.map(|area| Shape::Block { area, fill }));
        }
        if self == Self::Trajectories {
            lines(&player.trails, frame, out);
        }
        border(frame, out);
        let starts = floor.starts.iter().map(|&start| start_mark(frame.place(start), size(&floor.starts)));
        let goals = floor.goals.iter().map(|&goal| goal_mark(frame.place(goal), size(&floor.goals)));
        out.extend(starts.chain(goals));
    }
}

fn visits(trails: &[Trail], frame: &FloorFrame, out: &mut Vec<Shape>) {
    let visits = Visits::count(frame.bounds(), trails);
    let most = libm::log1p(visits.most() as f64);
    out.extend(visits.visited().map(|(square, ticks)| {
        let fill = heat(libm::log1p(ticks as f64) / most);
        Shape::Block { area: frame.area(square), fill }
    }));
}

fn lines(trails: &[Trail], frame: &FloorFrame, out: &mut Vec<Shape>) {
    let chosen: Vec<_> = evenly(trails, MOST_LINES).map(|trail| points(trail, frame)).collect();
    let coloured = || chosen.iter().zip(LINES.iter().cycle()).filter(|(points, _)| !points.is_empty());
    out.extend(coloured().map(|(points, &colour)| Shape::Line {
        points: points.clone(),
        width: LINE_WIDTH,
        colour,
        opacity: OPACITY,
    }));
    // Marks at the end of each episode.
    out.extend(coloured().filter_map(|(points, &colour)| {
        let centre = *points.last()?;
        Some(Shape::Mark { form: MarkForm::Disc, centre, radius: 3.0, fill: colour, outline: PAPER })
    }));
}

/// Returns at most `most` of the trails, with the first and the last among them.
fn evenly(trails: &[Trail], most: usize) -> impl Iterator<Item = &Trail> {
    let shown = trails.len().min(most);
    (0..shown).map(move |at| &trails[at * (trails.len() - 1) / (shown - 1).max(1)])
}

/// Returns the points of a trajectory on the paper, thinned to visible steps.
fn points(trail: &Trail, frame: &FloorFrame) -> Vec<Vec2> {
    let mut points: Vec<Vec2> = Vec::new();
    let mut all = trail.positions.iter().map(|&position| frame.place(position)).filter(|point| point.is_finite());
    for point in all.clone() {
        if points.last().is_none_or(|last| last.distance(point) >= STEP) {
            points.push(point);
        }
    }
    points.extend(all.next_back());
    points
}

fn border(frame: &FloorFrame, out: &mut Vec<Shape>) {
    let area = frame.whole();
    let corners = [area.min, Vec2::new(area.max.x, area.min.y), area.max, Vec2::new(area.min.x, area.max.y), area.min];
    out.push(Shape::Line { points: corners.to_vec(), width: 1.0, colour: INK, opacity: 1.0 });
}

/// Returns the size of marks, smaller if there are many.
fn size(positions: &[Vec2]) -> f32 {
    if positions.len() > 1 { 3.0 } else { 6.0 }
}

/// Returns the mark of a start.
pub(crate) fn start_mark(centre: Vec2, radius: f32) -> Shape {
    Shape::Mark { form: MarkForm::Disc, centre, radius, fill: PAPER, outline: INK }
}

/// Returns the mark of a goal.
pub(crate) fn goal_mark(centre: Vec2, radius: f32) -> Shape {
    Shape::Mark { form: MarkForm::Diamond, centre, radius: 1.3 * radius, fill: INK, outline: PAPER }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_both_axes_are_written_below_each_floor() {
        let plan = FloorPlan { bounds: Rect::new(-2.5, -0.001, 20.0, 6.25), ..FloorPlan::default() };
        let player = PlayerTrails { name: "a".to_owned(), trails: Vec::new() };
        let floor = |players: usize| Floor {
            name: "floor".to_owned(),
            plan: plan.clone(),
            starts: Vec::new(),
            goals: Vec::new(),
            players: vec![player.clone(); players],
        };
        let drawing = TrailChart { title: "walk".to_owned(), floors: vec![floor(1), floor(2)] }.draw();
        let written = drawing.shapes.iter().filter_map(|shape| match shape {
            Shape::Text { at, words, .. } if words.starts_with("x ") => Some((at, words.as_str())),
            _ => None,
        });
        let written: Vec<_> = written.collect();
        // Trajectories and visits, of each player.
        assert_eq!(written.len(), 2 + 4);
        for (at, words) in written {
            assert_eq!(words, "x -2.5 to 20, y 0 to 6.25");
            assert!(at.min_element() >= 0.0 && at.cmple(drawing.size).all(), "{at} on {}", drawing.size);
        }
        assert_eq!([100.0, 0.5, -30.0].map(short), ["100", "0.5", "-30"]);
    }

    #[test]
    fn long_names_keep_their_ends() {
        let name = "score-ppo runs/some/folder/of/many/runs/score-ppo-seed1";
        let short = fitted(name, 300.0);
        assert!(short.starts_with("..") && short.ends_with("/score-ppo-seed1"), "{short}");
        assert_eq!(fitted("ppo", 300.0), "ppo");
        assert_eq!(fitted(name, 1.0), "..");
    }
}
