//! The assertions about levels.

use crate::verdict::{LevelOutcome, LevelVerdict};

/// The finding that a goal is out of reach. It says nothing about determinism.
const UNREACHABLE: &str = "unreachable-goal";

/// An assertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// At least one tester reaches the goal.
    Solvable,
    /// Every tester reaches the goal in every episode.
    Solved,
    /// Nothing is found.
    NoFindings,
    /// Episodes are the same again.
    Deterministic,
    /// No condition: the caller reads the verdicts.
    Nothing,
}

impl Wanted {
    /// Returns whether the assertion holds for a level.
    pub fn holds(self, level: &LevelVerdict) -> bool {
        match self {
            Self::Solvable => level.outcome == LevelOutcome::Solved,
            Self::Solved => {
                level.score.episodes > 0
                    && level.testers.iter().all(|tester| tester.score.solved == tester.score.episodes)
            }
            Self::NoFindings => level.findings.is_empty(),
            // A panic hides whether the episode would repeat.
            Self::Deterministic => level.findings.iter().all(|finding| finding.detector == UNREACHABLE),
            Self::Nothing => false,
        }
    }

    /// Returns the headline for this number of broken levels.
    pub fn complaint(self, broken: usize, levels: u64) -> String {
        let was = if broken == 1 { "was" } else { "were" };
        let of = format!("{broken} of {levels} level{}", if levels == 1 { "" } else { "s" });
        match self {
            Self::Solvable => format!("{of} {was} not solved by any tester"),
            Self::Solved => format!("{of} {was} not solved by every tester in every episode"),
            Self::NoFindings => format!("something was found on {of}"),
            Self::Deterministic => format!("{of} did not play the same again"),
            Self::Nothing => of,
        }
    }

    /// Returns whether an unsolved episode is a failure.
    pub fn is_about_solving(self) -> bool {
        matches!(self, Self::Solvable | Self::Solved)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Two testers with two episodes each, and the solved ones of each.
    fn level(solved: [u64; 2], found: &[&str]) -> LevelVerdict {
        let score = |solved: u64, episodes: u64| {
            json!({
                "solved": solved, "episodes": episodes, "interval": [0.0, 1.0], "ticks": null,
                "lost": episodes - solved, "timed_out": 0, "broken": 0,
            })
        };
        let all = solved[0] + solved[1];
        let mut level = score(all, 4);
        level["level"] = "hard:0".into();
        level["index"] = 0.into();
        level["outcome"] = if all > 0 { "solved".into() } else { "bot-failed".into() };
        level["proof"] = "unknown".into();
        level["ends"] = json!([]);
        let testers = ["a", "b"].into_iter().zip(solved).map(|(name, solved)| {
            let mut tester = score(solved, 2);
            tester["tester"] = name.into();
            tester["exact"] = true.into();
            tester
        });
        level["testers"] = testers.collect();
        let finding = |detector: &&str| {
            let nobody = json!(null);
            json!({ "detector": detector, "tester": nobody, "episode": nobody, "tick": nobody, "message": "" })
        };
        level["findings"] = found.iter().map(finding).collect();
        serde_json::from_value(level).expect("a verdict")
    }

    #[test]
    fn each_assertion_asks_for_something_else() {
        let all = [Wanted::Solvable, Wanted::Solved, Wanted::NoFindings, Wanted::Deterministic];
        let holds = |level: &LevelVerdict| all.map(|wanted| wanted.holds(level));
        assert_eq!(holds(&level([2, 2], &[])), [true; 4]);
        assert_eq!(holds(&level([2, 1], &[])), [true, false, true, true]);
        assert_eq!(holds(&level([0, 0], &["stuck"])), [false; 4]);
        assert_eq!(holds(&level([0, 0], &[UNREACHABLE])), [false, false, false, true]);
        assert!(!Wanted::Nothing.holds(&level([2, 2], &[])), "all are asked for");
        assert_eq!(Wanted::Solvable.complaint(1, 3), "1 of 3 levels was not solved by any tester");
    }
}
