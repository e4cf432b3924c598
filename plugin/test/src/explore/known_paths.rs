//! Paths to cells, and snapshots of episodes on them.
//!
//! Paths share their beginnings: each is a piece of its own after a path that was known before. Snapshots are in a bounded
//! store, and those that do not restore everything are reported.

use crate::explore::{EndCounts, Exploration, ExploreError, Stop, tried::Exhaustion};
use bevy::prelude::*;
use bevy_playbot::{
    action::Action,
    agent::Control,
    demo::{
        file::DemoWriter,
        recorder::{Recorder, Recording},
    },
    engine::{flush_unfinished, tick_world},
    episode::{Episode, EpisodeCount},
    fault::Fault,
    level::LevelQueue,
    streams::AgentStreams,
};
use playbot_harness::{game::Game, saved_episode::SavedEpisode, worlds::build_world};
use playbot_learner::{ActionSpace, Actions};
use playbot_report::counted;
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    fmt,
    sync::Arc,
};

/// Actions from the start of a level, with the state hash after each.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// The action of each tick.
    pub actions: Actions,
    /// The folded [state hash](bevy_playbot::state_hash::StateHash::folded) after each tick.
    pub hashes: Vec<u32>,
}

impl Route {
    /// Creates a route without a tick.
    pub(super) fn empty(space: &ActionSpace) -> Self {
        Self { actions: Actions::empty(space), hashes: Vec::new() }
    }

    /// Returns the number of ticks.
    pub fn len(&self) -> usize {
        self.hashes.len()
    }

    /// Returns whether it has no ticks, as the path to the start.
    pub fn is_empty(&self) -> bool {
        self.hashes.is_empty()
    }

    /// Appends the first ticks of another route.
    fn extend(&mut self, piece: &Self, ticks: usize) {
        let ticks = ticks.min(piece.len());
        self.actions.extend_rows(&piece.actions, 0, ticks).expect("all actions are those of one game");
        self.hashes.extend_from_slice(&piece.hashes[..ticks]);
    }
}

/// A path: the first ticks up to the end of a segment, or up to a tick within it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct KnownPath {
    segment: usize,
    /// Its length, from the start of the level.
    pub ticks: u32,
}

impl KnownPath {
    /// The path to the start of the level.
    pub const START: Self = Self { segment: 0, ticks: 0 };

    /// Returns the first ticks of this path.
    pub fn cut(self, ticks: u32) -> Self {
        Self { ticks: ticks.min(self.ticks), ..self }
    }
}

/// The actions after a path that was known before.
struct Segment {
    parent: KnownPath,
    piece: Route,
}

/// All paths of an exploration. Segments stay when a shorter path is found, since other paths may go through them.
pub(super) struct KnownPaths {
    space: ActionSpace,
    segments: Vec<Segment>,
    snapshots: SnapshotStore<Arc<SavedEpisode>>,
}

impl KnownPaths {
    /// Creates it with the path to the start alone.
    pub fn new(space: ActionSpace) -> Self {
        let start = Segment { parent: KnownPath::START, piece: Route::empty(&space) };
        Self { space, segments: vec![start], snapshots: SnapshotStore::new(MOST_SNAPSHOTS) }
    }

    /// Adds a path of this many ticks, which extends a known one by the beginning of a piece.
    pub fn extend(&mut self, parent: KnownPath, piece: &Route, ticks: u32) -> KnownPath {
        if ticks <= parent.ticks {
            return parent.cut(ticks);
        }
        let mut kept = Route::empty(&self.space);
        kept.extend(piece, (ticks - parent.ticks) as usize);
        self.segments.push(Segment { parent, piece: kept });
        KnownPath { segment: self.segments.len() - 1, ticks }
    }

    /// Keeps a snapshot of a path that was added last.
    pub fn keep(&mut self, path: KnownPath, saved: SavedEpisode) {
        self.snapshots.add(path.segment, saved.tick(), Arc::new(saved));
    }

    /// Returns the last snapshot on a path.
    pub fn nearest(&self, path: KnownPath) -> Option<&Arc<SavedEpisode>> {
        let mut rest = path;
        while rest.ticks > 0 {
            if let Some(saved) = self.snapshots.last_up_to(rest.segment, rest.ticks) {
                return Some(saved);
            }
            rest = self.segments[rest.segment].parent.cut(rest.ticks);
        }
        None
    }

    /// Returns a whole path.
    pub fn route(&self, path: KnownPath) -> Route {
        let mut pieces = Vec::new();
        let mut rest = path;
        while rest.ticks > 0 {
            let Segment { parent, piece } = &self.segments[rest.segment];
            if rest.ticks > parent.ticks {
                pieces.push((piece, (rest.ticks - parent.ticks) as usize));
            }
            rest = parent.cut(rest.ticks);
        }
        let mut route = Route::empty(&self.space);
        for (piece, ticks) in pieces.into_iter().rev() {
            route.extend(piece, ticks);
        }
        route
    }
}

/// Plays actions on a level under the recorder. An episode that goes on after them is recorded as aborted. A replay of
/// the recording, for instance with [`verify_file`](playbot_harness::demo::verify_file), checks that the path is the
/// same.
///
/// # Errors
///
/// The game broke its contract, or the recording cannot be written.
pub fn record_route(
    game: &dyn Game,
    mode: &str,
    level: u64,
    actions: &Actions,
    writer: DemoWriter,
) -> Result<(), ExploreError> {
    let (mut world, agent) = world_of(game, mode, level);
    world.insert_resource(Recorder::new(writer));
    world.entity_mut(agent).insert(Recording::default());
    play(&mut world, agent, actions, |_| {})?;
    flush_unfinished(&mut world)?;
    Ok(())
}

/// Returns the position of an agent after each tick of these actions, on the game's floor plan. Empty if the game does
/// not report positions.
///
/// # Errors
///
/// The game broke its contract.
pub fn follow_route(game: &dyn Game, mode: &str, level: u64, actions: &Actions) -> Result<Vec<Vec2>, Fault> {
    let (mut world, agent) = world_of(game, mode, level);
    let mut positions = Vec::new();
    play(&mut world, agent, actions, |world| positions.extend(game.tools().state.position(world, agent)))?;
    Ok(positions)
}

/// Builds a World with an agent that plays the level once.
fn world_of(game: &dyn Game, mode: &str, level: u64) -> (World, Entity) {
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Bot, LevelQueue::list([level]), AgentStreams::new(0, 0)));
    (world, agent)
}

/// Plays the actions, or those up to the end of the episode.
fn play(world: &mut World, agent: Entity, actions: &Actions, mut after_tick: impl FnMut(&World)) -> Result<(), Fault> {
    let mut ticks = 0;
    while let Some(action) = actions.get(ticks) {
        world.entity_mut(agent).insert(Action(action));
        tick_world(world)?;
        let is_over = world.get::<EpisodeCount>(agent).is_some_and(|count| count.finished > 0);
        let played = world.get::<Episode>(agent).map_or(0, |episode| episode.tick as usize);
        // Levels that are still loading have no tick.
        if is_over || played != ticks {
            after_tick(world);
        }
        if is_over {
            break;
        }
        ticks = played;
    }
    Ok(())
}

/// The summary of an exploration, for people and as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExplorationSummary {
    /// Name of the game.
    pub game: &'static str,
    /// Mode of the game.
    pub mode: String,
    /// Number of the level.
    pub level: u64,
    /// Name of the explorer.
    pub explorer: &'static str,
    /// Random seed.
    pub seed: u64,
    /// Environment steps, with the paths back.
    pub steps: u64,
    /// Visits.
    pub visits: u64,
    /// The reason why it ended.
    pub stop: Stop,
    /// Cells that were reached, open or not.
    pub cells: usize,
    /// Cells that no wall cuts off from the start, if there is a floor plan.
    pub open_cells: Option<usize>,
    /// Number of these that were reached.
    pub open_cells_reached: Option<usize>,
    /// The share of these that were reached.
    pub coverage: Option<f64>,
    /// Cells that were reached and are not among these, such as those above the level.
    pub other_cells: Option<usize>,
    /// Whether the level is known to have a goal.
    pub has_goal: bool,
    /// Ticks of the shortest solution.
    pub solution_ticks: Option<u32>,
    /// Whether every action was tried from every cell; `None` if not, or if that is unknown.
    pub exhausted: Option<Exhaustion>,
    /// Ends of episodes.
    pub ends: EndCounts,
    /// Steps and cells after each round.
    pub curve: Vec<(u64, u64)>,
}

impl Exploration {
    /// Returns the summary.
    pub fn summary(&self, game: &dyn Game) -> ExplorationSummary {
        ExplorationSummary {
            game: game.name(),
            mode: self.mode.clone(),
            level: self.level,
            explorer: self.explorer,
            seed: self.seed,
            steps: self.steps,
            visits: self.visits,
            stop: self.stop,
            cells: self.cells().len(),
            open_cells: self.open.as_ref().map(BTreeSet::len),
            open_cells_reached: self.open_reached(),
            coverage: self.coverage(),
            other_cells: self.open_reached().map(|open| self.cells().len() - open),
            has_goal: self.has_goal,
            solution_ticks: self.solution_ticks(),
            exhausted: self.exhausted.clone(),
            ends: self.ends,
            curve: self.curve.clone(),
        }
    }
}

impl fmt::Display for ExplorationSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { game, mode, level, explorer, steps, visits, cells, ends, .. } = self;
        writeln!(
            f,
            "{game} {mode}:{level}, explored by {explorer} in {} and {}",
            counted(*steps, "step"),
            counted(*visits, "visit")
        )?;
        match (self.open_cells, self.open_cells_reached, self.coverage) {
            (Some(open), Some(reached), Some(coverage)) => {
                write!(f, "cells     {reached} of {open} open cells ({:.1} %)", 100.0 * coverage)?;
                match self.other_cells {
                    Some(others) if others > 0 => writeln!(f, ", and {others} beside them")?,
                    _ => writeln!(f)?,
                }
            }
            _ => writeln!(f, "cells     {cells}")?,
        }
        match (self.solution_ticks, self.has_goal) {
            (Some(ticks), _) if ends.won == 0 => {
                writeln!(f, "solution  {}; episodes go on after it", counted(ticks.into(), "tick"))?
            }
            (Some(ticks), _) => writeln!(f, "solution  {}", counted(ticks.into(), "tick"))?,
            (None, true) => writeln!(f, "solution  none was found")?,
            (None, false) => writeln!(f, "solution  none was found, and no goal is known")?,
        }
        if let Some(exhausted) = &self.exhausted {
            writeln!(f, "exhausted {exhausted}")?;
        }
        if *ends == EndCounts::default() {
            return write!(f, "episodes  none has ended");
        }
        write!(f, "episodes  {} won, {} lost, {} out of time", ends.won, ends.lost, ends.out_of_time)
    }
}

// The snapshots on these paths.

/// Most snapshots that an exploration keeps.
pub(super) const MOST_SNAPSHOTS: usize = 1024;

/// Least ticks between two snapshots of a visit. With a cell in each tick, a visit would save one in each.
pub(super) const SPACING: u32 = 8;

/// Values at ticks of segments of paths. The oldest ones are dropped first: most of them are near the start, so the
/// path to them is played quickly.
pub(super) struct SnapshotStore<T> {
    by_segment: BTreeMap<(usize, u32), T>,
    /// Segment and tick of each value, the oldest first.
    order: VecDeque<(usize, u32)>,
    most: usize,
}

impl<T> SnapshotStore<T> {
    /// Creates an empty store for this many values.
    pub fn new(most: usize) -> Self {
        Self { by_segment: BTreeMap::new(), order: VecDeque::new(), most }
    }

    /// Adds a value at a tick of a segment.
    pub fn add(&mut self, segment: usize, tick: u32, value: T) {
        if self.by_segment.insert((segment, tick), value).is_none() {
            self.order.push_back((segment, tick));
        }
        while self.order.len() > self.most {
            if let Some(oldest) = self.order.pop_front() {
                self.by_segment.remove(&oldest);
            }
        }
    }

    /// Returns the last value of a segment up to a tick.
    pub fn last_up_to(&self, segment: usize, tick: u32) -> Option<&T> {
        self.by_segment.range((segment, 0)..=(segment, tick)).next_back().map(|(_, value)| value)
    }
}

/// The first difference between a visit from a snapshot and the same visit by a replay.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotFault {
    /// Name of the game.
    pub game: &'static str,
    /// Number of the level.
    pub level: u64,
    /// The tick of the episode, from 0; `None` if the game failed after a load.
    pub tick: Option<u32>,
}

impl fmt::Display for SnapshotFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { game, level, tick } = self;
        write!(f, "the snapshot of `{game}` does not restore everything: level {level}")?;
        match tick {
            Some(tick) => write!(f, ", tick {tick}")?,
            None => f.write_str(": the game failed after a snapshot was loaded")?,
        }
        write!(
            f,
            ". The level was explored again by replays. Save all state that decides how an episode goes on, in \
             `SnapshotTools` or `.snapshot`, or leave snapshots out with --no-snapshots"
        )
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    fn piece(actions: &[u32]) -> Route {
        Route { actions: Actions::Discrete(actions.to_vec()), hashes: actions.iter().map(|a| a + 100).collect() }
    }

    #[test]
    fn ways_go_on_behind_others_and_are_whole_again() {
        let mut paths = KnownPaths::new(ActionSpace::Discrete(10));
        let first = paths.extend(KnownPath::START, &piece(&[1, 2, 3, 4]), 3);
        assert_eq!(paths.route(first), piece(&[1, 2, 3]));
        let second = paths.extend(first.cut(2), &piece(&[7, 8, 9]), 4);
        assert_eq!(paths.route(second), piece(&[1, 2, 7, 8]), "what is not needed is not kept");
        let third = paths.extend(second, &piece(&[5]), 5);
        assert_eq!(paths.route(third), piece(&[1, 2, 7, 8, 5]));
        assert_eq!(paths.route(third.cut(1)), piece(&[1]));
        assert_eq!(paths.route(first), piece(&[1, 2, 3]), "others change nothing");
        assert!(paths.route(KnownPath::START).is_empty());
    }

    #[test]
    fn a_way_that_is_no_longer_than_its_beginning_needs_no_segment() {
        let mut paths = KnownPaths::new(ActionSpace::Continuous(2));
        let actions = Actions::Continuous { dim: 2, values: vec![0.5, -0.5, 1.0, 0.0] };
        let first = paths.extend(KnownPath::START, &Route { actions, hashes: vec![1, 2] }, 2);
        assert_eq!(paths.extend(first, &Route::empty(&ActionSpace::Continuous(2)), 1), first.cut(1));
        assert_eq!(paths.segments.len(), 2);
        assert_eq!(paths.route(first.cut(1)).hashes, [1]);
    }

    fn summary() -> ExplorationSummary {
        ExplorationSummary {
            game: "walk",
            mode: "easy".to_owned(),
            level: 7,
            explorer: "random actions",
            seed: 1,
            steps: 3000,
            visits: 32,
            stop: Stop::Spent,
            cells: 30,
            open_cells: Some(40),
            open_cells_reached: Some(24),
            coverage: Some(0.6),
            other_cells: Some(6),
            has_goal: true,
            solution_ticks: None,
            exhausted: None,
            ends: EndCounts { won: 0, lost: 2, out_of_time: 1 },
            curve: vec![(3000, 30)],
        }
    }

    #[test]
    fn people_read_coverage_and_solution() {
        let text = summary().to_string();
        for words in [
            "walk easy:7",
            "cells     24 of 40 open cells (60.0 %), and 6 beside them\n",
            "none was found\n",
            "0 won, 2 lost, 1 out of time",
        ] {
            assert!(text.contains(words), "`{words}` is missing in: {text}");
        }
        let none_else = ExplorationSummary { other_cells: Some(0), ..summary() }.to_string();
        assert!(none_else.contains("24 of 40 open cells (60.0 %)\n"), "{none_else}");
        let bare = ExplorationSummary { open_cells: None, coverage: None, has_goal: false, ..summary() }.to_string();
        assert!(bare.contains("cells     30\n") && bare.contains("no goal is known"), "{bare}");
    }

    #[test]
    fn an_exhausted_level_has_a_line_of_its_own_with_what_it_rests_on() {
        assert!(!summary().to_string().contains("exhausted"));
        let rests_on = "cells of size 1; states within one cell are taken as equal".to_owned();
        let exhausted = Some(Exhaustion { actions: 3, cells: 5, rests_on });
        let text = ExplorationSummary { exhausted, ..summary() }.to_string();
        let line = "exhausted each of 3 actions was tried from the start and from each of 5 cells; no proof, it rests on \
                    cells of size 1; states within one cell are taken as equal\n";
        assert!(text.contains("solution  none was found\n") && text.contains(line), "{text}");
    }

    #[test]
    fn a_solution_does_not_contradict_how_episodes_ended() {
        let solved = |ends| ExplorationSummary { solution_ticks: Some(12), ends, ..summary() }.to_string();
        let won = solved(EndCounts { won: 3, ..EndCounts::default() });
        assert!(won.contains("solution  12 ticks\n") && won.contains("3 won, 0 lost"), "{won}");
        let endless = solved(EndCounts::default());
        assert!(endless.contains("solution  12 ticks; episodes go on after it\n"), "{endless}");
        assert!(endless.ends_with("episodes  none has ended"), "{endless}");
    }

    #[test]
    fn the_last_value_up_to_a_tick_is_found_in_its_segment_only() {
        let mut store = SnapshotStore::new(9);
        store.add(1, 5, "early");
        store.add(1, 9, "late");
        store.add(2, 7, "elsewhere");
        assert_eq!(
            [4, 5, 8, 9, 99].map(|tick| store.last_up_to(1, tick)),
            [None, Some(&"early"), Some(&"early"), Some(&"late"), Some(&"late")]
        );
        assert_eq!((store.last_up_to(2, 7), store.last_up_to(0, 99)), (Some(&"elsewhere"), None));
    }

    #[test]
    fn the_oldest_values_are_dropped() {
        let mut store = SnapshotStore::new(2);
        store.add(1, 5, "a");
        store.add(1, 9, "b");
        store.add(2, 1, "c");
        assert_eq!((store.last_up_to(1, 5), store.last_up_to(1, 9)), (None, Some(&"b")));
        store.add(1, 9, "again");
        assert_eq!((store.last_up_to(1, 9), store.last_up_to(2, 1)), (Some(&"again"), Some(&"c")));
    }

    #[test]
    fn a_fault_names_game_level_and_tick_and_the_way_out() {
        let fault = SnapshotFault { game: "walk", level: 7, tick: Some(31) }.to_string();
        assert!(fault.starts_with("the snapshot of `walk` does not restore everything: level 7, tick 31. "), "{fault}");
        assert!(fault.ends_with("leave snapshots out with --no-snapshots"), "{fault}");
        let failed = SnapshotFault { game: "walk", level: 7, tick: None }.to_string();
        assert!(failed.contains("level 7: the game failed after a snapshot was loaded. "), "{failed}");
    }
}
