//! What the testers say of one level.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{finish_time::FinishTime, fisher::Trials, level_maps::LevelMaps, places::Places};
use crate::proof::LevelProof;

/// What became of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LevelOutcome {
    /// The aim cannot be reached, and that is proved.
    ProvedUnsolvable,
    /// No tester reached the aim, which proves nothing.
    BotFailed,
    /// A tester reached the aim at least once.
    Solved,
}

impl LevelOutcome {
    /// As files and people have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::ProvedUnsolvable => "proved-unsolvable",
            Self::BotFailed => "bot-failed",
            Self::Solved => "solved",
        }
    }
}

/// How episodes ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Episodes that reached the aim.
    pub solved: u64,
    /// All episodes.
    pub episodes: u64,
    /// 95 % Wilson interval of the share of solved episodes.
    pub interval: [f64; 2],
    /// Ticks of the solved episodes, if there are any.
    pub ticks: Option<FinishTime>,
    /// Episodes that the game ended without the aim.
    pub lost: u64,
    /// Episodes that ended since time was up.
    pub timed_out: u64,
    /// Episodes in which the game broke, each of which is a finding.
    pub broken: u64,
}

impl Score {
    /// Solved among all.
    pub fn trials(&self) -> Trials {
        Trials { successes: self.solved, trials: self.episodes }
    }
}

/// Where episodes ended without the aim, rounded to a square of the level's floor plan.
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
    /// How often each cause ended one there, if the game says.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub causes: BTreeMap<String, u64>,
}

/// How a tester did on a level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TesterVerdict {
    /// Name of the tester.
    pub tester: String,
    /// Its episodes.
    #[serde(flatten)]
    pub score: Score,
    /// Whether it drew no random number in any of them: it does the same each time, whatever the seed.
    pub exact: bool,
    /// What it visited in all its episodes, for levels with maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub places: Option<Places>,
}

/// Something that is wrong with a level or with the game in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// What found it: `panic`, `fault`, `endless`, `unreachable-goal`, or the name of a [detector](crate::detectors).
    pub detector: String,
    /// Who played; `None` if nobody had to.
    pub tester: Option<String>,
    /// Episode of that tester on the level, from 0.
    pub episode: Option<u32>,
    /// Tick of the episode, from 0.
    pub tick: Option<u32>,
    /// What is wrong.
    pub message: String,
    /// Its file, seen from the folder of the results: see [`findings`](crate::findings).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Settings, as `name.key=value`, with which its file looks for it again beside those of the test: see
    /// [`LevelDefect::settings`](crate::detectors::LevelDefect::settings). Results have none.
    #[serde(skip)]
    pub settings: Vec<String>,
}

/// Everything about one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelVerdict {
    /// Its name, such as `hard:7`.
    pub level: String,
    /// Its place in the range, from 0.
    pub index: u64,
    /// What became of it.
    pub outcome: LevelOutcome,
    /// What is certain of it. A level that was solved is solvable.
    pub proof: LevelProof,
    /// All episodes of all testers.
    #[serde(flatten)]
    pub score: Score,
    /// Where episodes ended without the aim, if the game says.
    pub ends: Vec<EndPlace>,
    /// How often each cause ended an episode without the aim, if the game says.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub causes: BTreeMap<String, u64>,
    /// What all testers together visited, for levels with maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub places: Option<Places>,
    /// Where agents went, for levels with maps: see [`MapScope`](super::MapScope).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maps: Option<LevelMaps>,
    /// Each tester, in the order of the plan.
    pub testers: Vec<TesterVerdict>,
    /// What is wrong, if anything.
    pub findings: Vec<Finding>,
}

impl LevelVerdict {
    /// Whether it was solved and nothing was found.
    pub fn is_sound(&self) -> bool {
        self.outcome == LevelOutcome::Solved && self.findings.is_empty()
    }

    /// Whether it is sound and was solved in every episode.
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
