//! What came of setting a tester on a subject.

use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use serde::{Deserialize, Serialize};

use crate::findings::{Breakage, Lengths};

/// What a tester found on a subject.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JobResult {
    /// The subject.
    pub subject: String,
    /// The tester.
    pub tester: String,
    /// Episodes in which the aim was reached; for an explorer, whether it found a way to it.
    pub solved: u64,
    /// All episodes; 1 for an explorer.
    pub episodes: u64,
    /// Whether the tester drew no random number.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub exact: bool,
    /// How each episode ended, and after how many ticks: `won 83`, `lost 12`, `time up 1000` or `broken`.
    pub ends: Vec<String>,
    /// Mean total reward of the episodes; of explorers, and where one is no number, none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reward: Option<f64>,
    /// What detectors found, and how the game broke.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<JobFinding>,
    /// Why nobody can solve the level, if that was proved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unsolvable: Option<String>,
    /// Actions that do something in the whole episode of the first finding that can be played again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub played: Option<u32>,
    /// Those of them up to the tick of the finding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub original: Option<u32>,
    /// The same after all that it does not need was left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimised: Option<u32>,
    /// Seconds that the job took, without that.
    pub seconds: f64,
    /// Seconds until the first finding or the proof.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub found_after: Option<f64>,
    /// Seconds until the end of the first episode without the aim.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed_after: Option<f64>,
}

/// Something that a tester found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobFinding {
    /// What found it.
    pub detector: String,
    /// Tick of the episode, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u32>,
    /// What is wrong.
    pub message: String,
}

impl JobResult {
    /// Whether the aim was reached in every episode.
    pub fn is_solved(&self) -> bool {
        self.episodes > 0 && self.solved == self.episodes
    }

    /// The game broke before anybody could play, or outside of its ticks.
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

    /// The same with the lengths of a finding that was made shorter.
    #[must_use]
    pub(super) fn with_lengths(self, lengths: Option<Lengths>) -> Self {
        let of = |length: fn(Lengths) -> u32| lengths.map(length);
        let (played, original) = (of(|lengths| lengths.played), of(|lengths| lengths.original));
        Self { played, original, minimised: of(|lengths| lengths.minimised), ..self }
    }

    /// The same without what is measured with a clock.
    #[must_use]
    pub fn without_times(&self) -> Self {
        Self { seconds: 0.0, found_after: None, failed_after: None, ..self.clone() }
    }
}

/// Mean total reward of episodes; `None` if there are none, one broke, or one has no number for a reward.
pub(super) fn mean_reward(ends: &[Option<EpisodeResult>]) -> Option<f64> {
    let rewards: Option<Vec<f64>> = ends.iter().map(|end| end.as_ref().map(|end| end.total_reward)).collect();
    let mean = rewards.map(|rewards| rewards.iter().sum::<f64>() / rewards.len() as f64);
    mean.filter(|mean| mean.is_finite())
}

/// How an episode ended, in words.
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
