//! The result of a tester on a subject.

use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use serde::{Deserialize, Serialize};

use crate::findings::{Breakage, Lengths};

/// The result of a tester on a subject.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JobResult {
    /// The subject.
    pub subject: String,
    /// The tester.
    pub tester: String,
    /// Episodes in which the goal was reached; for an explorer, 1 if it found a path to it.
    pub solved: u64,
    /// All episodes; 1 for an explorer.
    pub episodes: u64,
    /// Whether the tester used no random number.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub exact: bool,
    /// The end of each episode and its tick: `won 83`, `lost 12`, `time up 1000` or `broken`.
    pub ends: Vec<String>,
    /// Mean total reward of the episodes. `None` for explorers, and if a reward is not a number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reward: Option<f64>,
    /// Findings of the detectors, and panics of the game.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<JobFinding>,
    /// Why the level is unsolvable, if that was proved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unsolvable: Option<String>,
    /// Actions with an effect in the whole episode of the first finding that can be replayed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub played: Option<u32>,
    /// Actions with an effect up to the tick of the finding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub original: Option<u32>,
    /// Actions that are left after minimisation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimised: Option<u32>,
    /// Seconds that the job took, without minimisation.
    pub seconds: f64,
    /// Seconds until the first finding or the proof.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub found_after: Option<f64>,
    /// Seconds until the end of the first episode that did not reach the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed_after: Option<f64>,
}

/// A finding of a tester.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobFinding {
    /// Name of the detector.
    pub detector: String,
    /// Tick of the episode, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u32>,
    /// The message.
    pub message: String,
}

impl JobResult {
    /// Returns whether the goal was reached in every episode.
    pub fn is_solved(&self) -> bool {
        self.episodes > 0 && self.solved == self.episodes
    }

    /// Creates the result of a game that panicked before the first tick, or outside of its ticks.
    pub(super) fn broken(broken: Breakage, seconds: f64) -> Self {
        let Breakage { detector, tick: _, message } = broken;
        Self {
            episodes: 1,
            ends: vec![end_of(None)],
            findings: vec![JobFinding { detector: detector.to_owned(), tick: None, message }],
            seconds,
            found_after: Some(seconds),
            failed_after: Some(seconds),
            ..Self::default()
        }
    }

    /// Adds the lengths of a minimised finding.
    #[must_use]
    pub(super) fn with_lengths(self, lengths: Option<Lengths>) -> Self {
        let of = |length: fn(Lengths) -> u32| lengths.map(length);
        let (played, original) = (of(|lengths| lengths.played), of(|lengths| lengths.original));
        Self { played, original, minimised: of(|lengths| lengths.minimised), ..self }
    }

    /// Returns the result without its times.
    #[must_use]
    pub fn without_times(&self) -> Self {
        Self { seconds: 0.0, found_after: None, failed_after: None, ..self.clone() }
    }
}

/// Returns the mean total reward of episodes; `None` if there are no episodes, one broke, or a reward is not a number.
pub(super) fn mean_reward(ends: &[Option<EpisodeResult>]) -> Option<f64> {
    let rewards: Option<Vec<f64>> = ends.iter().map(|end| end.as_ref().map(|end| end.total_reward)).collect();
    let mean = rewards.map(|rewards| rewards.iter().sum::<f64>() / rewards.len() as f64);
    mean.filter(|mean| mean.is_finite())
}

/// Returns the end of an episode in words.
pub(super) fn end_of(result: Option<&EpisodeResult>) -> String {
    let Some(result) = result else { return "broken".to_owned() };
    let how = match result.end {
        _ if result.success => "won",
        EpisodeEnd::Truncated => "time up",
        EpisodeEnd::Terminated { .. } => "lost",
    };
    format!("{how} {}", result.ticks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_told_apart() {
        let result =
            EpisodeResult { level: 3, end: EpisodeEnd::LOST, success: false, ticks: 9, clipped: 0, total_reward: 0.0 };
        let late = EpisodeResult { end: EpisodeEnd::Truncated, ..result };
        let won = EpisodeResult { end: EpisodeEnd::Truncated, success: true, ..result };
        let ends = [Some(&result), Some(&late), Some(&won), None].map(end_of);
        assert_eq!(ends, ["lost 9", "time up 9", "won 9", "broken"]);
    }

    #[test]
    fn a_mean_needs_a_number_of_each_episode() {
        let of = |total_reward| {
            let (end, success) = (EpisodeEnd::LOST, false);
            Some(EpisodeResult { level: 3, end, success, ticks: 9, clipped: 0, total_reward })
        };
        assert_eq!(mean_reward(&[of(3.0), of(-1.0)]), Some(1.0));
        for ends in [vec![], vec![of(3.0), None], vec![of(3.0), of(f64::NAN)], vec![of(f64::INFINITY)]] {
            assert_eq!(mean_reward(&ends), None, "{ends:?}");
        }
    }

    #[test]
    fn a_short_result_has_a_short_line() {
        let result = JobResult {
            subject: "garden bed:3".to_owned(),
            tester: "random".to_owned(),
            solved: 1,
            episodes: 1,
            ends: vec!["won 9".to_owned()],
            seconds: 0.5,
            ..JobResult::default()
        };
        let text = serde_json::to_string(&result).expect("serialises");
        let expected =
            r#"{"subject":"garden bed:3","tester":"random","solved":1,"episodes":1,"ends":["won 9"],"seconds":0.5}"#;
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<JobResult>(&text).expect("reads back"), result);
        assert!(result.is_solved() && !JobResult::default().is_solved());
    }
}
