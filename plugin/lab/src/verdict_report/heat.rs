//! Maps of a level as coloured squares over its plan: visits, lost time, and skills.

use std::{cmp::Reverse, collections::BTreeMap};

use bevy::math::{Rect, Vec2};

use super::shapes::{Block, Grid, path, shape, stacked};
use crate::{escape::escape, verdict::LevelMaps};

/// Largest size of a layer, bytes: a page has up to 200 pictures with three of them.
const MOST_BYTES: usize = 2_500;
/// Squares along each side that become one if a layer would be too large.
const STEPS: [u64; 4] = [1, 2, 4, 8];
/// Opacities of squares.
const STRENGTHS: [&str; 4] = [".25", ".45", ".65", ".85"];
/// Skills with a colour of their own; all others share one.
pub const SKILL_COLOURS: usize = 4;

/// Look of squares: a class with its opacity, or a skill with its name.
enum Look<'a> {
    Strength(&'static str, &'static str),
    Skill(usize, &'a str),
}

/// Returns the layers of a level's maps, each in a group; the page shows one group at a time.
pub fn layers(grid: &Grid, maps: &LevelMaps) -> String {
    if maps.columns == 0 {
        return String::new();
    }
    let of = |class| STRENGTHS.map(|strength| Look::Strength(class, strength));
    let visits = layer("visits", grid, maps, &of("visit"), |step| strong(&summed(maps, &maps.visits, step), fourfold));
    let lost = layer("lost-time", grid, maps, &of("waste"), |step| strong(&summed(maps, &maps.lost, step), quarter));
    let names = maps.skills.iter().take(SKILL_COLOURS).map(|known| known.skill.as_str()).chain(["other skills"]);
    let looks: Vec<Look> = names.enumerate().map(|(rank, name)| Look::Skill(rank, name)).collect();
    // A skill without its own colour belongs to the others, which come last.
    let last = looks.len() - 1;
    let skills = layer("skills", grid, maps, &looks, |step| dominant(maps, step, last));
    visits + &lost + &skills
}

/// Returns a group of squares, each with one of the looks, in the finest form that is short enough.
fn layer(
    class: &str,
    grid: &Grid,
    maps: &LevelMaps,
    looks: &[Look],
    squares: impl Fn(u64) -> BTreeMap<(u64, u64), usize>,
) -> String {
    let drawn = |step| {
        let mut svg = format!("<g class=\"map {class}\">");
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
}
