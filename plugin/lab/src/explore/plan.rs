//! The plan of an exploration.

use bevy_playbot::{fault::Fault, vision::ObservationConfig};

use super::{error::ExploreError, explorer::Explorer, until::Until};
use crate::{game::Game, parallel::default_threads, split::LevelSplit};

/// The plan of an exploration of a level. All fields but the threads affect the result.
#[derive(Clone)]
pub struct ExplorePlan {
    /// Mode of the game.
    pub mode: String,
    /// Number of the level.
    pub level: u64,
    /// Environment steps to use, with the paths back. A visit that finds something new may go on a little longer.
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
