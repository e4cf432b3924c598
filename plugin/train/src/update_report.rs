//! The report of one update of training, and the tags of its numbers.

use playbot_learner::LearnerMetrics;
use serde::Serialize;

/// Tag of the success rate of the last 100 episodes.
pub const SUCCESS_RATE: &str = "charts/success_rate";

/// Tag of the mean return of the last 100 episodes.
pub const EPISODIC_RETURN: &str = "charts/episodic_return";

/// Tag of the mean length of the last 100 episodes, ticks.
pub const EPISODIC_LENGTH: &str = "charts/episodic_length";

/// Tag of the share of clipped actions in the last 100 episodes.
pub const CLIPPED_SHARE: &str = "charts/clipped_share";

/// Tag of the number of episodes that have ended.
pub const EPISODES: &str = "charts/episodes";

/// Tags of the means over the last 100 episodes.
pub const EPISODE_MEANS: [&str; 3] = [EPISODIC_RETURN, EPISODIC_LENGTH, SUCCESS_RATE];

/// Episodes over which the current return, length and success rate are averaged.
pub(crate) const RECENT: usize = 100;

/// Results of one update. Everything except `timing` is the same in every run with the same seed.
#[derive(Clone, Debug)]
pub struct UpdateReport {
    /// Updates done, this one included.
    pub update: u64,
    /// Environment steps done, over all arenas together.
    pub step: u64,
    /// Episodes that have ended. Before the 100th, the means below are over fewer episodes, of which short ones end
    /// first.
    pub episodes: u64,
    /// Mean return of the last 100 episodes; `None` before the first has ended.
    pub episodic_return: Option<f64>,
    /// Mean length of the last 100 episodes, ticks.
    pub episodic_length: Option<f64>,
    /// Success rate of the last 100 episodes.
    pub success_rate: Option<f64>,
    /// Share of the ticks of the last 100 episodes whose action was clipped to the game's range; only for continuous
    /// actions.
    pub clipped_share: Option<f64>,
    /// KL divergence from decoder to policy before the first update; only in the first report of SCORE.
    pub initial_kl: Option<f32>,
    /// The learner's metrics.
    pub learner: LearnerMetrics,
    /// Time spent.
    pub timing: Timing,
}

impl UpdateReport {
    /// Returns whether at least 100 episodes have ended, and at least this share of the last 100 succeeded.
    pub fn mostly_succeeds(&self, share: f64) -> bool {
        self.episodes >= RECENT as u64 && self.success_rate.is_some_and(|rate| rate >= share)
    }

    /// Returns all measurements by TensorBoard tag; the same numbers in every run with the same seed.
    pub fn scalars(&self) -> Vec<(&'static str, f64)> {
        let episodes = [
            (EPISODES, Some(self.episodes as f64)),
            (EPISODIC_RETURN, self.episodic_return),
            (EPISODIC_LENGTH, self.episodic_length),
            (SUCCESS_RATE, self.success_rate),
            (CLIPPED_SHARE, self.clipped_share),
            ("score/initial_kl", self.initial_kl.map(f64::from)),
        ];
        let known = episodes.into_iter().filter_map(|(tag, value)| Some((tag, value?)));
        known.chain(self.learner.scalars()).collect()
    }
}

/// Wall-clock seconds of one update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Simulating, observing and deciding.
    pub collect_s: f64,
    /// Learning.
    pub learn_s: f64,
}

/// Returns the natural range of a metric; `None` if any value is possible.
pub fn range_of(tag: &str) -> Option<(f64, f64)> {
    [SUCCESS_RATE, CLIPPED_SHARE].contains(&tag).then_some((0.0, 1.0))
}
