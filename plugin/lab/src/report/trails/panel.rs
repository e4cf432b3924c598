//! A drawing of a floor: trajectories, or visits.

use bevy::math::Vec2;

use super::{
    Floor, Walker,
    colours::{HAZARD, INK, LINES, PAPER, PLATFORM, WALL, heat},
    frame::Frame,
    visits::Visits,
};
use crate::{
    drawing::{MarkForm, Shape},
    eval::Trail,
    floor_plan::FloorPlan,
};

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
    pub fn caption(self, walker: &Walker) -> String {
        let all = walker.trails.len();
        let episodes = if all == 1 { "episode" } else { "episodes" };
        match self {
            Self::Trajectories if all > MOST_LINES => format!("trajectories: {MOST_LINES} of {all} {episodes}"),
            Self::Trajectories => format!("trajectories: {all} {episodes}"),
            Self::Visits => format!("visits: {all} {episodes}"),
        }
    }

    /// Draws it.
    pub fn draw(self, floor: &Floor, walker: &Walker, frame: &Frame, out: &mut Vec<Shape>) {
        if self == Self::Visits {
            visits(&walker.trails, frame, out);
        }
        let FloorPlan { walls, hazards, platforms, .. } = &floor.plan;
        for (areas, fill) in [(walls, WALL), (platforms, PLATFORM), (hazards, HAZARD)] {
            let seen = areas.iter().map(|&area| frame.area(area)).filter(|area| !area.is_empty());
            out.extend(seen.map(|area| Shape::Block { area, fill }));
        }
        if self == Self::Trajectories {
            lines(&walker.trails, frame, out);
        }
        border(frame, out);
        let starts = floor.starts.iter().map(|&start| start_mark(frame.place(start), size(&floor.starts)));
        let goals = floor.goals.iter().map(|&goal| goal_mark(frame.place(goal), size(&floor.goals)));
        out.extend(starts.chain(goals));
    }
}

fn visits(trails: &[Trail], frame: &Frame, out: &mut Vec<Shape>) {
    let visits = Visits::count(frame.bounds(), trails);
    let most = (visits.most() as f64).ln_1p();
    out.extend(visits.visited().map(|(square, ticks)| {
        let fill = heat((ticks as f64).ln_1p() / most);
        Shape::Block { area: frame.area(square), fill }
    }));
}

fn lines(trails: &[Trail], frame: &Frame, out: &mut Vec<Shape>) {
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
fn points(trail: &Trail, frame: &Frame) -> Vec<Vec2> {
    let mut points: Vec<Vec2> = Vec::new();
    let mut all = trail.places.iter().map(|&place| frame.place(place)).filter(|point| point.is_finite());
    for point in all.clone() {
        if points.last().is_none_or(|last| last.distance(point) >= STEP) {
            points.push(point);
        }
    }
    points.extend(all.next_back());
    points
}

fn border(frame: &Frame, out: &mut Vec<Shape>) {
    let area = frame.whole();
    let corners = [area.min, Vec2::new(area.max.x, area.min.y), area.max, Vec2::new(area.min.x, area.max.y), area.min];
    out.push(Shape::Line { points: corners.to_vec(), width: 1.0, colour: INK, opacity: 1.0 });
}

/// Returns the size of marks, smaller if there are many.
fn size(places: &[Vec2]) -> f32 {
    if places.len() > 1 { 3.0 } else { 6.0 }
}

/// Returns the mark of a start.
pub fn start_mark(centre: Vec2, radius: f32) -> Shape {
    Shape::Mark { form: MarkForm::Disc, centre, radius, fill: PAPER, outline: INK }
}

/// Returns the mark of a goal.
pub fn goal_mark(centre: Vec2, radius: f32) -> Shape {
    Shape::Mark { form: MarkForm::Diamond, centre, radius: 1.3 * radius, fill: INK, outline: PAPER }
}
