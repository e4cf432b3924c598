//! Episodes to play, their results, and the progress of their agents.
//!
//! Progress does not need a floor plan: it is success in the first tick, the cells that agents reach, and the position at
//! which the episodes of an unsolved level stop.

use crate::verdict::walk::Walk;
use bevy::{math::Vec2, prelude::*};
use bevy_playbot::episode::{Episode, EpisodeResult};
use playbot_harness::game::Game;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeSet, fmt};

/// An episode to play.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Task {
    /// The level.
    pub level: u64,
    /// Seed of the player's streams.
    pub seed: u64,
}

/// Result of an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Played {
    /// Its end.
    pub end: PlayedEnd,
    /// True if the player drew no random number.
    pub exact: bool,
    /// The detectors' findings in it.
    pub found: Vec<EpisodeFinding>,
    /// Walk of its agent, if the game reports positions.
    pub walk: Option<Walk>,
    /// Progress of its agent.
    pub track: Track,
}

impl Played {
    /// Returns whether this detector has a finding in it, or the game broke this way.
    pub fn shows(&self, detector: &str) -> bool {
        let is_broken = matches!(&self.end, PlayedEnd::Broken { detector: how, .. } if *how == detector);
        is_broken || self.found.iter().any(|finding| finding.detector == detector)
    }
}

/// The end of an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PlayedEnd {
    /// An end by the game.
    Ended {
        /// The result.
        result: EpisodeResult,
        /// Last position of the agent, if the game reports it.
        position: Option<Vec2>,
        /// Cause of an end without the goal, if the game reports it.
        cause: Option<&'static str>,
    },
    /// The game broke.
    Broken {
        /// `panic`, `fault` or `endless`.
        detector: &'static str,
        /// Tick of the episode, if it had begun.
        tick: Option<u32>,
        /// The game's message.
        message: String,
    },
}

impl PlayedEnd {
    /// Returns the ticks of the episode, or those before the game broke.
    pub fn ticks(&self) -> u32 {
        match self {
            Self::Ended { result, .. } => result.ticks,
            Self::Broken { tick, .. } => tick.unwrap_or(0),
        }
    }
}

/// A detector's finding in an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct EpisodeFinding {
    /// The detector.
    pub detector: &'static str,
    /// Tick of the episode.
    pub tick: u32,
    /// The message.
    pub message: String,
}

// The progress of agents.

/// Radius of a common stop, as a share of the distance that the best episode came from its start.
const RADIUS: f32 = 0.1;

/// Share of that distance that a common stop must have from the start.
const FAR: f32 = 0.5;

/// Returns to the start after which an episode moves to and fro: its furthest position is no obstacle.
const MANY_RETURNS: u32 = 5;

/// Progress of an agent in an episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Track {
    /// True if the goal was reached in the first tick.
    pub is_solved_at_start: bool,
    /// Its positions, if they are known.
    pub route: Option<Route>,
    /// The cells of its positions, if they are known.
    pub cells: Option<ReachedCells>,
}

/// Positions of an agent in an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Route {
    /// Position after the first tick.
    pub start: Vec2,
    /// Position with the largest distance from the start.
    pub furthest: Vec2,
    /// Last position.
    pub end: Vec2,
    /// The entity whose position it is, if the game does not declare positions.
    pub entity: Option<String>,
    /// Returns to the start, from far away.
    pub returns: Returns,
}

impl Route {
    fn new(start: Vec2, entity: Option<String>) -> Self {
        Self { start, furthest: start, end: start, entity, returns: Returns::default() }
    }

    /// Adds a position of the same entity.
    fn add(&mut self, position: Vec2) {
        self.end = position;
        let distance = self.start.distance(position);
        if distance > self.length() {
            self.furthest = position;
        }
        self.returns.add(distance, self.length());
    }

    /// Returns the largest distance from the start.
    fn length(&self) -> f32 {
        self.start.distance(self.furthest)
    }
}

/// Counter of an agent's returns to its start. Only those from distances of about its largest one count.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Returns {
    /// Number of returns.
    pub count: u32,
    /// The largest distance at the time when the count began.
    scale: f32,
    is_far: bool,
}

impl Returns {
    /// Adds a distance from the start; `length` is the largest one so far.
    fn add(&mut self, distance: f32, length: f32) {
        if length > 2.0 * self.scale {
            // Returns from much nearer say nothing about an agent that has come further since.
            *self = Self { count: 0, scale: length, is_far: false };
        }
        if distance >= FAR * length && length > 0.0 {
            self.is_far = true;
        } else if self.is_far && distance <= RADIUS * length {
            self.is_far = false;
            self.count = self.count.saturating_add(1);
        }
    }
}

/// Progress of one agent, episode after episode.
pub(super) struct TrackCounter {
    agent: Entity,
    now: Track,
}

impl TrackCounter {
    /// Makes a counter for an agent.
    pub fn new(agent: Entity) -> Self {
        Self { agent, now: Track::default() }
    }

    /// Notes the tick that was just played; `result` is the result of the episode if it is over.
    pub fn tick(&mut self, game: &dyn Game, world: &World, result: Option<&EpisodeResult>) {
        let Some(episode) = world.get::<Episode>(self.agent) else { return };
        if episode.tick == 0 || !(episode.is_running() || result.is_some()) {
            return;
        }
        if episode.tick == 1 {
            let is_solved_at_start = result.map_or_else(|| episode.is_success(), |result| result.success);
            self.now = Track { is_solved_at_start, ..Track::default() };
        }
        let state = game.tools().state;
        let declared = state.position(world, self.agent).map(|position| (position, None));
        let guessed = || state.guessed_position(world, self.agent).map(|guess| (guess.position, Some(guess.entity)));
        if let Some((position, entity)) = declared.or_else(guessed).filter(|(position, _)| position.is_finite()) {
            self.note(position, entity);
        }
    }

    fn note(&mut self, position: Vec2, entity: Option<String>) {
        match &mut self.now.cells {
            Some(cells) if cells.entity == entity => cells.insert(position),
            cells => cells.insert(ReachedCells::new(entity.clone())).insert(position),
        }
        match &mut self.now.route {
            // Distances from another entity's start mean nothing.
            Some(route) if route.entity == entity => route.add(position),
            route => *route = Some(Route::new(position, entity)),
        }
    }

    /// Returns the progress in the episode that is over, and forgets it.
    pub fn take(&mut self) -> Track {
        std::mem::take(&mut self.now)
    }
}

/// Most cells along a side of the area that was reached.
const MOST_CELLS: i32 = 32;

/// Side of the smallest cells.
const SMALLEST: f32 = 1.0 / 256.0;

/// Most cells between the origin and a position, so that numbers of cells are exact.
const FARTHEST: f32 = 1_048_576.0;

/// Cells of the positions that agents reached on a level without [maps](crate::verdict::LevelMaps). They are coarse: at
/// most 32 along each side of the area.
///
/// The side of a cell is a power of two, and the corner of one is the origin. So larger cells consist of whole smaller
/// ones, and results with cells of different sizes are comparable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReachedCells {
    /// Side of a cell, in the units of the game's positions.
    pub side: f32,
    /// Column and row of each cell: its corner is at these times the side.
    pub cells: BTreeSet<[i32; 2]>,
    /// The entity whose positions they are, if the game does not declare positions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub entity: Option<String>,
}

impl ReachedCells {
    fn new(entity: Option<String>) -> Self {
        Self { side: SMALLEST, cells: BTreeSet::new(), entity }
    }

    /// Adds the cell of a finite position. The result does not depend on the order of positions.
    fn insert(&mut self, position: Vec2) {
        while position.abs().max_element() > FARTHEST * self.side {
            *self = self.doubled();
        }
        if self.cells.insert((position / self.side).floor().as_ivec2().to_array()) {
            self.shorten();
        }
    }

    /// Adds the cells of another episode.
    fn add(&mut self, other: &Self) {
        let side = self.side.max(other.side);
        *self = self.of_side(side);
        self.cells.extend(other.of_side(side).cells);
        self.shorten();
    }

    /// Makes cells of at least this side. Cells from a file may have any.
    pub(super) fn of_side(&self, side: f32) -> Self {
        let mut cells = self.clone();
        while cells.side > 0.0 && cells.side < side {
            cells = cells.doubled();
        }
        cells
    }

    /// Makes larger cells, until there are few of them.
    fn shorten(&mut self) {
        while (0..2).any(|axis| self.length(axis) > i64::from(MOST_CELLS)) {
            *self = self.doubled();
        }
    }

    /// Returns the number of cells from the first to the last one along an axis.
    fn length(&self, axis: usize) -> i64 {
        let numbers = || self.cells.iter().map(|cell| i64::from(cell[axis]));
        numbers().max().zip(numbers().min()).map_or(0, |(last, first)| last - first + 1)
    }

    fn doubled(&self) -> Self {
        let cells = self.cells.iter().map(|cell| cell.map(|number| number.div_euclid(2))).collect();
        Self { side: 2.0 * self.side, cells, entity: self.entity.clone() }
    }
}

/// Returns the cells of all these episodes together. `None` without positions, or with those of different entities.
pub(super) fn reached<'a>(tracks: impl Iterator<Item = &'a Track>) -> Option<ReachedCells> {
    let mut all: Option<ReachedCells> = None;
    for cells in tracks.filter_map(|track| track.cells.as_ref()) {
        match &mut all {
            None => all = Some(cells.clone()),
            Some(all) if all.entity == cells.entity => all.add(cells),
            Some(_) => return None,
        }
    }
    all
}

/// The position at which the episodes of an unsolved level stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CommonStop {
    /// The part of an episode that is meant.
    pub kind: StopKind,
    /// The position, in the units of the game's positions.
    pub x: f32,
    /// The position.
    pub y: f32,
    /// Largest distance of these episodes from it.
    pub within: f32,
    /// Episodes that stopped there.
    pub episodes: u64,
    /// All episodes whose positions are known.
    pub of: u64,
    /// The entity whose position it is, if the game does not declare positions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub entity: Option<String>,
}

/// The part of an episode that a [`CommonStop`] is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopKind {
    /// The position furthest from the start.
    Furthest,
    /// The last position.
    End,
    /// The start, which no episode left.
    Start,
    /// The position furthest from the start of all episodes, which stopped at different ones.
    Best,
    /// The start, to which the episodes returned again and again: such a position is no measure of progress.
    Around,
}

impl fmt::Display for CommonStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, x, y, within, episodes, of, entity } = self;
        match (kind, of) {
            (StopKind::Best, _) => write!(f, "of {of} episodes, the one that went furthest ")?,
            (_, 1) => f.write_str("the only episode ")?,
            (_, 2) => f.write_str("both episodes ")?,
            _ if episodes == of => write!(f, "all {of} episodes ")?,
            _ => write!(f, "{episodes} of {of} episodes ")?,
        }
        match kind {
            StopKind::Best | StopKind::Furthest if *episodes == 1 => {
                write!(f, "got no further from its start than ({x:.1}, {y:.1})")?;
            }
            StopKind::Best | StopKind::Furthest => {
                write!(f, "got no further from their start than ({x:.1}, {y:.1}), within {within:.1}")?;
            }
            StopKind::Around => write!(f, "went to and fro, within {within:.1} of ({x:.1}, {y:.1})")?,
            StopKind::End => write!(f, "ended within {within:.1} of ({x:.1}, {y:.1})")?,
            StopKind::Start => write!(f, "stayed within {within:.1} of ({x:.1}, {y:.1})")?,
        }
        entity.iter().try_for_each(|entity| write!(f, ", by the position of {entity}"))
    }
}

/// Returns the position at which more than half of these episodes stopped: the furthest one from the start, or else
/// the last one, or else how far the best episode came. If more than half of them returned to their start again and
/// again, it is the start: the position of a paddle or of a cursor shows no progress. `None` without positions, or with
/// those of different entities.
pub(super) fn common_stop<'a>(tracks: impl Iterator<Item = &'a Track>) -> Option<CommonStop> {
    let routes: Vec<&Route> = tracks.filter_map(|track| track.route.as_ref()).collect();
    let entity = routes.first()?.entity.clone();
    // Positions of different entities are not comparable.
    if routes.iter().any(|route| route.entity != entity) {
        return None;
    }
    let length = routes.iter().map(|route| route.length()).fold(0.0, f32::max);
    let of = routes.len() as u64;
    let stop = |kind, (position, within, episodes): (Vec2, f32, u64)| CommonStop {
        kind,
        x: position.x,
        y: position.y,
        within,
        episodes,
        of,
        entity: entity.clone(),
    };
    let is_most = |(_, _, episodes): &(Vec2, f32, u64)| 2 * episodes > of;
    let ends: Vec<Vec2> = routes.iter().map(|route| route.end).collect();
    if length <= 0.0 {
        // An entity that never moves may not be the agent's.
        let found = densest(&ends, 0.0).filter(is_most).filter(|_| entity.is_none())?;
        return Some(stop(StopKind::Start, found));
    }
    let around: Vec<&Route> =
        routes.iter().copied().filter(|route| route.returns.count >= MANY_RETURNS && route.length() > 0.0).collect();
    if 2 * around.len() as u64 > of {
        let start = around[0].start;
        let within = around.iter().map(|route| start.distance(route.start) + route.length()).fold(0.0, f32::max);
        return Some(stop(StopKind::Around, (start, within, around.len() as u64)));
    }
    let radius = RADIUS * length;
    // Episodes that hardly left the start show no obstacle.
    let far = routes.iter().filter(|route| route.length() >= FAR * length);
    let furthest: Vec<Vec2> = far.map(|route| route.furthest).collect();
    if let Some(found) = densest(&furthest, radius).filter(is_most) {
        return Some(stop(StopKind::Furthest, found));
    }
    if let Some(found) = densest(&ends, radius).filter(is_most) {
        return Some(stop(StopKind::End, found));
    }
    let best = routes.iter().find(|route| route.length() == length)?;
    Some(stop(StopKind::Best, (best.furthest, 0.0, 1)))
}

/// Returns the first of these positions with the most others within this distance: with the largest distance of these
/// from it, and their number.
fn densest(positions: &[Vec2], radius: f32) -> Option<(Vec2, f32, u64)> {
    let mut best: Option<(Vec2, f32, u64)> = None;
    for &position in positions {
        let distances = positions.iter().map(|other| position.distance(*other)).filter(|distance| *distance <= radius);
        let (within, count) = distances.fold((0.0, 0), |(within, count), one| (f32::max(within, one), count + 1));
        if best.is_none_or(|(.., most)| count > most) {
            best = Some((position, within, count));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes the track of an episode that goes from 0, 0 to `furthest` and ends at `end`.
    fn track(furthest: [f32; 2], end: [f32; 2]) -> Track {
        let [furthest, end] = [furthest, end].map(Vec2::from_array);
        let route = Some(Route { furthest, end, ..Route::new(Vec2::ZERO, None) });
        Track { route, ..Track::default() }
    }

    fn words(tracks: &[Track]) -> Option<String> {
        common_stop(tracks.iter()).map(|stop| stop.to_string())
    }

    #[test]
    fn episodes_that_meet_an_obstacle_stop_at_the_same_distance() {
        let walled = [track([12.0, 3.0], [1.0, 0.0]), track([12.5, 3.0], [5.0, 0.0]), track([12.25, 3.0], [9.0, 0.0])];
        // Each is within a tenth of 12.9 of all, and the first counts.
        assert_eq!(
            words(&walled).as_deref(),
            Some("all 3 episodes got no further from their start than (12.0, 3.0), within 0.5")
        );
        let mut rested = walled.to_vec();
        rested.push(track([0.5, 0.0], [0.0, 0.0]));
        let most = "3 of 4 episodes got no further from their start than (12.0, 3.0), within 0.5";
        assert_eq!(words(&rested).as_deref(), Some(most));
        let both = "both episodes got no further from their start than (12.0, 3.0), within 0.5";
        assert_eq!(words(&walled[..2]).as_deref(), Some(both));
        assert_eq!(
            words(&walled[..1]).as_deref(),
            Some("the only episode got no further from its start than (12.0, 3.0)")
        );
    }

    #[test]
    fn episodes_that_rest_show_no_obstacle_beside_one_that_goes_far() {
        let tracks = [track([0.1, 0.0], [0.1, 0.0]), track([0.2, 0.0], [0.2, 0.0]), track([40.0, 0.0], [40.0, 0.0])];
        assert_eq!(words(&tracks).as_deref(), Some("2 of 3 episodes ended within 0.1 of (0.1, 0.0)"));
    }

    #[test]
    fn episodes_that_end_at_one_position_are_reported_by_their_ends() {
        let tracks = [track([10.0, 0.0], [2.0, 1.0]), track([0.0, 10.0], [2.0, 1.5]), track([-10.0, 0.0], [2.0, 1.0])];
        assert_eq!(words(&tracks).as_deref(), Some("all 3 episodes ended within 0.5 of (2.0, 1.0)"));
        let apart = [track([10.0, 0.0], [9.0, 1.0]), track([0.0, 10.0], [2.0, 9.0]), track([-10.0, 0.0], [-5.0, 0.0])];
        let best = "of 3 episodes, the one that went furthest got no further from its start than (10.0, 0.0)";
        assert_eq!(words(&apart).as_deref(), Some(best), "they stopped at different positions");
        let two = "of 2 episodes, the one that went furthest got no further from its start than (10.0, 0.0)";
        assert_eq!(words(&apart[..2]).as_deref(), Some(two));
        assert_eq!(words(&[]), None);
    }

    /// Makes the track of an episode with these positions along a line.
    fn along(line: impl IntoIterator<Item = f32>) -> Track {
        let mut counter = TrackCounter::new(Entity::PLACEHOLDER);
        line.into_iter().for_each(|x| counter.note(Vec2::new(2.0, x), None));
        counter.take()
    }

    #[test]
    fn an_agent_that_goes_to_and_fro_meets_no_obstacle_at_its_furthest_position() {
        // A paddle: up to 9, back, down to -8 and back, three times.
        let paddle = || along([0.0, 5.0, 9.0, 5.0, 0.0, -5.0, -8.0, -5.0].repeat(3).into_iter().chain([0.0]));
        assert_eq!(words(&[paddle()]).as_deref(), Some("the only episode went to and fro, within 9.0 of (2.0, 0.0)"));
        let tracks = [paddle(), along([0.0, 3.0, 6.0]), paddle()];
        let most = "2 of 3 episodes went to and fro, within 9.0 of (2.0, 0.0)";
        assert_eq!(words(&tracks).as_deref(), Some(most));
        let few = [paddle(), along([0.0, 4.5, 9.0]), along([0.0, 4.0, 8.5])];
        let met = "all 3 episodes got no further from their start than (2.0, 9.0), within 0.5";
        assert_eq!(words(&few).as_deref(), Some(met), "one of three is not most");
        let wall = along([0.0, 5.0, 9.0, 5.0, 0.0, 9.0, 9.0]);
        let met = "the only episode got no further from its start than (2.0, 9.0)";
        assert_eq!(words(&[wall]).as_deref(), Some(met), "one return is no habit");
        // It trembles at the start, and walks away then.
        let left = along([0.0, 1.0].repeat(20).into_iter().chain([2.0, 4.0, 6.0]));
        let met = "the only episode got no further from its start than (2.0, 6.0)";
        assert_eq!(words(&[left]).as_deref(), Some(met), "small returns do not count");
    }

    #[test]
    fn agents_that_never_move_are_reported_unless_they_are_guessed() {
        let still = vec![track([0.0, 0.0], [0.0, 0.0]); 4];
        assert_eq!(words(&still).as_deref(), Some("all 4 episodes stayed within 0.0 of (0.0, 0.0)"));
        let guessed = |mut track: Track, entity: &str| {
            track.route.iter_mut().for_each(|route| route.entity = Some(entity.to_owned()));
            track
        };
        let all = |tracks: &[Track]| tracks.iter().map(|track| guessed(track.clone(), "the one")).collect::<Vec<_>>();
        assert_eq!(words(&all(&still)), None);
        let moved = vec![track([4.0, 0.0], [4.0, 0.0]); 3];
        let named =
            "all 3 episodes got no further from their start than (4.0, 0.0), within 0.0, by the position of the one";
        assert_eq!(words(&all(&moved)).as_deref(), Some(named));
        let mixed: Vec<Track> =
            moved.iter().zip(["a", "b", "b"]).map(|(one, name)| guessed(one.clone(), name)).collect();
        assert_eq!(words(&mixed), None, "these are positions of two entities");
    }

    /// Returns the side and the cells of these positions, in one episode.
    fn cells(positions: &[[f32; 2]]) -> (f32, Vec<[i32; 2]>) {
        let mut counter = TrackCounter::new(Entity::PLACEHOLDER);
        positions.iter().for_each(|position| counter.note(Vec2::from_array(*position), None));
        let reached = counter.take().cells.expect("positions are known");
        (reached.side, reached.cells.into_iter().collect())
    }

    #[test]
    fn cells_grow_until_there_are_few_whatever_the_order_of_positions() {
        // 33 cells of side 1 would be too many: from -1 to 31.
        let all = [[-0.5, 0.0], [31.5, 3.0], [8.0, 2.0]];
        let expected = (2.0, vec![[-1, 0], [4, 1], [15, 1]]);
        assert_eq!(cells(&all), expected);
        assert_eq!(cells(&[all[2], all[0], all[1]]), expected);
        assert_eq!(cells(&[all[1], all[2], all[0]]), expected);
        assert_eq!(cells(&[[0.0, 0.0], [31.5, 0.0]]), (1.0, vec![[0, 0], [31, 0]]));
        assert_eq!(cells(&[[0.25, 0.5]]), (SMALLEST, vec![[64, 128]]));
        // The farthest position is at 2 to the power of 30, and 2 to the power of 20 cells away.
        assert_eq!(cells(&[[1_073_741_824.0, 0.0]]), (1024.0, vec![[1_048_576, 0]]));
    }

    #[test]
    fn cells_of_all_episodes_are_added_in_the_larger_size() {
        let track = |positions: &[[f32; 2]], entity: Option<&str>| {
            let mut counter = TrackCounter::new(Entity::PLACEHOLDER);
            let entity = entity.map(str::to_owned);
            positions.iter().for_each(|position| counter.note(Vec2::from_array(*position), entity.clone()));
            counter.take()
        };
        let far = track(&[[0.0, 0.0], [63.0, 0.0]], None);
        let near = track(&[[1.0, 1.0], [3.0, 5.0]], None);
        let all = reached([&near, &far].into_iter()).expect("positions are known");
        assert_eq!((all.side, all.cells.into_iter().collect::<Vec<_>>()), (2.0, vec![[0, 0], [1, 2], [31, 0]]));
        assert_eq!(reached([&near, &track(&[[0.0, 0.0]], Some("the one"))].into_iter()), None);
        assert_eq!(reached([&Track::default()].into_iter()), None);
    }

    #[test]
    fn a_route_keeps_its_first_furthest_and_last_position() {
        let mut counter = TrackCounter::new(Entity::PLACEHOLDER);
        for x in [1.0, 4.0, -1.0, 2.0] {
            counter.note(Vec2::new(x, 0.0), None);
        }
        let [start, furthest, end] = [1.0, 4.0, 2.0].map(|x| Vec2::new(x, 0.0));
        let route = counter.take().route.expect("positions are known");
        assert_eq!((route.start, route.furthest, route.end, route.entity), (start, furthest, end, None));
        assert_eq!(counter.take(), Track::default(), "the next episode has its own");
    }
}
