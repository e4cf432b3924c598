//! Detectors of wrong positions: agents that cannot move, that leave their level, fall for ever, get into walls or are
//! flung away.

use crate::{detectors::Efforts, explore::CellGrid};
use bevy::{
    math::{Rect, Vec2, Vec3},
    prelude::Transform,
};
use playbot_harness::{
    detector::{Detector, DetectorSetting, DetectorTick, EpisodeWatcher, LeastEpisode, LevelAhead},
    floor_plan::FloorPlan,
};

/// Returns the shortest episode for a window of so many ticks by positions: a tick is compared with the one before.
fn after_the_first(ticks: f64) -> LeastEpisode {
    LeastEpisode { needs_position: true, ..LeastEpisode::of_ticks((ticks as u32).saturating_add(1)) }
}

/// Returns the setting of a window of half these ticks.
pub(super) fn half(ticks: u32) -> Option<String> {
    (ticks > 1).then(|| format!("ticks={}", ticks / 2))
}

/// A finding for agents that stay at one position for any action, away from the goal. An agent that wanders without
/// progress, or holds a key against a wall, is not stuck.
pub struct Stuck {
    ticks: f64,
    distance: f64,
}

impl Default for Stuck {
    fn default() -> Self {
        Self { ticks: 300.0, distance: 0.01 }
    }
}

/// Distance from the goal within which an agent may rest, in tiles.
const AT_GOAL: f32 = 2.0;

struct Staying {
    ticks: u32,
    distance: f32,
    goal: Option<(Vec2, f32)>,
    anchor: Option<Vec2>,
    stayed: u32,
    efforts: Efforts,
}

impl Detector for Stuck {
    fn name(&self) -> &'static str {
        "stuck"
    }

    fn describe(&self) -> &'static str {
        "the agent cannot leave its position, whatever it does"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("ticks", &mut self.ticks, "ticks in a row at the same position").at_least(1.0),
            DetectorSetting::new("distance", &mut self.distance, "how far the same position reaches, in tiles"),
        ]
    }

    fn least_episode(&self) -> LeastEpisode {
        after_the_first(self.ticks)
    }

    fn setting_for(&self, ticks: u32) -> Option<String> {
        half(ticks)
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let size = CellGrid::new(level.plan.as_ref(), None).size;
        let goal = level.plan.as_ref().map(|plan| (plan.goal, AT_GOAL * size));
        let (ticks, distance) = (self.ticks as u32, self.distance as f32 * size);
        Some(Box::new(Staying { ticks, distance, goal, anchor: None, stayed: 0, efforts: Efforts::default() }))
    }
}

impl EpisodeWatcher for Staying {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let position = moment.position.filter(|position| position.is_finite())?;
        self.efforts.note(moment.action);
        let is_at_goal = self.goal.is_some_and(|(goal, near)| position.distance(goal) <= near);
        let has_moved = self.anchor.is_none_or(|anchor| position.distance(anchor) > self.distance);
        if has_moved || is_at_goal || moment.is_success {
            (self.anchor, self.stayed) = (Some(position), 0);
            self.efforts.restart();
            return None;
        }
        self.stayed += 1;
        (self.stayed >= self.ticks && self.efforts.are_many(self.stayed)).then(|| {
            format!(
                "the agent has not left {:.1}, {:.1} for {} ticks, whatever it did",
                position.x, position.y, self.stayed
            )
        })
    }
}

/// A finding for agents outside the plan of their level. Levels without walls have no outside, and are skipped.
pub struct OutOfBounds {
    margin: f64,
}

impl Default for OutOfBounds {
    fn default() -> Self {
        // More than any jump over the edge of a platformer's plan.
        Self { margin: 8.0 }
    }
}

struct Inside(Rect);

impl Detector for OutOfBounds {
    fn name(&self) -> &'static str {
        "out-of-bounds"
    }

    fn describe(&self) -> &'static str {
        "the agent is outside its level"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![DetectorSetting::new("margin", &mut self.margin, "tiles around the level that still belong to it")]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let plan = level.plan.as_ref().filter(|plan| !plan.walls.is_empty())?;
        let margin = self.margin as f32 * CellGrid::new(Some(plan), None).size;
        Some(Box::new(Inside(plan.bounds.inflate(margin))))
    }
}

impl EpisodeWatcher for Inside {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let position = moment.position.filter(|position| position.is_finite() && !self.0.contains(*position))?;
        Some(format!("the agent is at {:.1}, {:.1}, outside the level", position.x, position.y))
    }
}

/// A finding for agents that fall with nothing left below them. A plan seen from above says nothing of heights.
pub struct FellThrough {
    ticks: f64,
    depth: f64,
}

impl Default for FellThrough {
    fn default() -> Self {
        Self { ticks: 60.0, depth: 10_000.0 }
    }
}

struct Falling {
    ticks: u32,
    /// The lowest point of the level; unknown before the first tick in a level without a plan.
    lowest: Option<f32>,
    depth: f32,
    /// True if the level's plan is seen from above.
    is_above: bool,
    last: f32,
    fallen: u32,
}

impl Detector for FellThrough {
    fn name(&self) -> &'static str {
        "fell-through"
    }

    fn describe(&self) -> &'static str {
        "the agent falls and nothing is below it any more"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("ticks", &mut self.ticks, "ticks in a row in which it falls").at_least(1.0),
            DetectorSetting::new(
                "depth",
                &mut self.depth,
                "how far below its start, in the game's units, without a plan from the side",
            ),
        ]
    }

    fn least_episode(&self) -> LeastEpisode {
        after_the_first(self.ticks)
    }

    fn setting_for(&self, ticks: u32) -> Option<String> {
        half(ticks)
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let plan = level.plan.as_ref().filter(|plan| !plan.walls.is_empty());
        let lowest = plan.map(|plan| plan.bounds.min.y);
        let (ticks, depth) = (self.ticks as u32, self.depth as f32);
        Some(Box::new(Falling { ticks, lowest, depth, is_above: false, last: f32::NEG_INFINITY, fallen: 0 }))
    }
}

impl EpisodeWatcher for Falling {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let height = moment.height()?;
        if moment.height.is_some() && !self.is_above {
            (self.is_above, self.lowest) = (true, None);
        }
        let lowest = *self.lowest.get_or_insert(height - self.depth);
        self.fallen = if height < self.last { self.fallen + 1 } else { 0 };
        self.last = height;
        (self.fallen >= self.ticks && height < lowest)
            .then(|| format!("the agent has fallen for {} ticks, down to {height:.1}, below the level", self.fallen))
    }
}

/// A finding for agents deep inside a wall of their level's plan, on all sides.
///
/// Bodies are round or have corners, sink in a little, and may hang over a ledge that is thinner than they are. A game
/// without such bodies declares [its own depth](Self::deeper_than).
pub struct ThroughWall {
    depth: f64,
}

impl Default for ThroughWall {
    fn default() -> Self {
        // More than half a tile: a body that hangs over a ledge of one tile is not inside it.
        Self { depth: 0.75 }
    }
}

impl ThroughWall {
    /// Creates the detector for [a game's own detectors](playbot_harness::game::TestTools::detectors): agents are never
    /// this deep inside a wall, in tiles.
    pub fn deeper_than(depth: f64) -> Self {
        Self { depth }
    }
}

struct InsideWall {
    solid: SolidTiles,
    depth: f32,
}

impl Detector for ThroughWall {
    fn name(&self) -> &'static str {
        "through-wall"
    }

    fn describe(&self) -> &'static str {
        "the agent is deep inside a wall"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![DetectorSetting::new(
            "depth",
            &mut self.depth,
            "wall on all sides of the agent that is too much, in tiles",
        )]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let solid = SolidTiles::of(level.plan.as_ref()?)?;
        Some(Box::new(InsideWall { solid, depth: self.depth as f32 }))
    }
}

impl EpisodeWatcher for InsideWall {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let position = moment.position?;
        let is_deep = self.solid.surround(position, self.depth);
        is_deep.then(|| format!("the agent is at {:.1}, {:.1}, deep inside a wall", position.x, position.y))
    }
}

/// A finding for agents that move farther in one tick than physics allows. It is opt-in, because portals do that on
/// purpose.
pub struct PhysicsExplosion {
    share: f64,
    distance: f64,
}

impl Default for PhysicsExplosion {
    fn default() -> Self {
        Self { share: 0.5, distance: 1000.0 }
    }
}

struct Leaping {
    most: f32,
    last: Option<Vec3>,
}

impl Detector for PhysicsExplosion {
    fn name(&self) -> &'static str {
        "physics-explosion"
    }

    fn describe(&self) -> &'static str {
        "the agent is flung through half its level in one tick"
    }

    fn is_default(&self) -> bool {
        false
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new(
                "share",
                &mut self.share,
                "share of the level's longer side that is too far for one tick",
            ),
            DetectorSetting::new(
                "distance",
                &mut self.distance,
                "the same in the game's units, for levels without a plan",
            ),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let side = |plan: &FloorPlan| self.share as f32 * plan.bounds.size().max_element();
        let most = level.plan.as_ref().map_or(self.distance as f32, side);
        Some(Box::new(Leaping { most, last: None }))
    }
}

impl EpisodeWatcher for Leaping {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let transform = || moment.world.get::<Transform>(moment.agent).map(|transform| transform.translation);
        let position = moment.position.map(|position| position.extend(0.0)).or_else(transform)?;
        let way = self.last.replace(position).map(|last| last.distance(position))?;
        (way > self.most).then(|| format!("the agent moved {way:.1} units in one tick"))
    }
}

/// Most tiles of a plan that are examined.
const MOST_TILES: f32 = 4e6;

/// Largest distance of a corner from the grid, in tiles.
const ROUNDING: f32 = 0.01;

/// The tiles of a level's plan that are entirely wall. Outside the plan there is no wall.
pub(super) struct SolidTiles {
    grid: CellGrid,
    columns: usize,
    rows: usize,
    is_solid: Vec<bool>,
}

impl SolidTiles {
    /// Reads the tiles of a plan; `None` for a plan without walls, and for one that is too large.
    pub fn of(plan: &FloorPlan) -> Option<Self> {
        let grid = CellGrid::new(Some(plan), None);
        let count = (plan.bounds.size() / grid.size).round();
        let is_fit = count.min_element() >= 1.0 && count.x * count.y <= MOST_TILES;
        if plan.walls.is_empty() || !is_fit {
            return None;
        }
        let (columns, rows) = (count.x as usize, count.y as usize);
        let mut is_solid = vec![false; columns * rows];
        for wall in &plan.walls {
            let first = ((wall.min - grid.origin) / grid.size - ROUNDING).ceil().max(Vec2::ZERO);
            let end = ((wall.max - grid.origin) / grid.size + ROUNDING).floor().min(count);
            let (from, to) = (first.x as usize, end.x as usize);
            for row in first.y as usize..end.y as usize {
                if from < to {
                    is_solid[row * columns + from..row * columns + to].fill(true);
                }
            }
        }
        Some(Self { grid, columns, rows, is_solid })
    }

    /// Returns whether all is wall up to this distance from a position along both axes, in tiles.
    pub fn surround(&self, position: Vec2, distance: f32) -> bool {
        let at = (position - self.grid.origin) / self.grid.size;
        let (low, high) = ((at - distance + ROUNDING).floor(), (at + distance - ROUNDING).floor());
        let is_inside = low.min_element() >= 0.0 && high.x < self.columns as f32 && high.y < self.rows as f32;
        is_inside
            && (low.y as usize..=high.y as usize)
                .all(|row| (low.x as usize..=high.x as usize).all(|column| self.is_solid[row * self.columns + column]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};
    use bevy::math::Rect;

    fn steps(step: impl Fn(usize) -> Step) -> Vec<Step> {
        (0..500).map(step).collect()
    }

    #[test]
    fn who_cannot_leave_its_position_is_found() {
        // The world around it goes on.
        let walled = steps(|tick| Step { seen: tick as f32, ..Step::at(tick, 2.0, 2.0) });
        let (tick, message) = found(&Stuck::default(), &room(), &walled).expect("it is stuck");
        assert_eq!(tick, 300);
        assert!(message.contains("2.0, 2.0"), "{message}");
    }

    #[test]
    fn who_wanders_holds_a_key_or_rests_at_the_goal_is_not_stuck() {
        let wanders = steps(|tick| Step::at(tick, 2.0 + (tick / 250) as f32, 2.0));
        let holds = steps(|_| Step::at(0, 2.0, 2.0));
        let rests = steps(|tick| Step::at(tick, 8.0, 8.0));
        let done = steps(|tick| Step { is_success: true, ..Step::at(tick, 2.0, 2.0) });
        let nowhere = steps(|tick| Step { position: None, ..Step::at(tick, 2.0, 2.0) });
        for sound in [wanders, holds, rests, done, nowhere] {
            assert_eq!(found(&Stuck::default(), &room(), &sound), None);
        }
    }

    fn walk(to: f32) -> Vec<Step> {
        (0..=40).map(|tick| Step::at(tick, 5.0 + (to - 5.0) * tick as f32 / 40.0, 5.0)).collect()
    }

    #[test]
    fn who_leaves_the_level_is_found_in_the_first_tick_outside() {
        let (tick, message) = found(&OutOfBounds { margin: 1.0 }, &room(), &walk(13.0)).expect("it is outside");
        // The step is 0.2: after 30 of them the agent is at 11, the edge with its margin, and one later outside.
        assert!((30..=32).contains(&tick), "{tick}");
        assert!(message.contains("outside the level"), "{message}");
    }

    #[test]
    fn inside_near_the_edge_and_in_a_level_without_walls_nothing_is_found() {
        assert_eq!(found(&OutOfBounds::default(), &room(), &walk(17.5)), None);
        let mut open = room();
        open.plan.as_mut().expect("a plan").walls.clear();
        assert_eq!(found(&OutOfBounds::default(), &open, &walk(90.0)), None);
        assert_eq!(found(&OutOfBounds::default(), &LevelAhead::default(), &walk(90.0)), None);
    }

    fn fall(speed: f32, until: f32) -> Vec<Step> {
        (0..200).map(|tick| Step::at(tick, 5.0, (5.0 - speed * tick as f32).max(until))).collect()
    }

    #[test]
    fn who_falls_below_the_level_is_found() {
        let (tick, message) = found(&FellThrough::default(), &room(), &fall(0.5, -1e9)).expect("it falls");
        assert_eq!(tick, 60, "the first tick is the start, and then it falls 60 times");
        assert!(message.contains("below the level"), "{message}");
        let deep =
            found(&FellThrough::default(), &LevelAhead::default(), &fall(100.0, -1e9)).expect("a level without plan");
        assert_eq!(deep.0, 101, "10,000 below its start is where it is after 100 ticks");
    }

    #[test]
    fn a_long_way_down_and_rest_below_the_plan_are_sound() {
        assert_eq!(found(&FellThrough::default(), &room(), &fall(0.02, -1e9)), None, "it is still inside");
        assert_eq!(found(&FellThrough::default(), &room(), &fall(0.5, -3.0)), None, "it has landed");
        assert_eq!(found(&FellThrough::default(), &LevelAhead::default(), &fall(0.5, -1e9)), None);
    }

    #[test]
    fn in_a_plan_from_above_the_height_falls_and_not_the_position() {
        let above = |speed: [f32; 2]| {
            let step = |tick: usize| {
                let [along, down] = speed.map(|speed| speed * tick as f32);
                Step { height: Some(3.0 - down), ..Step::at(tick, 5.0, 5.0 - along) }
            };
            (0..200).map(step).collect::<Vec<_>>()
        };
        let deep = FellThrough { depth: 50.0, ..FellThrough::default() };
        assert_eq!(found(&deep, &room(), &above([0.5, 0.0])), None, "it walks out of the plan");
        let (tick, message) = found(&deep, &room(), &above([0.0, 0.5])).expect("it falls");
        assert_eq!(tick, 101, "50 below its start is where it is after 100 ticks, whatever the plan");
        assert!(message.contains("down to -47.5"), "{message}");
    }

    /// Upwards at x = 5, into the wall above, which is three tiles thick.
    fn climb() -> (LevelAhead, Vec<Step>) {
        let mut level = room();
        let plan = level.plan.as_mut().expect("a plan");
        plan.walls.extend([10.0, 11.0].map(|low| Rect::new(0.0, low, 10.0, low + 1.0)));
        plan.bounds.max.y = 12.0;
        (level, (0..24).map(|tick| Step::at(tick, 5.0, 0.5 * tick as f32)).collect())
    }

    #[test]
    fn who_is_deep_inside_a_wall_is_found() {
        let (level, steps) = climb();
        let (tick, message) = found(&ThroughWall::default(), &level, &steps).expect("it is inside");
        // The wall begins at 9; at 9.5 there is half a tile below the agent, and at 10.0 a whole one.
        assert_eq!(tick, 20);
        assert!(message.contains("5.0, 10.0"), "{message}");
        assert_eq!(found(&ThroughWall::deeper_than(0.3), &level, &steps).map(|(tick, _)| tick), Some(1), "the floor");
    }

    #[test]
    fn who_hangs_over_a_ledge_or_stays_in_the_open_is_sound() {
        let across: Vec<Step> = (0..24).map(|tick| Step::at(tick, 5.0, 0.5 * tick as f32)).collect();
        assert_eq!(found(&ThroughWall::default(), &room(), &across), None, "the walls are one tile thick");
        let open: Vec<Step> = (0..24).map(|tick| Step::at(tick, 5.0, 1.0 + 0.3 * tick as f32)).collect();
        assert_eq!(found(&ThroughWall::deeper_than(0.3), &room(), &open), None);
        assert_eq!(found(&ThroughWall::default(), &LevelAhead::default(), &across), None, "no plan");
    }

    #[test]
    fn a_flung_agent_is_found_and_a_running_one_is_not() {
        let detector = PhysicsExplosion::default();
        let flung: Vec<Step> = [1.0, 2.0, 4.0, 9.5].iter().map(|x| Step::at(0, *x, 5.0)).collect();
        assert_eq!(found(&detector, &room(), &flung).map(|(tick, _)| tick), Some(3), "5.5 of 10 tiles");
        let runs: Vec<Step> = [1.0, 4.0, 8.0, 9.0].iter().map(|x| Step::at(0, *x, 5.0)).collect();
        assert_eq!(found(&detector, &room(), &runs), None);
    }

    fn plan(walls: Vec<Rect>) -> FloorPlan {
        FloorPlan { bounds: Rect::new(-1.0, -1.0, 9.0, 5.0), walls, ..FloorPlan::default() }
    }

    #[test]
    fn how_deep_a_position_is_counts_to_all_sides_and_over_walls_that_touch() {
        // Two rows of tiles of side 2, one above the other.
        let walls = vec![Rect::new(-1.0, -1.0, 7.0, 1.0), Rect::new(-1.0, 1.0, 7.0, 3.0)];
        let solid = SolidTiles::of(&plan(walls)).expect("walls");
        let middle = Vec2::new(3.0, 1.0);
        assert!(solid.surround(middle, 1.0) && !solid.surround(middle, 1.1), "two tiles thick");
        let edge = Vec2::new(6.0, 1.0);
        assert!(solid.surround(edge, 0.5) && !solid.surround(edge, 0.6));
        assert!(!solid.surround(Vec2::new(8.0, 1.0), 0.1), "in the open");
        assert!(!solid.surround(Vec2::new(-0.9, 1.0), 0.5) && !solid.surround(Vec2::NAN, 0.1), "outside is no wall");
    }

    #[test]
    fn a_plan_without_walls_or_with_far_too_many_tiles_has_none() {
        assert!(SolidTiles::of(&plan(Vec::new())).is_none());
        let bounds = Rect::new(0.0, 0.0, 1e6, 1e6);
        let vast = FloorPlan { bounds, ..plan(vec![Rect::new(0.0, 0.0, 1.0, 1.0)]) };
        assert!(SolidTiles::of(&vast).is_none());
    }
}
