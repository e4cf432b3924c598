//! Verdicts of the testers on one level.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{finish_time::FinishTime, fisher::Trials, level_maps::LevelMaps, places::Places};
use crate::proof::LevelProof;

/// Outcome of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LevelOutcome {
    /// The goal cannot be reached, which is proved.
    ProvedUnsolvable,
    /// No tester reached the goal, which proves nothing.
    BotFailed,
    /// A tester reached the goal at least once.
    Solved,
}

impl LevelOutcome {
    /// Returns the name in files and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::ProvedUnsolvable => "proved-unsolvable",
            Self::BotFailed => "bot-failed",
            Self::Solved => "solved",
        }
    }
}

/// Ends of episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Episodes that reached the goal.
    pub solved: u64,
    /// All episodes.
    pub episodes: u64,
    /// 95 % Wilson interval of the share of solved episodes.
    pub interval: [f64; 2],
    /// Ticks of the solved episodes, if there are any.
    pub ticks: Option<FinishTime>,
    /// Episodes that the game ended without the goal.
    pub lost: u64,
    /// Episodes that ended because time was up.
    pub timed_out: u64,
    /// Episodes in which the game broke, each of which is a finding.
    pub broken: u64,
}

impl Score {
    /// Returns the solved episodes among all.
    pub fn trials(&self) -> Trials {
        Trials { successes: self.solved, trials: self.episodes }
    }
}

/// Ends of episodes without the goal in one square of the level's floor plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EndPlace {
    /// Middle of the square, in the units of the floor plan.
    pub x: f32,
    /// Middle of the square.
    pub y: f32,
    /// Episodes that were lost there.
    pub lost: u64,
    /// Episodes whose time was up there.
    pub timed_out: u64,
    /// How often each cause ended an episode there, if the game reports it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub causes: BTreeMap<String, u64>,
}

/// Results of a tester on a level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TesterVerdict {
    /// Name of the tester.
    pub tester: String,
    /// Its episodes.
    #[serde(flatten)]
    pub score: Score,
    /// True if it drew no random number in any of them: it repeats itself under any seed.
    pub exact: bool,
    /// Open squares that it visited in all its episodes, for levels with maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub places: Option<Places>,
}

/// A defect of a level, or of the game in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Its detector: `panic`, `fault`, `endless`, `unreachable-goal`, or the name of a [detector](crate::detectors).
    pub detector: String,
    /// The tester that played; `None` if it was found without play.
    pub tester: Option<String>,
    /// Episode of that tester on the level, from 0.
    pub episode: Option<u32>,
    /// Tick of the episode, from 0.
    pub tick: Option<u32>,
    /// The message.
    pub message: String,
    /// Its file, relative to the folder of the results: see [`findings`](crate::findings).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Settings, as `name.key=value`, for the search of its file beside those of the test: see
    /// [`LevelDefect::settings`](crate::detectors::LevelDefect::settings). Results have none.
    #[serde(skip)]
    pub settings: Vec<String>,
}

/// All results of one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelVerdict {
    /// Its name, such as `hard:7`.
    pub level: String,
    /// Its index in the range, from 0.
    pub index: u64,
    /// Its outcome.
    pub outcome: LevelOutcome,
    /// Proof about the level. A level that was solved is solvable.
    pub proof: LevelProof,
    /// All episodes of all testers.
    #[serde(flatten)]
    pub score: Score,
    /// Positions of episodes that ended without the goal, if the game reports them.
    pub ends: Vec<EndPlace>,
    /// How often each cause ended an episode without the goal, if the game reports causes.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub causes: BTreeMap<String, u64>,
    /// Open squares that all testers together visited, for levels with maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub places: Option<Places>,
    /// Maps of where agents went, for levels with maps: see [`MapScope`](super::MapScope).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maps: Option<LevelMaps>,
    /// Each tester, in the order of the plan.
    pub testers: Vec<TesterVerdict>,
    /// Findings.
    pub findings: Vec<Finding>,
}

impl LevelVerdict {
    /// Returns whether it was solved and has no finding.
    pub fn is_sound(&self) -> bool {
        self.outcome == LevelOutcome::Solved && self.findings.is_empty()
    }

    /// Returns whether it was solved in every episode and has no finding.
    pub fn is_perfect(&self) -> bool {
        self.is_sound() && self.score.solved == self.score.episodes
    }
}

#[cfg(test)]
mod tests {
    use crate::verdict::{LevelMaps, LevelVerdict, Places, testing::verdict};

    #[test]
    fn older_results_are_read_and_newer_ones_read_back() {
        let old = serde_json::to_string(&verdict(3, 1, 2)).expect("serialises");
        for name in ["maps", "places", "causes"] {
            assert!(!old.contains(name), "{old}");
        }
        assert_eq!(serde_json::from_str::<LevelVerdict>(&old).expect("whole"), verdict(3, 1, 2));
        let places = Some(Places { visited: 3, open: 9 });
        let maps = Some(LevelMaps { x: -0.1, side: 0.3, visits: vec![[4, 70]], ..LevelMaps::default() });
        let new = LevelVerdict { places, maps, causes: [("saw".to_owned(), 1)].into(), ..verdict(3, 1, 2) };
        let text = serde_json::to_string(&new).expect("serialises");
        assert_eq!(serde_json::from_str::<LevelVerdict>(&text).expect("whole"), new);
    }
}
