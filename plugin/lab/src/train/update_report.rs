//! What one update of a training brought.

use serde::Serialize;

use super::{
    learner::LearnerMetrics,
    metrics_log::{CLIPPED_SHARE, EPISODES, EPISODIC_LENGTH, EPISODIC_RETURN, SUCCESS_RATE},
    progress::RECENT,
};

/// What one update brought. Everything in it is the same in every run with the same seed, except `timing`.
#[derive(Clone, Debug)]
pub struct UpdateReport {
    /// Updates done, this one included.
    pub update: u64,
    /// Environment steps done, over all arenas together.
    pub step: u64,
    /// Episodes that have ended. Before the 100th the means below are of fewer, and of short ones more than of long.
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
    /// What the learner reports.
    pub learner: LearnerMetrics,
    /// Where the time went.
    pub timing: Timing,
}

impl UpdateReport {
    /// Whether at least 100 episodes have ended, and of the last 100 at least this share with success.
    pub fn mostly_succeeds(&self, share: f64) -> bool {
        self.episodes >= RECENT as u64 && self.success_rate.is_some_and(|rate| rate >= share)
    }

    /// Everything measured, by TensorBoard tag; the same numbers in every run with the same seed.
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
