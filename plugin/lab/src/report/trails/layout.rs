//! Layout of the drawings of a chart.

use bevy::math::{Rect, Vec2};

use super::{
    Floor, TrailChart, Walker,
    colours::{HAZARD, INK, PLATFORM, SOFT, heat},
    frame::Frame,
    panel::{Content, goal_mark, start_mark},
};
use crate::drawing::{Drawing, Rgb, Shape};
use crate::report::text_width::text_width;

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
/// Room for the words above a drawing.
const HEAD: f32 = 3.0 * LINE + 2.0;

/// A chart on paper.
struct Paper {
    shapes: Vec<Shape>,
    width: f32,
    y: f32,
}

pub fn draw(chart: &TrailChart) -> Drawing {
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
        paper.text(0.0, TEXT, SOFT, &format!("{left_out} more floors are not drawn"));
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
        let rows: Vec<Vec<(&Walker, Content)>> = match floor.walkers.as_slice() {
            [one] => vec![contents.map(|content| (one, content)).to_vec()],
            several => contents.map(|content| several.iter().map(|walker| (walker, content)).collect()).to_vec(),
        };
        for row in rows {
            let top = self.y;
            for (column, (walker, content)) in row.into_iter().enumerate() {
                self.y = top;
                let frame = Frame::new(extent, Vec2::new(GAP + column as f32 * (width + GAP), top + HEAD), width);
                self.panel(floor, walker, content, &frame);
            }
        }
    }

    /// Draws a frame with a caption above it, and moves below it.
    fn panel(&mut self, floor: &Floor, walker: &Walker, content: Content, frame: &Frame) {
        let area = frame.whole();
        let reached = walker.trails.iter().filter(|trail| trail.result.success).count();
        self.text(area.min.x - GAP, TEXT, INK, &fitted(&walker.name, area.width()));
        self.text(area.min.x - GAP, TEXT, INK, &format!("goal reached in {reached} of {}", walker.trails.len()));
        self.text(area.min.x - GAP, TEXT, SOFT, &content.caption(walker));
        content.draw(floor, walker, frame, &mut self.shapes);
        self.width = self.width.max(area.max.x);
        self.y = area.max.y + GAP;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_keep_their_ends() {
        let name = "score-ppo runs/some/folder/of/many/runs/score-ppo-seed1";
        let short = fitted(name, 300.0);
        assert!(short.starts_with("..") && short.ends_with("/score-ppo-seed1"), "{short}");
        assert_eq!(fitted("ppo", 300.0), "ppo");
        assert_eq!(fitted(name, 1.0), "..");
    }
}
