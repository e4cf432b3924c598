//! The summary of an exploration.

use std::{collections::BTreeSet, fmt};

use serde::Serialize;

use super::exploration::{EndCounts, Exploration, Stop};
use crate::game::Game;

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
            ends: self.ends,
            curve: self.curve.clone(),
        }
    }
}

impl fmt::Display for ExplorationSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { game, mode, level, explorer, steps, visits, cells, ends, .. } = self;
        writeln!(f, "{game} {mode}:{level}, explored by {explorer} in {steps} steps and {visits} visits")?;
        match (self.open_cells, self.open_cells_reached, self.coverage) {
            (Some(open), Some(reached), Some(coverage)) => {
                write!(f, "cells     {reached} of {open} open cells ({:.1} %)", 100.0 * coverage)?;
                match self.other_cells {
                    Some(others) if others > 0 => writeln!(f, ", {others} more")?,
                    _ => writeln!(f)?,
                }
            }
            _ => writeln!(f, "cells     {cells}")?,
        }
        match (self.solution_ticks, self.has_goal) {
            (Some(ticks), _) if ends.won == 0 => writeln!(f, "solution  {ticks} ticks; episodes go on after it")?,
            (Some(ticks), _) => writeln!(f, "solution  {ticks} ticks")?,
            (None, true) => writeln!(f, "solution  none was found")?,
            (None, false) => writeln!(f, "solution  none was found, and no goal is known")?,
        }
        if *ends == EndCounts::default() {
            return write!(f, "episodes  none has ended");
        }
        write!(f, "episodes  {} won, {} lost, {} out of time", ends.won, ends.lost, ends.out_of_time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            ends: EndCounts { won: 0, lost: 2, out_of_time: 1 },
            curve: vec![(3000, 30)],
        }
    }

    #[test]
    fn people_read_coverage_and_solution() {
        let text = summary().to_string();
        for words in [
            "walk easy:7",
            "cells     24 of 40 open cells (60.0 %), 6 more\n",
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
    fn a_solution_does_not_contradict_how_episodes_ended() {
        let solved = |ends| ExplorationSummary { solution_ticks: Some(12), ends, ..summary() }.to_string();
        let won = solved(EndCounts { won: 3, ..EndCounts::default() });
        assert!(won.contains("solution  12 ticks\n") && won.contains("3 won, 0 lost"), "{won}");
        let endless = solved(EndCounts::default());
        assert!(endless.contains("solution  12 ticks; episodes go on after it\n"), "{endless}");
        assert!(endless.ends_with("episodes  none has ended"), "{endless}");
    }
}
