//! Maps of a level as coloured squares over its plan: visits, lost time, and skills.

use crate::verdict::LevelMaps;
use bevy::math::{Rect, Vec2};
use playbot_harness::floor_plan::FloorPlan;
use playbot_report::escape::escape;
use std::{cmp::Reverse, collections::BTreeMap, fmt::Write};

/// Largest size of a layer, bytes: a page has up to 200 pictures with three of them.
const MOST_BYTES: usize = 2_500;

/// Squares along each side that become one if a layer would be too large.
const STEPS: [u64; 4] = [1, 2, 4, 8];

/// Opacities of squares.
const STRENGTHS: [&str; 4] = [".25", ".45", ".65", ".85"];

/// Skills with a colour of their own; all others share one.
pub(crate) const SKILL_COLOURS: usize = 4;

/// Look of squares: a class with its opacity, or a skill with its name.
enum Look<'a> {
    Strength(&'static str, &'static str),
    Skill(usize, &'a str),
}

/// Returns the layers of a level's maps, each in a group; the page shows one group at a time.
pub(crate) fn layers(grid: &Grid, maps: &LevelMaps) -> String {
    if maps.columns == 0 {
        return String::new();
    }
    let of = |class| STRENGTHS.map(|strength| Look::Strength(class, strength));
    let visits =
        layer("map visits", grid, maps, &of("visit"), |step| strong(&summed(maps, &maps.visits, step), fourfold));
    let lost =
        layer("map lost-time", grid, maps, &of("waste"), |step| strong(&summed(maps, &maps.lost, step), quarter));
    visits + &lost + &skill_layer("map skills", grid, maps)
}

/// Returns a group of these classes with counts of squares, stronger for more of them. The strongest colour is that of the
/// largest count in `all`, so several layers have one scale.
pub(crate) fn count_layer(
    [classes, colour]: [&'static str; 2],
    grid: &Grid,
    maps: &LevelMaps,
    counts: &[[u64; 2]],
    all: &[&[[u64; 2]]],
) -> String {
    layer(classes, grid, maps, &STRENGTHS.map(|strength| Look::Strength(colour, strength)), |step| {
        let most = all.iter().flat_map(|counts| summed(maps, counts, step).into_values()).max().unwrap_or(0);
        let sums = summed(maps, counts, step).into_iter().filter(|(_, count)| *count > 0);
        sums.map(|(place, count)| (place, quarter(count, most))).collect()
    })
}

/// Returns a group of these classes with the skill that was active longest in each square.
pub(crate) fn skill_layer(classes: &str, grid: &Grid, maps: &LevelMaps) -> String {
    let names = maps.skills.iter().take(SKILL_COLOURS).map(|known| known.skill.as_str()).chain(["other skills"]);
    let looks: Vec<Look> = names.enumerate().map(|(rank, name)| Look::Skill(rank, name)).collect();
    // A skill without its own colour belongs to the others, which come last.
    let last = looks.len() - 1;
    layer(classes, grid, maps, &looks, |step| dominant(maps, step, last))
}

/// Returns a group of squares, each with one of the looks, in the finest form that is short enough.
fn layer(
    classes: &str,
    grid: &Grid,
    maps: &LevelMaps,
    looks: &[Look],
    squares: impl Fn(u64) -> BTreeMap<(u64, u64), usize>,
) -> String {
    let drawn = |step| {
        let mut svg = format!("<g class=\"{classes}\">");
        let blocks = blocks(grid, maps, step, &squares(step), looks.len());
        for (look, blocks) in looks.iter().zip(blocks) {
            let path = path(&stacked(blocks));
            match look {
                Look::Strength(class, strength) => shape(class, Some(*strength), &path, &mut svg),
                Look::Skill(rank, name) if !path.is_empty() => {
                    let name = escape(name);
                    svg += &format!("<path class=\"skill{rank}\" d=\"{path}\"><title>{name}</title></path>");
                }
                Look::Skill(..) => {}
            }
        }
        svg + "</g>"
    };
    STEPS.into_iter().map(drawn).find(|svg| svg.len() <= MOST_BYTES).unwrap_or_default()
}

/// Returns the squares of each look; adjacent ones become one block.
fn blocks(
    grid: &Grid,
    maps: &LevelMaps,
    step: u64,
    squares: &BTreeMap<(u64, u64), usize>,
    looks: usize,
) -> Vec<Vec<Block>> {
    let mut runs: Vec<(u64, u64, u64, usize)> = Vec::new();
    for (&(row, column), &look) in squares {
        match runs.last_mut() {
            Some((last, _, end, same)) if *last == row && *end == column && *same == look => {
                *end = column.saturating_add(1);
            }
            _ => runs.push((row, column, column.saturating_add(1), look)),
        }
    }
    let mut blocks = vec![Vec::new(); looks];
    let corner = |column: u64, row: u64| {
        let place = Vec2::new(column.saturating_mul(step) as f32, row.saturating_mul(step) as f32);
        Vec2::new(maps.x, maps.y) + place * maps.side
    };
    for (row, begin, end, look) in runs {
        let block = grid.block(Rect::from_corners(corner(begin, row), corner(end, row.saturating_add(1))));
        if let Some(known) = blocks.get_mut(look) {
            known.extend(block);
        }
    }
    blocks
}

/// Returns row and column of a square among coarser ones.
fn place(maps: &LevelMaps, square: u64, step: u64) -> (u64, u64) {
    (square / maps.columns / step, square % maps.columns / step)
}

fn summed(maps: &LevelMaps, counts: &[[u64; 2]], step: u64) -> BTreeMap<(u64, u64), u64> {
    let mut sums: BTreeMap<(u64, u64), u64> = BTreeMap::new();
    for [square, count] in counts {
        let sum = sums.entry(place(maps, *square, step)).or_default();
        *sum = sum.saturating_add(*count);
    }
    sums
}

fn strong(sums: &BTreeMap<(u64, u64), u64>, strength: fn(u64, u64) -> usize) -> BTreeMap<(u64, u64), usize> {
    let most = sums.values().copied().max().unwrap_or(0);
    sums.iter().filter(|(_, count)| **count > 0).map(|(place, count)| (*place, strength(*count, most))).collect()
}

/// Returns a step from 0 to 3, one lower for each factor of four below `most`.
fn fourfold(count: u64, most: u64) -> usize {
    [4, 16, 64].into_iter().filter(|share| count.saturating_mul(*share) > most).count()
}

/// Returns the quarter of `most` that a count lies in, 0 to 3.
fn quarter(count: u64, most: u64) -> usize {
    (count.saturating_mul(4).div_ceil(most.max(1)).clamp(1, 4) - 1) as usize
}

/// Returns the skill that was active longest, by the ticks in each of the finer squares.
fn dominant(maps: &LevelMaps, step: u64, others: usize) -> BTreeMap<(u64, u64), usize> {
    let ticks: BTreeMap<u64, u64> = maps.visits.iter().map(|[square, ticks]| (*square, *ticks)).collect();
    let mut sums: BTreeMap<(u64, u64), BTreeMap<usize, u64>> = BTreeMap::new();
    for [square, skill] in &maps.skill_at {
        let rank = usize::try_from(*skill).unwrap_or(others).min(others);
        let sum = sums.entry(place(maps, *square, step)).or_default().entry(rank).or_default();
        *sum = sum.saturating_add(ticks.get(square).copied().unwrap_or(1));
    }
    let most = |ranks: BTreeMap<usize, u64>| ranks.into_iter().max_by_key(|(rank, ticks)| (*ticks, Reverse(*rank)));
    sums.into_iter().filter_map(|(place, ranks)| Some((place, most(ranks)?.0))).collect()
}

// Shapes of a floor on a grid of whole numbers, and SVG paths around them.

/// Units of the grid along the longer side of a floor.
const LENGTH: f32 = 640.0;

/// A floor on the grid: x to the right, y down.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    extent: Rect,
    scale: f32,
}

/// A rectangle on the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Block {
    pub left: i32,
    pub right: i32,
    pub top: i32,
    pub bottom: i32,
}

impl Grid {
    /// Makes a grid for this part of a floor; `None` for one without extent.
    pub fn new(extent: Rect) -> Option<Self> {
        let longer = extent.size().max_element();
        let is_there = extent.min.is_finite() && extent.max.is_finite() && longer.is_finite() && longer > 0.0;
        is_there.then(|| Self { extent, scale: LENGTH / longer })
    }

    /// Returns width and height.
    pub fn size(&self) -> [i32; 2] {
        let size = (self.extent.size() * self.scale).round().max(Vec2::ONE);
        [size.x as i32, size.y as i32]
    }

    /// Returns the grid point of a position; those beyond the floor are on its border. `None` if it is not finite.
    pub fn place(&self, at: Vec2) -> Option<[i32; 2]> {
        let at = at.is_finite().then(|| at.max(self.extent.min).min(self.extent.max))?;
        let Rect { min, max } = self.extent;
        let place = (Vec2::new(at.x - min.x, max.y - at.y) * self.scale).round();
        Some([place.x as i32, place.y as i32])
    }

    /// Returns the block of an area, at least one unit each way; `None` for areas beyond the floor.
    pub fn block(&self, area: Rect) -> Option<Block> {
        let seen = area.intersect(self.extent);
        if seen.is_empty() {
            return None;
        }
        let ([left, bottom], [right, top]) = (self.place(seen.min)?, self.place(seen.max)?);
        Some(Block { left, right: right.max(left + 1), top, bottom: bottom.max(top + 1) })
    }
}

/// Merges blocks of the same width that stand on each other.
pub(crate) fn stacked(mut blocks: Vec<Block>) -> Vec<Block> {
    blocks.sort_unstable();
    let mut joined: Vec<Block> = Vec::new();
    for block in blocks {
        match joined.last_mut() {
            Some(last) if (last.left, last.right) == (block.left, block.right) && block.top <= last.bottom => {
                last.bottom = last.bottom.max(block.bottom);
            }
            _ => joined.push(block),
        }
    }
    joined
}

/// Returns the path around blocks.
pub(crate) fn path(blocks: &[Block]) -> String {
    let mut path = String::new();
    for Block { left, right, top, bottom } in blocks {
        let (width, height) = (right - left, bottom - top);
        // Writing into a string cannot fail.
        let _ = write!(path, "M{left} {top}h{width}v{height}h-{width}z");
    }
    path
}

/// Adds a path in the colour of a class with this opacity; nothing for an empty path.
pub(crate) fn shape(class: &str, strength: Option<&str>, path: &str, svg: &mut String) {
    if path.is_empty() {
        return;
    }
    let opacity = strength.map_or_else(String::new, |strength| format!(" opacity=\"{strength}\""));
    let _ = write!(svg, "<path class=\"{class}\"{opacity} d=\"{path}\"/>");
}

/// Draws walls, platforms and hazards of a plan. Areas that are not finite are left out.
pub(crate) fn floor(plan: &FloorPlan, grid: &Grid, svg: &mut String) {
    for (class, areas) in [("wall", &plan.walls), ("platform", &plan.platforms), ("hazard", &plan.hazards)] {
        let finite = areas.iter().filter(|area| area.min.is_finite() && area.max.is_finite());
        shape(class, None, &path(&stacked(finite.filter_map(|area| grid.block(*area)).collect())), svg);
    }
}

/// Draws start and goal of a plan, which lie above all else.
pub(crate) fn start_and_goal(plan: &FloorPlan, grid: &Grid, svg: &mut String) {
    if let Some([x, y]) = grid.place(plan.start) {
        let _ = write!(svg, "<circle class=\"start\" cx=\"{x}\" cy=\"{y}\" r=\"7\"/>");
    }
    if let Some([x, y]) = grid.place(plan.goal) {
        shape("goal", None, &format!("M{x} {}l9 9l-9 9l-9-9z", y - 9), svg);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::SkillTicks;

    fn maps() -> LevelMaps {
        let skill = |name: &str| SkillTicks { skill: name.to_owned(), ticks: 9 };
        LevelMaps {
            side: 2.0,
            columns: 32,
            rows: 8,
            visits: vec![[33, 100], [34, 100], [35, 1], [66, 20]],
            lost: vec![[34, 40], [35, 1]],
            skills: ["z1+", "z2-", "a", "b", "<i>", "c"].map(skill).to_vec(),
            skill_at: vec![[33, 0], [34, 5], [35, 4], [66, 1]],
            ..LevelMaps::default()
        }
    }

    fn grid() -> Grid {
        Grid::new(Rect::new(0.0, 0.0, 64.0, 16.0)).expect("it has an extent")
    }

    #[test]
    fn squares_are_stronger_where_agents_were_more_often() {
        let svg = layers(&grid(), &maps());
        // Squares 33 and 34 side by side, in the second row from below: a unit is 10 of the grid, a square 20.
        let often = "<g class=\"map visits\"><path class=\"visit\" opacity=\".25\" d=\"M60 120h20v20h-20z\"/>\
                     <path class=\"visit\" opacity=\".65\" d=\"M40 100h20v20h-20z\"/>\
                     <path class=\"visit\" opacity=\".85\" d=\"M20 120h40v20h-40z\"/></g>";
        assert!(svg.starts_with(often), "{svg}");
        assert!(svg.contains("<path class=\"waste\" opacity=\".85\" d=\"M40 120h20v20h-20z\"/>"), "{svg}");
        assert!(svg.contains("<path class=\"waste\" opacity=\".25\" d=\"M60 120h20v20h-20z\"/>"), "{svg}");
    }

    #[test]
    fn skills_have_their_names_and_the_rare_ones_share_a_colour() {
        let svg = layers(&grid(), &maps());
        for part in [
            "<path class=\"skill0\" d=\"M20 120h20v20h-20z\"><title>z1+</title></path>",
            "<path class=\"skill1\" d=\"M40 100h20v20h-20z\"><title>z2-</title></path>",
            "<path class=\"skill4\" d=\"M40 120h40v20h-40z\"><title>other skills</title></path>",
        ] {
            assert!(svg.contains(part), "{part} in {svg}");
        }
        assert!(!svg.contains("<i>"), "{svg}");
    }

    #[test]
    fn long_layers_become_coarser() {
        let noise = |square: u64| [square, 1 + square * square * 7919 % 997];
        let full = LevelMaps { side: 1.0, columns: 64, rows: 16, visits: (0..1024).map(noise).collect(), ..maps() };
        let svg = layers(&grid(), &full);
        let visits = svg.split("</g>").next().expect("the first layer");
        assert!(visits.len() <= MOST_BYTES && visits.contains("visit\" opacity"), "{} bytes", visits.len());
        assert_eq!(layers(&grid(), &LevelMaps::default()), "");
    }

    #[test]
    fn blocks_lie_on_whole_numbers_with_the_lowest_below() {
        let grid = Grid::new(Rect::new(-2.0, 0.0, 62.0, 32.0)).expect("it has an extent");
        assert_eq!(grid.size(), [640, 320]);
        assert_eq!(grid.place(Vec2::new(-2.0, 32.0)), Some([0, 0]));
        assert_eq!(grid.place(Vec2::new(1e30, -7.0)), Some([640, 320]));
        assert_eq!(grid.place(Vec2::new(f32::NAN, 0.0)), None);
        let floor = grid.block(Rect::new(-9.0, 0.0, 0.0, 1.0)).expect("it is seen");
        assert_eq!(floor, Block { left: 0, right: 20, top: 310, bottom: 320 });
        assert_eq!(path(&[floor]), "M0 310h20v10h-20z");
        assert_eq!(grid.block(Rect::new(70.0, 0.0, 80.0, 1.0)), None);
        assert!(grid.block(Rect::new(3.0, 3.0, 3.001, 3.001)).is_some_and(|dot| dot.right - dot.left == 1));
        for extent in [Rect::default(), Rect::new(0.0, 0.0, f32::INFINITY, 1.0)] {
            assert!(Grid::new(extent).is_none(), "{extent:?}");
        }
    }

    #[test]
    fn a_wall_of_many_rows_is_one_block() {
        let block = |left, top| Block { left, right: left + 10, top, bottom: top + 10 };
        let joined = stacked(vec![block(0, 20), block(0, 0), block(0, 10), block(10, 0), block(0, 40)]);
        assert_eq!(joined, [Block { bottom: 30, ..block(0, 0) }, block(0, 40), block(10, 0)]);
    }
}
