//! Rewards that are higher without the goal.

use bevy_playbot::episode::EpisodeEnd;

use super::level_detector::{LevelDefect, LevelDetector, TestedLevel};
use crate::detector::Setting;

/// A finding for episodes with more reward at the time limit than any solved one.
pub struct RewardFarm {
    factor: f64,
}

impl Default for RewardFarm {
    fn default() -> Self {
        Self { factor: 1.5 }
    }
}

impl LevelDetector for RewardFarm {
    fn name(&self) -> &'static str {
        "reward-farm"
    }

    fn describe(&self) -> &'static str {
        "an episode that was not solved brings more reward than the solved ones"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![Setting::new("factor", &mut self.factor, "times the reward of the best solved episode")]
    }

    fn compares_testers(&self) -> bool {
        true
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let solved = level.episodes().filter(|(_, _, result)| result.success);
        let best = solved.map(|(_, _, result)| result.total_reward).max_by(f64::total_cmp);
        let Some(best) = best.filter(|best| *best > 0.0) else { return Vec::new() };
        let is_farm = |end: EpisodeEnd, total: f64| end == EpisodeEnd::Truncated && total > self.factor * best;
        let found = level.episodes().find(|(_, _, result)| !result.success && is_farm(result.end, result.total_reward));
        let defect = found.map(|(tester, episode, result)| LevelDefect {
            tester: Some(tester.to_owned()),
            episode: Some(episode),
            tick: result.ticks.checked_sub(1),
            settings: Vec::new(),
            message: format!(
                "a reward of {} until time was up, and at most {best} for reaching the goal",
                result.total_reward
            ),
        });
        defect.into_iter().collect()
    }
}
