//! Progress of training, and results of its last episodes.

use crate::{
    checkpoint::CheckpointSummary,
    update_report::{RECENT, Timing, UpdateReport},
};
use bevy_playbot::episode::EpisodeEnded;
use playbot_learner::LearnerMetrics;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// A finished episode, as the moving averages keep it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RecentEpisode {
    total_reward: f64,
    ticks: u32,
    success: bool,
    /// Ticks whose action was clipped; missing in older checkpoints.
    #[serde(default)]
    clipped: u32,
}

/// Progress of training.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Progress {
    pub(crate) updates: u64,
    pub(crate) steps: u64,
    pub(crate) episodes: u64,
    pub(crate) recent: VecDeque<RecentEpisode>,
}

impl Progress {
    pub(crate) fn note(&mut self, finished: &[EpisodeEnded]) {
        self.episodes += finished.len() as u64;
        self.recent.extend(finished.iter().map(|episode| RecentEpisode {
            total_reward: episode.total_reward,
            ticks: episode.ticks,
            success: episode.success,
            clipped: episode.clipped,
        }));
        let surplus = self.recent.len().saturating_sub(RECENT);
        self.recent.drain(..surplus);
    }

    /// Returns the mean over the last episodes; `None` before the first has ended.
    fn mean(&self, value: fn(&RecentEpisode) -> f64) -> Option<f64> {
        let n = self.recent.len();
        (n > 0).then(|| self.recent.iter().map(value).sum::<f64>() / n as f64)
    }

    fn episodic_return(&self) -> Option<f64> {
        self.mean(|episode| episode.total_reward)
    }

    fn success_rate(&self) -> Option<f64> {
        self.mean(|episode| f64::from(u8::from(episode.success)))
    }

    /// Returns the share of the clipped ticks among those of the last episodes.
    fn clipped_share(&self) -> Option<f64> {
        let ticks = self.mean(|episode| f64::from(episode.ticks)).filter(|ticks| *ticks > 0.0)?;
        Some(self.mean(|episode| f64::from(episode.clipped))? / ticks)
    }

    /// Returns the training results, with means once enough episodes have ended.
    pub(crate) fn summary(&self) -> CheckpointSummary {
        let settled = |mean: Option<f64>| mean.filter(|_| self.recent.len() == RECENT);
        CheckpointSummary {
            step: self.steps,
            episodic_return: settled(self.episodic_return()),
            success_rate: settled(self.success_rate()),
        }
    }

    pub(crate) fn report(&self, learner: LearnerMetrics, initial_kl: Option<f32>, timing: Timing) -> UpdateReport {
        UpdateReport {
            update: self.updates,
            step: self.steps,
            episodes: self.episodes,
            episodic_return: self.episodic_return(),
            episodic_length: self.mean(|episode| f64::from(episode.ticks)),
            success_rate: self.success_rate(),
            clipped_share: self.clipped_share(),
            initial_kl,
            learner,
            timing,
        }
    }
}
