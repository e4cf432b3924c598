//! Positions of an agent in an episode, counted tick by tick.

use crate::explore::{CellGrid, ExploredCell, cells_between, reach, round::open_cells};
use bevy::{math::Vec2, prelude::*};
use bevy_playbot::{
    episode::Episode,
    skill_prior::{ActiveSkill, NamedSkill},
};
use playbot_harness::{floor_plan::FloorPlan, game::Game};
use std::{collections::BTreeSet, fmt};

/// Seconds without a square that is new in the episode, after which time counts as lost.
const PATIENCE: f64 = 2.0;

/// Largest number of squares of a path that are kept: the last ones.
const MOST_STEPS: usize = 200;

/// Largest number of axes with a name: further ones are left out.
const MOST_NUMBERS: usize = 16;

/// Squares of an agent's walk.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Walk {
    /// The squares of the level.
    pub squares: LevelSquares,
    /// The visited squares, in their order.
    pub counts: Vec<SquareCount>,
    /// The end of its path: squares in order, with the ticks spent in each.
    pub trail: Vec<[u64; 2]>,
}

/// Counts of a square.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SquareCount {
    pub square: usize,
    /// Ticks; one for a square that was only passed between two of them.
    pub ticks: u32,
    /// Ticks that were lost.
    pub lost: u32,
    /// Ticks under each skill that was active there, by its number: see [`SkillName::of`].
    pub skills: Vec<(usize, u32)>,
}

/// Counts for one agent, episode after episode, in reused memory.
pub(super) struct WalkCounter {
    agent: Entity,
    /// Named regions of its skills.
    regions: Vec<NamedSkill>,
    /// Ticks after which time is lost.
    patience: u32,
    /// The present level, and its squares.
    level: Option<(u64, Option<LevelSquares>)>,
    /// The floor plan of the level, until its open squares are computed.
    plan: Option<FloorPlan>,
    /// The level's open squares, computed when a square is first passed.
    open: Option<BTreeSet<usize>>,
    /// Position of the agent after the last tick of this episode.
    last: Option<Vec2>,
    /// Ticks of each square.
    ticks: Vec<u32>,
    lost: Vec<u32>,
    /// Ticks of each square and each name of a skill.
    skills: Vec<u32>,
    names: usize,
    /// Squares that were visited in this episode.
    visited: Vec<usize>,
    /// Ticks since the last of these was new.
    since_new: u32,
    trail: Vec<[u64; 2]>,
}

impl WalkCounter {
    /// Makes a counter for an agent of a game with so many ticks per second, and with these named regions of its skills.
    pub fn new(agent: Entity, tick_hz: f64, regions: Vec<NamedSkill>) -> Self {
        Self {
            agent,
            regions,
            patience: (PATIENCE * tick_hz).ceil() as u32,
            level: None,
            plan: None,
            open: None,
            last: None,
            ticks: Vec::new(),
            lost: Vec::new(),
            skills: Vec::new(),
            names: 0,
            visited: Vec::new(),
            since_new: 0,
            trail: Vec::new(),
        }
    }

    /// Counts the tick that was just played; `has_ended` if it was the last one of an episode.
    pub fn tick(&mut self, game: &dyn Game, mode: &str, world: &World, has_ended: bool) {
        let Some(episode) = world.get::<Episode>(self.agent) else { return };
        if episode.tick == 0 || !(episode.is_running() || has_ended) {
            return;
        }
        if self.level.is_none_or(|(level, _)| level != episode.level) {
            (self.plan, self.open) = (game.tools().levels.floor_plan(mode, episode.level), None);
            self.level = Some((episode.level, self.plan.as_ref().and_then(LevelSquares::of)));
        }
        let Some((_, Some(squares))) = self.level else { return };
        let before = self.last.take().filter(|_| episode.tick > 1);
        let Some(position) = game.tools().state.position(world, self.agent) else { return };
        let Some(square) = squares.at(position) else { return };
        let skill = world.get::<ActiveSkill>(self.agent);
        let z = skill.map_or(&[][..], |skill| skill.z.as_slice());
        if let Some(before) = before.filter(|before| squares.between(*before, position).next().is_some()) {
            if self.open.is_none() {
                self.open = Some(self.plan.take().and_then(|plan| squares.open(&plan)).unwrap_or_default());
            }
            self.pass(squares, before, position, z);
        }
        self.count(squares.count(), square, z);
        self.last = Some(position);
    }

    /// Counts the open squares that were passed between two positions, as one tick each if they are new in the
    /// episode. At least one tick has been counted before.
    fn pass(&mut self, squares: LevelSquares, from: Vec2, to: Vec2, z: &[f32]) {
        let Some(open) = &self.open else { return };
        for square in squares.between(from, to).filter(|square| open.contains(square)) {
            if self.ticks[square] > 0 {
                continue;
            }
            self.visited.push(square);
            self.since_new = 0;
            self.ticks[square] = 1;
            if let Some(skill) = skill_number(&self.regions, z).filter(|skill| *skill < self.names) {
                self.skills[square * self.names + skill] += 1;
            }
        }
    }

    /// Counts a tick in one of so many squares, under a skill, which may be empty.
    fn count(&mut self, squares: usize, square: usize, z: &[f32]) {
        if self.visited.is_empty() {
            self.names = skill_count(&self.regions, z);
            self.since_new = 0;
            grow(&mut self.ticks, squares);
            grow(&mut self.lost, squares);
            grow(&mut self.skills, squares * self.names);
        }
        if self.ticks[square] == 0 {
            self.visited.push(square);
            self.since_new = 0;
        } else {
            self.since_new = self.since_new.saturating_add(1);
        }
        self.ticks[square] += 1;
        if self.since_new > self.patience {
            self.lost[square] += 1;
        }
        if let Some(skill) = skill_number(&self.regions, z).filter(|skill| *skill < self.names) {
            self.skills[square * self.names + skill] += 1;
        }
        match self.trail.last_mut() {
            Some([last, ticks]) if *last == square as u64 => *ticks += 1,
            _ => {
                if self.trail.len() >= 2 * MOST_STEPS {
                    self.trail.drain(..MOST_STEPS);
                }
                self.trail.push([square as u64, 1]);
            }
        }
    }

    /// Returns the counts of the episode, which is over, and resets them; `None` if the game does not report
    /// positions.
    pub fn take(&mut self) -> Option<Walk> {
        self.last = None;
        let (_, squares) = self.level?;
        let squares = squares?;
        self.visited.sort_unstable();
        let mut counts = Vec::with_capacity(self.visited.len());
        for square in self.visited.drain(..) {
            let mut skills = Vec::new();
            let own = square * self.names..(square + 1) * self.names;
            for (skill, ticks) in self.skills[own].iter_mut().enumerate().filter(|(_, ticks)| **ticks > 0) {
                skills.push((skill, std::mem::take(ticks)));
            }
            let (ticks, lost) = (std::mem::take(&mut self.ticks[square]), std::mem::take(&mut self.lost[square]));
            counts.push(SquareCount { square, ticks, lost, skills });
        }
        let mut trail = std::mem::take(&mut self.trail);
        trail.drain(..trail.len().saturating_sub(MOST_STEPS));
        (!counts.is_empty()).then_some(Walk { squares, counts, trail })
    }
}

/// Makes room for so many counters.
fn grow(counters: &mut Vec<u32>, wanted: usize) {
    if counters.len() < wanted {
        counters.resize(wanted, 0);
    }
}

/// Most squares along the longer side of a level.
const MOST: f32 = 64.0;

/// Part of a square by which a level may be longer than its squares, through rounding.
const SLACK: f32 = 1e-3;

/// The squares of a level: its own tiles, or several of them in larger levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LevelSquares {
    pub grid: CellGrid,
    pub columns: usize,
    pub rows: usize,
    /// Largest distance of an agent's step in a tick.
    reach: f32,
}

impl LevelSquares {
    /// Returns the squares of a level; `None` for one without extent.
    pub fn of(plan: &FloorPlan) -> Option<Self> {
        let size = plan.bounds.size();
        if !(plan.bounds.min.is_finite() && size.is_finite() && size.min_element() > 0.0) {
            return None;
        }
        let tile = CellGrid::new(Some(plan), None).size;
        let side = tile * (size.max_element() / (tile * MOST) - SLACK).ceil().max(1.0);
        if !side.is_finite() {
            return None;
        }
        let count = (size / side - SLACK).ceil().max(Vec2::ONE);
        let grid = CellGrid::new(Some(plan), Some(side));
        Some(Self { grid, columns: count.x as usize, rows: count.y as usize, reach: reach(tile) })
    }

    /// Returns the number of squares.
    pub fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns the square around a position, counted row by row from below; `None` outside the level.
    pub fn at(&self, position: Vec2) -> Option<usize> {
        let at = (position - self.grid.origin) / self.grid.size;
        // Positions that are not numbers count as outside.
        let is_inside = at.x >= 0.0 && at.y >= 0.0 && at.x < self.columns as f32 && at.y < self.rows as f32;
        is_inside.then(|| at.y as usize * self.columns + at.x as usize)
    }

    /// Returns the square around a position, or the nearest one for a position outside the level; `None` for one that is
    /// not finite.
    pub fn nearest(&self, position: Vec2) -> Option<usize> {
        let at = ((position - self.grid.origin) / self.grid.size).floor();
        let last = Vec2::new(self.columns as f32, self.rows as f32) - 1.0;
        let at = at.max(Vec2::ZERO).min(last);
        position.is_finite().then(|| at.y as usize * self.columns + at.x as usize)
    }

    /// Returns the squares between two positions of an agent in consecutive ticks; no squares if it has been put
    /// there.
    pub fn between(self, from: Vec2, to: Vec2) -> impl Iterator<Item = usize> {
        cells_between(self.grid, from, to, self.reach).filter_map(move |cell| self.index(cell))
    }

    /// Returns the squares that walls do not cut off from the start, if the plan has a start.
    pub fn open(&self, plan: &FloorPlan) -> Option<BTreeSet<usize>> {
        let cells = open_cells(plan, &self.grid)?;
        Some(cells.iter().filter_map(|cell| self.of_cell(cell)).collect())
    }

    fn of_cell(&self, cell: &ExploredCell) -> Option<usize> {
        let &[column, row] = cell.0.as_slice() else { return None };
        self.index([column, row])
    }

    fn index(&self, [column, row]: [i32; 2]) -> Option<usize> {
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }
}

// Names of skills that are points of a continuous space.

/// Name of a skill in results.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum SkillName {
    /// The name that somebody gave to a region of skills.
    Region(String),
    /// A direction: twice the number of z that is furthest from 0, counted from 0, and one more if that is negative.
    Direction(usize),
}

impl SkillName {
    /// Returns the name with a number in a walk: the regions come first, and then the directions.
    pub fn of(regions: &[NamedSkill], number: usize) -> Self {
        match regions.get(number) {
            Some(region) => Self::Region(region.name.clone()),
            None => Self::Direction(number - regions.len()),
        }
    }
}

impl fmt::Display for SkillName {
    /// Writes a direction as `z3+` if the third number is furthest from 0, and is positive.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Region(name) => f.write_str(name),
            Self::Direction(number) => {
                write!(f, "z{}{}", number / 2 + 1, if number.is_multiple_of(2) { '+' } else { '-' })
            }
        }
    }
}

/// Returns the number of names for skills of this length; 0 without a skill.
fn skill_count(regions: &[NamedSkill], z: &[f32]) -> usize {
    if z.is_empty() { 0 } else { regions.len() + 2 * z.len().min(MOST_NUMBERS) }
}

/// Returns the number of a skill's name, below [`skill_count`].
///
/// A skill in a named region has that name. Any other is named after the nearest of several fixed directions: the positive
/// and the negative half of each axis of z. That is the number of z that is furthest from 0, and its sign; of equally large
/// numbers the first counts. So a name is independent of levels and draws, and is the same in every test of a policy.
fn skill_number(regions: &[NamedSkill], z: &[f32]) -> Option<usize> {
    if let Some(name) = NamedSkill::name_of(regions, z) {
        return regions.iter().position(|region| region.name == name);
    }
    let mut nearest: Option<(usize, f32)> = None;
    for (number, value) in z.iter().take(MOST_NUMBERS).enumerate() {
        if nearest.is_none_or(|(_, longest)| value.abs() > longest.abs()) {
            nearest = Some((number, *value));
        }
    }
    nearest.map(|(number, value)| regions.len() + 2 * number + usize::from(value < 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::math::Rect;
    use playbot_harness::floor_plan::FloorPlan;

    /// Makes a counter for ten squares in a row whose patience is four ticks.
    fn counter() -> WalkCounter {
        let plan = FloorPlan { bounds: Rect::new(0.0, 0.0, 16.0, 1.0), ..FloorPlan::default() };
        let squares = LevelSquares::of(&plan).expect("it has an extent");
        WalkCounter { level: Some((7, Some(squares))), ..WalkCounter::new(Entity::PLACEHOLDER, 2.0, Vec::new()) }
    }

    fn walked(counter: &mut WalkCounter, squares: &[usize], z: &[f32]) -> Walk {
        squares.iter().for_each(|square| counter.count(16, *square, z));
        counter.take().expect("it went somewhere")
    }

    fn lost(walk: &Walk) -> Vec<(usize, u32, u32)> {
        walk.counts.iter().map(|count| (count.square, count.ticks, count.lost)).collect()
    }

    #[test]
    fn time_is_lost_two_seconds_after_the_last_new_square() {
        let mut counter = counter();
        // Rests: of the six ticks after the first one in square 3, the last two are lost.
        let resting = walked(&mut counter, &[2, 3, 3, 3, 3, 3, 3, 3, 4], &[]);
        assert_eq!(lost(&resting), [(2, 1, 0), (3, 7, 2), (4, 1, 0)]);
        // Goes back and forth.
        let turning = walked(&mut counter, &[0, 1, 0, 1, 0, 1, 0, 1], &[]);
        assert_eq!(lost(&turning), [(0, 4, 1), (1, 4, 1)]);
        assert_eq!(turning.trail.len(), 8);
        let walking = walked(&mut counter, &[0, 1, 2, 3, 4, 5, 6, 7], &[]);
        assert!(walking.counts.iter().all(|count| count.lost == 0 && count.ticks == 1), "{walking:?}");
        assert_eq!(counter.take(), None, "nothing is left of earlier episodes");
    }

    #[test]
    fn skills_are_counted_where_they_are_active() {
        let mut counter = counter();
        counter.count(16, 5, &[0.1, -2.0]);
        counter.count(16, 5, &[0.1, -2.0]);
        counter.count(16, 5, &[1.0, 0.0]);
        let walk = walked(&mut counter, &[6], &[-1.0, 0.0]);
        assert_eq!(walk.counts[0].skills, [(0, 1), (3, 2)]);
        assert_eq!(walk.counts[1].skills, [(1, 1)]);
        let without = walked(&mut counter, &[5, 6], &[]);
        assert!(without.counts.iter().all(|count| count.skills.is_empty()), "{without:?}");
    }

    #[test]
    fn open_squares_between_two_ticks_are_passed() {
        let mut counter = counter();
        let (_, squares) = counter.level.expect("a level");
        let squares = squares.expect("it has an extent");
        counter.open = Some(BTreeSet::from([0, 1, 2, 4, 5]));
        let position = |square: usize| Vec2::new(square as f32 + 0.5, 0.5);
        for (from, to) in [(0, 0), (0, 4), (4, 0), (0, 5)] {
            counter.pass(squares, position(from), position(to), &[0.1, -2.0]);
            counter.count(16, to, &[0.1, -2.0]);
        }
        let walk = counter.take().expect("it went somewhere");
        // Square 3 is closed, and the last leap is too far for an agent: it has been put there.
        assert_eq!(lost(&walk), [(0, 2, 0), (1, 1, 0), (2, 1, 0), (4, 1, 0), (5, 1, 0)]);
        assert!(walk.counts.iter().all(|count| count.skills == [(3, count.ticks)]), "{walk:?}");
        assert_eq!(walk.trail, [[0, 1], [4, 1], [0, 1], [5, 1]]);
    }

    #[test]
    fn of_a_long_way_the_end_is_kept() {
        let mut counter = counter();
        let squares: Vec<usize> = (0..1_000).map(|tick| tick / 2 % 16).collect();
        let walk = walked(&mut counter, &squares, &[]);
        assert_eq!(walk.trail.len(), MOST_STEPS);
        // The last pair of ticks is number 499.
        assert_eq!(walk.trail.last(), Some(&[499 % 16, 2]));
        assert_eq!(walk.counts.iter().map(|count| count.ticks).sum::<u32>(), 1_000);
    }

    fn plan(width: f32, height: f32, tile: f32) -> FloorPlan {
        FloorPlan {
            bounds: Rect::new(-1.0, 2.0, width - 1.0, height + 2.0),
            walls: vec![Rect::new(1.0, 2.0, 1.0 + tile, height + 2.0)],
            start: Vec2::new(-0.5, 2.5),
            ..FloorPlan::default()
        }
    }

    #[test]
    fn squares_are_tiles_counted_from_below() {
        let squares = LevelSquares::of(&plan(4.0, 3.0, 1.0)).expect("it has an extent");
        assert_eq!((squares.columns, squares.rows, squares.grid.size, squares.count()), (4, 3, 1.0, 12));
        assert_eq!(squares.at(Vec2::new(-0.9, 2.1)), Some(0));
        assert_eq!(squares.at(Vec2::new(2.5, 4.5)), Some(2 * 4 + 3));
        for outside in [Vec2::new(-1.1, 2.5), Vec2::new(3.1, 2.5), Vec2::new(0.0, 5.0), Vec2::NAN] {
            assert_eq!(squares.at(outside), None, "{outside}");
        }
        let nearest = [Vec2::new(-9.0, -9.0), Vec2::new(1e30, 3.5), Vec2::new(2.5, 4.5)];
        assert_eq!(nearest.map(|at| squares.nearest(at)), [Some(0), Some(7), Some(11)]);
        assert_eq!(squares.nearest(Vec2::NAN), None);
        let passed = |to| squares.between(Vec2::new(-0.5, 2.5), to).collect::<Vec<_>>();
        assert_eq!(passed(Vec2::new(2.5, 2.5)), [1, 2]);
        assert!(passed(Vec2::new(3.75, 4.5)).is_empty(), "farther than four tiles");
        // The wall in the third column cuts the fourth off.
        let open = squares.open(&plan(4.0, 3.0, 1.0)).expect("the start is free");
        assert_eq!(open.into_iter().collect::<Vec<_>>(), [0, 1, 4, 5, 8, 9]);
    }

    #[test]
    fn large_levels_have_coarser_squares_and_flat_ones_none() {
        let squares = LevelSquares::of(&plan(640.0, 30.0, 1.0)).expect("it has an extent");
        assert_eq!((squares.columns, squares.rows, squares.grid.size), (64, 3, 10.0));
        assert_eq!(LevelSquares::of(&plan(0.0, 3.0, 1.0)), None);
        assert_eq!(LevelSquares::of(&plan(f32::NAN, 3.0, 1.0)), None);
    }

    #[test]
    fn a_skill_is_called_by_its_number_furthest_from_zero() {
        let name = |z: &[f32]| skill_number(&[], z).map(|number| SkillName::of(&[], number).to_string());
        assert_eq!(name(&[0.1, -0.2, 1.5]).as_deref(), Some("z3+"));
        assert_eq!(name(&[0.1, -2.0, 1.5]).as_deref(), Some("z2-"));
        assert_eq!(name(&[1.0, -1.0]).as_deref(), Some("z1+"));
        assert_eq!(name(&[]), None);
        let mut long = [0.5; 40];
        long[30] = 9.0;
        assert_eq!((name(&long).as_deref(), skill_count(&[], &long)), (Some("z1+"), 32));
        assert_eq!((skill_count(&[], &[0.0; 3]), skill_count(&[], &[])), (6, 0));
    }

    #[test]
    fn a_skill_in_a_named_region_has_the_name_of_the_region() {
        let region = |name: &str, z: [f32; 2]| NamedSkill { name: name.to_owned(), z: z.to_vec(), radius: 0.5 };
        let regions = vec![region("jump", [0.0, 1.0]), region("walk", [1.0, 0.0])];
        let name = |z: &[f32]| SkillName::of(&regions, skill_number(&regions, z).expect("a skill")).to_string();
        assert_eq!([name(&[0.2, 0.9]), name(&[0.8, 0.1]), name(&[0.0, -0.9])], ["jump", "walk", "z2-"]);
        let mut counter = WalkCounter { regions: regions.clone(), ..counter() };
        counter.count(16, 3, &[0.9, 0.0]);
        counter.count(16, 3, &[-0.9, 0.0]);
        counter.count(16, 4, &[0.9, 0.0]);
        let walk = counter.take().expect("it went somewhere");
        let names = |place: usize| {
            let skills = &walk.counts[place].skills;
            skills
                .iter()
                .map(|(skill, ticks)| (SkillName::of(&regions, *skill).to_string(), *ticks))
                .collect::<Vec<_>>()
        };
        assert_eq!(names(0), [("walk".to_owned(), 1), ("z1-".to_owned(), 1)]);
        assert_eq!(names(1), [("walk".to_owned(), 1)]);
    }
}
