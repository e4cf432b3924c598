//! The picture of a level with a path through it, or with the places that were not reached.

use crate::verdict_report::{Grid, HATCH, Reached, floor as draw_floor, shape, start_and_goal};
use bevy::math::{Rect, Vec2};
use playbot_harness::floor_plan::FloorPlan;
use std::fmt::Write;

/// Most points of a way. Of more, evenly spaced ones are drawn.
const MOST_POINTS: usize = 400;

/// Largest size of what an explorer has reached, bytes: a page of a watch has one picture.
const MOST_BYTES: usize = 200_000;

/// Share of the plan by which the picture may be larger, for agents that leave it.
const BEYOND: f32 = 0.5;

/// Returns the picture: the way that solves the level, the way of a solution that no longer does, and what an explorer has
/// reached. `None` for a plan without extent.
pub(super) fn picture(floor: &FloorPlan, way: &[Vec2], lost: &[Vec2], reached: Option<&Reached>) -> Option<String> {
    let grid = Grid::new(extent(floor.bounds, way.iter().chain(lost)))?;
    let [width, height] = grid.size();
    let mut svg = format!("<svg class=\"level\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"level\">");
    if reached.is_some() {
        svg += HATCH;
    }
    svg += &reached.map_or_else(String::new, |reached| reached.svg(&grid, MOST_BYTES));
    draw_floor(floor, &grid, &mut svg);
    for (class, positions) in [("way", way), ("way lost-way", lost)] {
        line(&grid, class, floor.start, positions, &mut svg);
    }
    if let Some([x, y]) = lost.last().and_then(|at| grid.place(*at)) {
        shape("mark", None, &format!("M{} {}l14 14m0-14l-14 14", x - 7, y - 7), &mut svg);
    }
    start_and_goal(floor, &grid, &mut svg);
    svg += "</svg>";
    Some(svg)
}

/// Returns the drawn area: the plan, with room for a way that leaves it.
fn extent<'a>(bounds: Rect, positions: impl Iterator<Item = &'a Vec2>) -> Rect {
    let most = bounds.inflate(BEYOND * bounds.size().max_element());
    let finite = positions.filter(|position| position.is_finite());
    finite.fold(bounds, |extent, position| extent.union_point(position.clamp(most.min, most.max)))
}

/// Draws a way from the start through positions.
fn line(grid: &Grid, class: &str, start: Vec2, positions: &[Vec2], svg: &mut String) {
    if positions.is_empty() {
        return;
    }
    let every = positions.len().div_ceil(MOST_POINTS);
    let last = positions.last().filter(|_| !(positions.len() - 1).is_multiple_of(every));
    let points = [start].into_iter().chain(positions.iter().copied().step_by(every)).chain(last.copied());
    let mut d = String::new();
    for [x, y] in points.filter_map(|at| grid.place(at)) {
        let _ = write!(d, "{}{x} {y}", if d.is_empty() { 'M' } else { 'L' });
    }
    shape(class, None, &d, svg);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::LevelMaps;

    fn floor() -> FloorPlan {
        FloorPlan {
            bounds: Rect::new(0.0, 0.0, 64.0, 16.0),
            walls: vec![Rect::new(0.0, 0.0, 64.0, 1.0)],
            start: Vec2::new(1.5, 1.5),
            goal: Vec2::new(60.5, 1.5),
            ..FloorPlan::default()
        }
    }

    #[test]
    fn a_way_begins_at_the_start_and_ends_at_the_last_position() {
        let way: Vec<Vec2> = (0..1000_u16).map(|tick| Vec2::new(1.5 + f32::from(tick) * 0.059, 1.5)).collect();
        let svg = picture(&floor(), &way, &[], None).expect("an extent");
        assert!(svg.contains("<path class=\"way\" d=\"M15 145L") && svg.contains("L604 145\"/>"), "{svg}");
        assert!(svg.len() < 8_000 && !svg.contains("lost-way") && !svg.contains("mark"), "{svg}");
    }

    #[test]
    fn a_way_that_is_lost_ends_with_a_cross_and_unreached_places_are_shown() {
        let svg = picture(&floor(), &[], &[Vec2::new(10.0, 2.0)], None).expect("an extent");
        assert!(svg.contains("class=\"way lost-way\" d=\"M15 145L100 140\"") && svg.contains("M93 133l14 14"), "{svg}");
        let maps = LevelMaps { side: 1.0, columns: 64, rows: 16, visits: vec![[65, 4]], ..LevelMaps::default() };
        let reached = Reached::by_testers(&maps, &floor()).expect("open squares");
        let svg = picture(&floor(), &[], &[], Some(&reached)).expect("an extent");
        assert!(svg.contains("<path class=\"reached\" d=\"M10 140h10v10h-10z\"/>"), "{svg}");
        assert!(svg.contains("<path class=\"missed\" d=\"M0 0h10v150h-10zM10 0h10v140h-10z"), "{svg}");
        assert!(svg.contains("<pattern id=\"hatch\""), "{svg}");
        let high = picture(&floor(), &[Vec2::new(9.0, 20.0), Vec2::new(9.0, 1e9)], &[], None).expect("an extent");
        assert!(
            high.contains("viewBox=\"0 0 640 480\"") && high.contains("L90 280"),
            "a way may leave the plan: {high}"
        );
        assert_eq!(picture(&FloorPlan { bounds: Rect::default(), ..floor() }, &[], &[], None), None);
    }
}
