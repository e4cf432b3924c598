//! Parts of a level that cannot be reached.

use std::ops::ControlFlow;

use super::level_detector::{LevelDefect, LevelDetector, ShownBy, TestedLevel};
use crate::{
    detector::Setting,
    explore::{ExplorePlan, explore},
    game::Game,
};

/// A finding for tiles that an explorer does not reach, though no wall cuts them off from the start. It is opt-in,
/// because it is no proof and takes some seconds for each level.
pub struct UnreachableRegion {
    steps: f64,
    share: f64,
    every: f64,
}

/// Most tiles that are named.
const NAMED: usize = 4;

impl Default for UnreachableRegion {
    fn default() -> Self {
        Self { steps: 100_000.0, share: 0.05, every: 1.0 }
    }
}

impl UnreachableRegion {
    /// Returns the message about tiles that an explorer does not reach.
    fn missed(&self, game: &dyn Game, mode: &str, level: u64, stop: &dyn Fn() -> bool) -> Option<String> {
        // Without a plan, the open tiles are unknown.
        game.tools().levels.floor_plan(mode, level)?;
        let plan =
            ExplorePlan { steps: self.steps as u64, arenas: 8, worlds: 1, threads: 1, ..ExplorePlan::new(mode, level) };
        // Other detectors report a game that panics or does not replay.
        let go_on = |_| if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let found = explore(game, &plan, |_| {}, go_on).ok()?;
        let coverage = found.coverage().filter(|coverage| 1.0 - coverage > self.share)?;
        let missed: Vec<String> = found.missed().take(NAMED).map(ToString::to_string).collect();
        Some(format!(
            "an explorer of {} steps reached {:.0} % of the open tiles, and not {}",
            found.steps,
            100.0 * coverage,
            missed.join(" or ")
        ))
    }
}

impl LevelDetector for UnreachableRegion {
    fn name(&self) -> &'static str {
        "unreachable-region"
    }

    fn describe(&self) -> &'static str {
        "an explorer does not get to tiles that no wall cuts off"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("steps", &mut self.steps, "steps of the explorer on a level").at_least(1.0),
            Setting::new("share", &mut self.share, "share of the tiles that it may miss"),
            Setting::new("every", &mut self.every, "look at every n-th level of the range").at_least(1.0),
        ]
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        if !level.is_sample(self.every) {
            return Vec::new();
        }
        let missed = self.missed(level.game, level.mode, level.level, level.stop);
        missed.map(|message| LevelDefect { message, ..LevelDefect::default() }).into_iter().collect()
    }

    fn shown_by(&self) -> ShownBy {
        ShownBy::Level
    }

    fn is_in_level(&self, game: &dyn Game, mode: &str, level: u64) -> bool {
        self.missed(game, mode, level, &|| false).is_some()
    }
}
