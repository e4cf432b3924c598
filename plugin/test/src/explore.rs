//! Exploring a level without training and without knowledge of the game: Go-Explore (Ecoffet et al. 2021, "First
//! return, then explore") over exact replay.
//!
//! An archive holds the reached [`ExploredCell`]s, each with the shortest known path to it. Each visit draws a rarely
//! seen cell, returns to it, and explores from there. A game need not store its state: it must be deterministic, so the
//! level and the actions restore it. A game that is not deterministic causes an error at the first tick that differs.
//! A game that saves its state ([`SnapshotTools`](playbot_harness::game::SnapshotTools)) returns at once, with the same
//! result.
//!
//! Games with positions ([`StateTools::position`](playbot_harness::game::StateTools::position)) have a grid of cells
//! over the level. Others have cells of their own
//! ([`StateTools::explore_cell`](playbot_harness::game::StateTools::explore_cell)), or else cells of rounded
//! observations.
//!
//! ```no_run
//! use std::ops::ControlFlow;
//!
//! use playbot_harness::prelude::*;
//! use playbot_test::explore::{ExplorePlan, explore};
//! # fn example(game: &dyn Game) -> Result<(), Box<dyn std::error::Error>> {
//! let plan = ExplorePlan { steps: 100_000, ..ExplorePlan::new("easy", 7) };
//! let found = explore(game, &plan, |_| {}, |_| ControlFlow::Continue(()))?;
//! println!("{}", found.summary(game));
//! if let Some(solution) = found.solution() {
//!     println!("solved in {} ticks", solution.len());
//! }
//! # Ok(())
//! # }
//! ```
//!
//! The files of the folder, in reading order:
//!
//! - `round`: [`explore`], and the check of a requested cell.
//! - `cell`: the cells, and the grid over a level.
//! - `archive`: the archive, and one visit.
//! - `known_paths`: the paths to cells, their replay, snapshots on them, and the summary.
//! - `tried`: the actions that were tried from each cell.
//! - `played`: the cells that a player reaches in episodes of its own.

mod archive;
mod cell;
mod known_paths;
mod played;
pub mod round;
mod tried;

use crate::explore::archive::Archive;
use bevy::prelude::*;
use bevy_playbot::{
    demo::{file::DemoFileError, replay::Divergence},
    episode::{EpisodeEnd, EpisodeResult},
    fault::Fault,
    policy::{ActionDraw, ActivePolicy},
    skill_prior::SkillPrior,
    unknown_name::UnknownName,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{eval::EvalError, game::Game, mode::ModeError, parallel::default_threads, split::LevelSplit};
use playbot_learner::{HasExitCode, Policy};
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    str::FromStr,
};
use thiserror::Error;

pub(crate) use crate::explore::cell::{cells_between, reach};
pub use crate::explore::{
    archive::ReachedCell,
    cell::{CellGrid, ExploredCell, NoCell},
    known_paths::{ExplorationSummary, Route, SnapshotFault, follow_route, record_route},
    played::{PlayedCells, PlayedSummary},
    round::{Round, check_cell, explore, explore_until, open_cells},
    tried::Exhaustion,
};

/// The plan of an exploration of a level. All fields but the threads affect the result.
#[derive(Clone)]
pub struct ExplorePlan {
    /// Mode of the game.
    pub mode: String,
    /// Number of the level.
    pub level: u64,
    /// Environment steps to use, with the paths back. A round begins with visits of `explore_ticks` for which there are
    /// steps, and each that goes on finding cells takes up to ten times as many. So the last round may take up to 9 ×
    /// `batch` × `explore_ticks` more.
    pub steps: u64,
    /// The condition that ends the exploration sooner.
    pub until: Until,
    /// The explorer.
    pub explorer: Explorer,
    /// The observation of the explorer's policy. Random actions need only vectors, which are cheaper.
    pub observation_config: ObservationConfig,
    /// Ticks that a visit explores without a find before it ends. Each find gives it as many again, up to ten times as
    /// many in all.
    pub explore_ticks: u32,
    /// Probability with which a random action is repeated in the next tick.
    pub sticky: f64,
    /// Side of a cell. For a grid it is in the units of positions, by default the tiles of the floor plan. For
    /// observations it is the step of rounding, by default 1/8. Games with cells of their own ignore it.
    pub cell_size: Option<f32>,
    /// Visits between two updates of the archive.
    pub batch: u32,
    /// Random seed.
    pub seed: u64,
    /// Arenas that are played side by side, spread evenly over the Worlds.
    pub arenas: u32,
    /// Worlds.
    pub worlds: u32,
    /// Threads. They change no result.
    pub threads: usize,
    /// Whether the actions before a panic of the game are written to a file.
    pub keeps_panics: bool,
    /// Whether random actions go on from snapshots, if the game has them. They change no result, unless a snapshot
    /// forgets something that no comparison shows.
    pub snapshots: bool,
}

impl ExplorePlan {
    /// Creates the default plan for a level: random actions that last for 20 ticks on average, and 500,000 steps.
    pub fn new(mode: impl Into<String>, level: u64) -> Self {
        Self {
            mode: mode.into(),
            level,
            steps: 500_000,
            until: Until::default(),
            explorer: Explorer::default(),
            observation_config: ObservationConfig::default(),
            explore_ticks: 100,
            sticky: 0.95,
            cell_size: None,
            batch: 32,
            seed: 0,
            arenas: 16,
            worlds: 4,
            threads: default_threads(),
            keeps_panics: true,
            snapshots: true,
        }
    }

    /// Checks that a game can be explored with this plan.
    ///
    /// # Errors
    ///
    /// The game cannot be played, has no such level, or a number is out of range.
    pub fn check(&self, game: &dyn Game) -> Result<(), ExploreError> {
        if let Some(problem) = game.problem() {
            return Err(Fault(problem).into());
        }
        LevelSplit { mode: self.mode.clone(), first: self.level, last: self.level }.check(game)?;
        let wrong = |why: String| Err(ExploreError::Plan(why));
        if self.steps == 0 || self.explore_ticks == 0 || self.batch == 0 {
            return wrong("an exploration needs at least one step, a visit one tick, and a round one visit".to_owned());
        }
        if !(0.0..=1.0).contains(&self.sticky) {
            return wrong(format!(
                "the probability with which an action is repeated is {}: write a number from 0 to 1",
                self.sticky
            ));
        }
        match self.cell_size {
            Some(size) if !(size.is_finite() && size > 0.0) => {
                wrong(format!("the size of a cell is {size}: write a number above 0, in the units of the level"))
            }
            _ => Ok(()),
        }
    }
}

/// The condition that ends an exploration before its budget does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Until {
    /// A solution.
    Solved,
    /// A solution, if the level has a goal, and all open cells, if they are known.
    #[default]
    Covered,
    /// Every action was tried from every cell: see [`Exploration::exhausted`].
    Exhausted,
    /// No condition: shorter paths are searched for until the budget is used up.
    Spent,
}

impl Until {
    const ALL: [Self; 4] = [Self::Solved, Self::Covered, Self::Exhausted, Self::Spent];

    fn name(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::Covered => "covered",
            Self::Exhausted => "exhausted",
            Self::Spent => "spent",
        }
    }
}

impl fmt::Display for Until {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Until {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let known = Self::ALL.into_iter().find(|until| until.name() == name);
        known.ok_or_else(|| UnknownName::new("end of an exploration", name, &Self::ALL.map(Self::name)))
    }
}

/// The player that explores from a cell.
#[derive(Clone, Default)]
#[allow(clippy::large_enum_variant, reason = "one per exploration")]
pub enum Explorer {
    /// Uniformly random actions, each repeated with the plan's probability: no training, and no knowledge of the game.
    #[default]
    Random,
    /// A policy, with skills if it has any.
    Policy {
        /// The policy.
        policy: Policy,
        /// The source of its skills.
        prior: Option<SkillPrior>,
        /// How actions are drawn.
        draw: ActionDraw,
    },
}

impl Explorer {
    /// Creates an explorer with skills drawn from a prior, and played by a decoder.
    pub fn skills(prior: SkillPrior, decoder: Policy) -> Self {
        Self::Policy { policy: decoder, prior: Some(prior), draw: ActionDraw::Sample }
    }

    /// Returns its kind in words.
    pub fn describe(&self) -> &'static str {
        match self {
            Self::Random => "random actions",
            Self::Policy { prior: Some(_), .. } => "skills",
            Self::Policy { prior: None, .. } => "a policy",
        }
    }

    /// Returns whether a policy decides.
    fn is_policy(&self) -> bool {
        matches!(self, Self::Policy { .. })
    }

    /// Installs the explorer's networks in a World, once.
    fn install(&self, world: &mut World) {
        if let Self::Policy { policy, prior, draw } = self {
            ActivePolicy { policy: policy.clone(), draw: *draw }.install(world, prior.clone());
        }
    }
}

/// Cells with the shortest known paths to them, and further results on a level.
pub struct Exploration {
    /// Mode of the game.
    pub mode: String,
    /// Number of the level.
    pub level: u64,
    /// Random seed.
    pub seed: u64,
    /// Name of the explorer.
    pub explorer: &'static str,
    /// Environment steps, with the paths back. A path back counts in full if a snapshot saves it, too, so that a budget
    /// leads equally far.
    pub steps: u64,
    /// Steps of these that were not played, because snapshots restored them.
    pub restored_steps: u64,
    /// The difference that made the exploration do without snapshots, if there was one.
    pub snapshot_fault: Option<SnapshotFault>,
    /// Why the game has saved or loaded no snapshot, if there is a reason to name.
    pub snapshot_obstacle: Option<String>,
    /// Visits.
    pub visits: u64,
    /// Ends of their episodes.
    pub ends: EndCounts,
    /// Steps and cells after each round.
    pub curve: Vec<(u64, u64)>,
    /// The reason why it ended.
    pub stop: Stop,
    /// The squares of the cells; `None` if cells are not positions.
    pub grid: Option<CellGrid>,
    /// Whether the level is known to have a goal, by its floor plan.
    pub has_goal: bool,
    /// The cells that no wall cuts off from the start, if cells are positions and there is a floor plan: see
    /// [`open_cells`].
    pub open: Option<BTreeSet<ExploredCell>>,
    /// Whether every discrete action was tried from every cell in which the episode goes on, and no other cell came up.
    /// `None` if some are left, for continuous actions, and for games that keep no
    /// [`StateHash`](bevy_playbot::state_hash::StateHash), whose replays prove nothing.
    pub exhausted: Option<Exhaustion>,
    archive: Archive,
}

impl Exploration {
    /// Returns all cells that were reached, in their order.
    pub fn cells(&self) -> &BTreeMap<ExploredCell, ReachedCell> {
        self.archive.cells()
    }

    /// Returns the shortest known path to a cell, with the state hash after each tick. The last hash is that on
    /// arrival, or that after a cell that is only passed.
    pub fn route_to(&self, cell: &ExploredCell) -> Option<Route> {
        self.archive.route_to(cell)
    }

    /// Returns the shortest known path to the level's goal.
    pub fn solution(&self) -> Option<Route> {
        self.archive.solution().map(|path| self.archive.route(path))
    }

    /// Returns the ticks of the [`solution`](Self::solution).
    pub fn solution_ticks(&self) -> Option<u32> {
        self.archive.solution().map(|path| path.ticks)
    }

    /// Returns the open cells that were not reached.
    pub fn missed(&self) -> impl Iterator<Item = &ExploredCell> {
        self.open.iter().flatten().filter(move |cell| !self.cells().contains_key(cell))
    }

    /// Returns how many of the open cells were reached; `None` if the open cells are unknown.
    pub fn open_reached(&self) -> Option<usize> {
        Some(self.open.as_ref()?.len() - self.missed().count())
    }

    /// Returns the share of the open cells that were reached; `None` if the open cells are unknown.
    pub fn coverage(&self) -> Option<f64> {
        let open = self.open.as_ref().map(BTreeSet::len)?;
        Some(self.open_reached()? as f64 / open.max(1) as f64)
    }
}

/// The reason why an exploration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The budget is used up.
    Spent,
    /// A solution was found.
    Solved,
    /// All open cells were reached, and a solution was found if the level has a goal.
    Covered,
    /// Every action was tried from every cell.
    Exhausted,
    /// The caller stopped it.
    Asked,
}

/// Counts of the ends of episodes, without visits that just stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct EndCounts {
    /// Terminated at the goal.
    pub won: u64,
    /// Terminated elsewhere.
    pub lost: u64,
    /// Truncated by the time limit.
    pub out_of_time: u64,
}

impl EndCounts {
    fn count(&mut self, end: Option<EpisodeResult>) {
        match end.map(|end| end.end) {
            Some(EpisodeEnd::Terminated { success: true }) => self.won += 1,
            Some(EpisodeEnd::Terminated { success: false }) => self.lost += 1,
            Some(EpisodeEnd::Truncated) => self.out_of_time += 1,
            None => {}
        }
    }
}

/// The reason why a level cannot be explored.
#[derive(Debug, Error)]
pub enum ExploreError {
    /// The plan is invalid; the text says what to do.
    #[error("{0}")]
    Plan(String),
    /// The game has no such level.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The pictures that the explorer's policy reads cannot be drawn.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The game does not repeat an episode from the same actions.
    #[error(
        "the path back to a cell does not replay: {divergence}. Explorers return by the same actions, but \
         `{game}` does not repeat them: `playbot doctor {game} --mode {mode} --level {}` names what differs", divergence.level
    )]
    Diverged {
        /// Name of the game.
        game: &'static str,
        /// The mode.
        mode: String,
        /// The first difference from the known path.
        divergence: Divergence,
    },
    /// A player's own episodes could not be played.
    #[error(transparent)]
    Played(#[from] EvalError),
    /// A path could not be recorded.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
}

impl HasExitCode for ExploreError {
    fn exit_code(&self) -> u8 {
        match self {
            // The game is at fault, and the message says what to do.
            Self::Fault(_) | Self::Diverged { .. } => 2,
            Self::Demo(error) => error.exit_code(),
            Self::Played(error) => error.exit_code(),
            Self::Plan(_) | Self::Mode(_) | Self::Vision(_) => 3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_read_back_and_others_are_refused_with_the_nearest() {
        for until in Until::ALL {
            assert_eq!(until.to_string().parse(), Ok(until));
        }
        let error = "solvd".parse::<Until>().expect_err("no such end").to_string();
        assert!(error.contains("did you mean `solved`?"), "{error}");
    }
}
