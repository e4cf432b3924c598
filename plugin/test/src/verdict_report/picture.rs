//! Small drawings of levels: floor plan, ends of episodes, and maps, or the path of an agent up to a finding.

use crate::{
    verdict::{END_SQUARES, LevelVerdict, MapScope, SquareEnds},
    verdict_report::{
        ends,
        heat::{Block, Grid, floor, layers, path, shape, start_and_goal},
        reach::Reached,
    },
};
use bevy::math::{Rect, Vec2};
use playbot_harness::{floor_plan::FloorPlan, trails::scales};
use playbot_report::escape::escape;
use std::{cmp::Reverse, fmt::Write};

/// Largest size of a drawing without the maps, bytes: a page has up to 200 of them.
const MOST_BYTES: usize = 8_000;

/// Largest size of the squares that were reached or not, bytes.
const MOST_REACH: usize = 4_000;

/// Largest number of squares with ends, those with the most ends.
const MOST_SQUARES: usize = 40;

/// Opacities of squares, from few to many ends.
const STRENGTHS: [&str; 4] = [".3", ".5", ".7", ".9"];

/// Most points of a path. Of more, evenly spaced ones are drawn.
const MOST_POINTS: usize = 300;

/// Largest size of a drawing, bytes: a page has up to 50 of them.
const MOST_PATH_BYTES: usize = 12_000;

/// Room for a path that leaves the plan, as a share of its longer side.
const BEYOND: f32 = 0.1;

/// Half of the cross on a path. It is seen in a drawing of a quarter of its size, too.
const CROSS: i32 = 27;

/// Returns the drawing as an SVG element in the colours of the page, and the ends of its axes in words. `None` for a plan
/// without extent, or with too many parts for a page with many levels.
///
/// `reached` lies below all else, for a level that no tester solved.
pub(crate) fn picture(plan: &FloorPlan, level: &LevelVerdict, reached: Option<&Reached>) -> Option<(String, String)> {
    let side = plan.bounds.size().max_element() / END_SQUARES;
    let extent = extent(plan.bounds, side, &level.ends);
    let grid = Grid::new(extent)?;
    let [width, height] = grid.size();
    let label = format!("{}: solved {}, {}", level.title(), level.score.solved, ends(&level.score));
    let mut svg = format!(
        "<svg class=\"level\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">",
        escape(&label)
    );
    let reached = reached.map(|reached| reached.svg(&grid, MOST_REACH)).filter(|reached| !reached.is_empty());
    let reached = reached.map_or_else(String::new, |reached| format!("<g class=\"map ends reach\">{reached}</g>"));
    svg += &reached;
    floor(plan, &grid, &mut svg);
    let mut squares: Vec<(Block, &SquareEnds)> =
        level.ends.iter().filter_map(|end| Some((square(&grid, extent, side, end)?, end))).collect();
    squares.sort_by_key(|(_, end)| Reverse(end.lost.saturating_add(end.timed_out)));
    squares.truncate(MOST_SQUARES);
    svg += "<g class=\"map ends\">";
    heat("lost", squares.iter().map(|(block, end)| (*block, end.lost)), &mut svg);
    heat("late", squares.iter().map(|(block, end)| (*block, end.timed_out)), &mut svg);
    marks(&squares, &mut svg);
    svg += "</g>";
    let maps = level.maps.as_ref().map_or_else(String::new, |maps| layers(&grid, maps));
    svg += &maps;
    start_and_goal(plan, &grid, &mut svg);
    svg += "</svg>";
    (svg.len() - maps.len() - reached.len() <= MOST_BYTES).then(|| (svg, scales(extent)))
}

/// Returns the drawn area: the bounds of the plan, with room for agents that fell out of it.
fn extent(bounds: Rect, side: f32, ends: &[SquareEnds]) -> Rect {
    let is_inside = |end: &SquareEnds| bounds.contains(Vec2::new(end.x, end.y));
    if ends.iter().all(is_inside) { bounds } else { bounds.inflate(2.0 * side) }
}

/// Returns the square of an end. Ends far away are at the border.
fn square(grid: &Grid, extent: Rect, side: f32, end: &SquareEnds) -> Option<Block> {
    let (middle, half) = (Vec2::new(end.x, end.y), Vec2::splat(side / 2.0));
    if !middle.is_finite() {
        return None;
    }
    let seen = middle.max(extent.min + half).min(extent.max - half);
    grid.block(Rect::from_center_size(seen, Vec2::splat(side)))
}

/// Draws squares in the colour of a class, stronger for more ends.
fn heat(class: &str, squares: impl Iterator<Item = (Block, u64)> + Clone, svg: &mut String) {
    let most = squares.clone().map(|(_, count)| count).max().unwrap_or(0).max(1);
    let mut steps: [Vec<Block>; STRENGTHS.len()] = Default::default();
    for (block, count) in squares.filter(|(_, count)| *count > 0) {
        let step = count.saturating_mul(STRENGTHS.len() as u64).div_ceil(most).clamp(1, STRENGTHS.len() as u64);
        steps[step as usize - 1].push(block);
    }
    for (blocks, strength) in steps.iter().zip(STRENGTHS) {
        shape(class, Some(strength), &path(blocks), svg);
    }
}

/// Draws a cross for lost episodes, a bar for those whose time was up: readers may not see colours.
fn marks(squares: &[(Block, &SquareEnds)], svg: &mut String) {
    let (mut crosses, mut bars) = (String::new(), String::new());
    for (Block { left, right, top, bottom }, end) in squares {
        let (x, y) = ((left + right) / 2, (top + bottom) / 2);
        if end.lost > 0 {
            let _ = write!(crosses, "M{} {}l10 10m0-10l-10 10", x - 5, y - 5);
        }
        if end.timed_out > 0 {
            let _ = write!(bars, "M{} {y}h10", x - 5);
        }
    }
    shape("mark", None, &crosses, svg);
    shape("mark", None, &bars, svg);
}

// Legend of the pictures.

/// Legend of the marks of all pictures.
const MARKS: &str = "\
<ul class=\"legend\">
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><circle class=\"start\" cx=\"10\" cy=\"10\" r=\"7\"/></svg>start</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"goal\" d=\"M10 1l9 9l-9 9l-9-9z\"/></svg>goal</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"hazard\" d=\"M0 0h20v20h-20z\"/></svg>hazards</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"platform\" d=\"M0 0h20v20h-20z\"/></svg>crates and the \
like</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"lost\" opacity=\".7\" d=\"M0 0h20v20h-20z\"/>\
<path class=\"mark\" d=\"M5 5l10 10m0-10l-10 10\"/></svg>lost here</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"late\" opacity=\".7\" d=\"M0 0h20v20h-20z\"/>\
<path class=\"mark\" d=\"M5 10h10\"/></svg>time was up here</li>
</ul>
";

/// Shown by the script; without it, pictures show the ends.
const SWITCH: &str = "\
<form id=\"maps\" class=\"filter\" hidden><fieldset><legend>Pictures show</legend>
<label><input type=\"radio\" name=\"map\" value=\"ends\" checked> ends</label>
<label><input type=\"radio\" name=\"map\" value=\"visits\"> visits</label>
<label><input type=\"radio\" name=\"map\" value=\"lost-time\"> lost time</label>
<label><input type=\"radio\" name=\"map\" value=\"skills\"> skills</label>
</fieldset></form>
";

/// Legend of levels that no tester solved.
const REACH: &str = "\
<ul class=\"legend\">
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"reached\" d=\"M0 0h20v20h-20z\"/></svg>reached, in an \
unsolved level</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"missed\" d=\"M0 0h20v20h-20z\"/><path class=\"hatched\" \
fill=\"url(#hatch)\" d=\"M0 0h20v20h-20z\"/></svg>not reached, though no wall cuts it off from the start or from the goal</li>
</ul>
";

/// Legend of the maps.
const MAPS: &str = "\
<ul class=\"legend words\">
<li><b>ends</b>: the stronger a square, the more episodes ended there</li>
<li><b>visits</b>: ticks that agents were in a square; each stronger colour means at least four times as many</li>
<li><b>lost time</b>: ticks more than two seconds after an agent last came to a square that was new in its episode, since it \
rested or went back and forth; the stronger, the more</li>
<li><b>skills</b>: the skill that was active longest in a square; the colours are named below each picture</li>
</ul>
";

/// Returns the legend of pictures, with the switch if some have maps, and with reached squares if some show them.
pub(crate) fn map_legend(has_maps: bool, has_reach: bool) -> String {
    let reach = if has_reach { REACH } else { "" };
    if has_maps { format!("{MARKS}{reach}{SWITCH}{MAPS}") } else { format!("{MARKS}{reach}") }
}

/// Returns a sentence that names the levels with maps; empty for results that are older than maps.
pub(crate) fn map_scope(scope: MapScope) -> &'static str {
    match scope {
        MapScope::None => "",
        MapScope::Failed => {
            " Maps of where agents went are kept for levels that were not solved each time or that have findings, since \
             there are many levels."
        }
        MapScope::All => " Maps of where agents went are kept for all levels.",
    }
}

/// Returns the drawing of a plan with the path of an agent up to a finding, in the colours of the page, with a cross at `cross`, or else at the last position.
/// `None` without a position, or for a plan without extent or with too many parts.
pub(crate) fn plan_with_path(
    plan: &FloorPlan,
    positions: &[[f32; 2]],
    cross: Option<[f32; 2]>,
    label: &str,
) -> Option<String> {
    let positions: Vec<Vec2> = positions.iter().map(|at| Vec2::from(*at)).filter(|at| at.is_finite()).collect();
    let last = positions.last()?;
    let grid = Grid::new(with_room(plan.bounds, &positions))?;
    let [width, height] = grid.size();
    let mut svg =
        format!("<svg class=\"level\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">", escape(label));
    floor(plan, &grid, &mut svg);
    let every = positions.len().div_ceil(MOST_POINTS);
    let points = positions.iter().step_by(every).chain([last]);
    let mut places: Vec<[i32; 2]> = points.filter_map(|at| grid.place(*at)).collect();
    places.dedup();
    let mut path = String::new();
    for [x, y] in &places {
        // Writing into a string cannot fail.
        let _ = write!(path, "{}{x} {y}", if path.is_empty() { 'M' } else { 'L' });
    }
    shape("way", None, &path, &mut svg);
    start_and_goal(plan, &grid, &mut svg);
    let cross = cross.map(Vec2::from).filter(|at| at.is_finite()).and_then(|at| grid.place(at));
    if let Some([x, y]) = cross.or(places.last().copied()) {
        let whole = 2 * CROSS;
        let cross = format!("M{} {}l{whole} {whole}m0-{whole}l-{whole} {whole}", x - CROSS, y - CROSS);
        // A rim in the colour of the page sets it off from all that it lies on.
        shape("cross rim", None, &cross, &mut svg);
        shape("cross", None, &cross, &mut svg);
    }
    svg += "</svg>";
    (svg.len() <= MOST_PATH_BYTES).then_some(svg)
}

/// Returns the drawn area: the plan, with room for a path that leaves it.
fn with_room(bounds: Rect, positions: &[Vec2]) -> Rect {
    let most = bounds.inflate(BEYOND * bounds.size().max_element());
    positions.iter().fold(bounds, |extent, at| extent.union_point(at.max(most.min).min(most.max)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::LevelMaps,
        verdict_report::testing::{garden, level},
    };

    fn drawn(ends: &[(f32, f32, u64, u64)]) -> String {
        let end = |&(x, y, lost, timed_out): &(f32, f32, u64, u64)| SquareEnds {
            x,
            y,
            lost,
            timed_out,
            ..SquareEnds::default()
        };
        let level = LevelVerdict { ends: ends.iter().map(end).collect(), ..level(0, 0, 9, 0) };
        picture(&garden(), &level, None).expect("small").0
    }

    #[test]
    fn ends_are_squares_that_are_stronger_where_there_are_more_of_them() {
        let svg = drawn(&[(11.0, 3.0, 8, 0), (13.0, 3.0, 1, 0), (31.0, 5.0, 0, 2)]);
        assert!(svg.contains("viewBox=\"0 0 640 160\""), "{svg}");
        // A square is 64 / 32 = 2 long, and a unit 10 of the grid.
        assert!(svg.contains("<path class=\"lost\" opacity=\".9\" d=\"M100 120h20v20h-20z\"/>"), "{svg}");
        assert!(svg.contains("<path class=\"lost\" opacity=\".3\" d=\"M120 120h20v20h-20z\"/>"), "{svg}");
        assert!(svg.contains("<path class=\"late\" opacity=\".9\" d=\"M300 100h20v20h-20z\"/>"), "{svg}");
        assert_eq!(svg.matches("l10 10m0-10l-10 10").count(), 2, "{svg}");
        assert!(svg.contains("d=\"M305 110h10\""), "{svg}");
        assert!(svg.contains("class=\"wall\"") && svg.contains("class=\"hazard\""), "{svg}");
        assert!(!svg.contains("class=\"platform\""), "there are none: {svg}");
    }

    #[test]
    fn ends_and_maps_are_groups_of_which_one_is_shown() {
        let plain = drawn(&[(11.0, 3.0, 8, 0)]);
        assert!(
            plain.contains("<g class=\"map ends\"><path class=\"lost\"") && !plain.contains("map visits"),
            "{plain}"
        );
        let maps = LevelMaps { side: 1.0, columns: 64, rows: 16, visits: vec![[70, 9]], ..LevelMaps::default() };
        let level = LevelVerdict { maps: Some(maps), ..level(0, 0, 9, 0) };
        let (svg, axes) = picture(&garden(), &level, None).expect("small");
        assert_eq!(axes, "x 0 to 64, y 0 to 16");
        for class in ["ends", "visits", "lost-time", "skills"] {
            assert_eq!(svg.matches(&format!("<g class=\"map {class}\">")).count(), 1, "{class} in {svg}");
        }
        assert!(svg.contains("<path class=\"visit\" opacity=\".85\" d=\"M60 140h10v10h-10z\"/>"), "{svg}");
    }

    #[test]
    fn squares_of_an_unsolved_level_that_were_not_reached_are_hatched_with_the_ends() {
        let maps = LevelMaps { side: 1.0, columns: 64, rows: 16, visits: vec![[65, 9]], ..LevelMaps::default() };
        let reached = Reached::by_testers(&maps, &garden()).expect("open squares");
        let (svg, _) = picture(&garden(), &level(0, 0, 9, 0), Some(&reached)).expect("small");
        let (reach, rest) = svg.split_once("</g>").expect("a group");
        assert!(
            reach.ends_with("z\"/>") && reach.contains("<g class=\"map ends reach\"><path class=\"reached\""),
            "{reach}"
        );
        assert!(reach.contains("class=\"hatched\" fill=\"url(#hatch)\"") && reach.len() < MOST_REACH + 200, "{reach}");
        assert!(rest.starts_with("<path class=\"wall\""), "walls lie above: {rest}");
    }

    #[test]
    fn who_fell_out_of_the_level_is_at_its_border() {
        let svg = drawn(&[(11.0, -1.0, 1, 0), (1e9, -1e9, 1, 0), (f32::NAN, 0.0, 1, 0)]);
        assert!(svg.contains("viewBox=\"0 0 640 "), "{svg}");
        assert_eq!(svg.matches("l10 10m0-10l-10 10").count(), 2, "what is no place is left out: {svg}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }

    #[test]
    fn of_many_ends_the_most_frequent_are_drawn() {
        let svg = drawn(&Vec::from_iter((0..60_u8).map(|x| (f32::from(x) + 0.5, 3.0, u64::from(x) + 1, 0))));
        assert_eq!(svg.matches("l10 10m0-10l-10 10").count(), MOST_SQUARES);
        assert!(svg.contains("d=\"M585 120h20v20h-20z") && !svg.contains("M0 120h"), "{svg}");
    }

    #[test]
    fn a_level_with_too_many_parts_has_no_picture() {
        let speck = |number: usize| {
            let corner = Vec2::new((number % 60) as f32, (number / 60) as f32);
            Rect::from_corners(corner, corner + 0.5)
        };
        let plan = FloorPlan { walls: (0..900).map(speck).collect(), ..garden() };
        assert_eq!(picture(&plan, &level(0, 0, 1, 0), None), None);
        let flat = FloorPlan { bounds: Rect::default(), ..garden() };
        assert_eq!(picture(&flat, &level(0, 0, 1, 0), None), None);
    }

    #[test]
    fn the_path_goes_from_the_first_position_to_a_cross() {
        let path: Vec<[f32; 2]> = (0..1000_u16).map(|tick| [1.5 + f32::from(tick) * 0.05, 1.5]).collect();
        let svg = plan_with_path(&garden(), &path, None, "the <path>").expect("a plan");
        assert!(svg.contains("aria-label=\"the &lt;path&gt;\"") && svg.len() <= MOST_PATH_BYTES, "{svg}");
        let (_, drawn) = svg.split_once("<path class=\"way\" d=\"M").expect("a path");
        let (drawn, _) = drawn.split_once('"').expect("its end");
        let points: Vec<(i32, i32)> = drawn
            .split('L')
            .map(|point| {
                let (x, y) = point.split_once(' ').expect("two numbers");
                (x.parse().expect("a number"), y.parse().expect("a number"))
            })
            .collect();
        assert!(points.len() > 100 && points.len() <= MOST_POINTS + 1, "{}", points.len());
        assert!(points.is_sorted_by_key(|(x, _)| *x) && points.iter().all(|(_, y)| *y == points[0].1), "{points:?}");
        let (x, y) = points[points.len() - 1];
        let cross = |x: i32, y: i32| format!("\" d=\"M{} {}l54 54m0-54l-54 54\"/>", x - 27, y - 27);
        assert!(svg.contains(&format!("<path class=\"cross rim{0}<path class=\"cross{0}", cross(x, y))), "{svg}");
        let earlier = plan_with_path(&garden(), &path, Some(path[400]), "").expect("a plan");
        let (x, y) = points[100];
        assert!(earlier.contains(&cross(x, y)) && earlier.matches("class=\"cross").count() == 2, "{earlier}");
        assert!(svg.contains("class=\"start\"") && svg.contains("class=\"goal\""));
    }

    #[test]
    fn what_cannot_be_drawn_has_no_plan() {
        let garden = garden();
        assert_eq!(plan_with_path(&garden, &[], None, ""), None);
        assert_eq!(plan_with_path(&garden, &[[f32::NAN, 1.0]], None, ""), None);
        assert_eq!(plan_with_path(&FloorPlan::default(), &[[1.0, 1.0]], None, ""), None, "it has no extent");
        let bush = |number: u16| {
            let at = Vec2::new(f32::from(number % 60) + 0.5, f32::from(number / 60) * 0.3 + 0.5);
            Rect::from_center_size(at, Vec2::splat(0.05))
        };
        let crowded = FloorPlan { walls: (0..3_000).map(bush).collect(), ..garden };
        assert_eq!(plan_with_path(&crowded, &[[1.0, 1.0]], None, ""), None, "it would be too large");
        // Far beyond the plan is at its border.
        let svg = plan_with_path(&FloorPlan { walls: Vec::new(), ..crowded }, &[[1.0, 1.0], [1e9, -1e9]], None, "")
            .expect("a plan");
        assert!(svg.len() < 2_000, "{svg}");
    }
}
