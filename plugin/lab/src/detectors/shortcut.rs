//! Levels that are solved too fast.

use bevy_playbot::{episode::EpisodeResult, vision::ObservationConfig};

use super::level_detector::{LevelDefect, LevelDetector, ShownBy, TestedLevel};
use crate::{
    detector::Setting,
    eval::{EvalPlan, Player, evaluate},
    split::LevelSplit,
};

/// A finding for testers that solve a level in far fewer ticks than expected: its par, by the designer or by
/// demonstrations, or else the ticks of the game's demonstrator.
pub struct Shortcut {
    factor: f64,
    par: f64,
}

impl Default for Shortcut {
    fn default() -> Self {
        Self { factor: 0.5, par: 0.0 }
    }
}

impl Shortcut {
    /// Returns the ticks that the level should take.
    fn par(&self, level: &TestedLevel<'_>) -> Option<f64> {
        if self.par > 0.0 {
            return Some(self.par);
        }
        if level.par.is_some() {
            return level.par;
        }
        level.game.tools().bots.demonstrator()?;
        let split = LevelSplit { mode: level.mode.to_owned(), first: level.level, last: level.level };
        let plan = EvalPlan {
            split,
            observation_config: ObservationConfig::default(),
            episodes_per_level: 1,
            seed: 0,
            arenas: 1,
            worlds: 1,
            threads: 1,
        };
        // Other detectors report a panic.
        let results = evaluate(level.game, &Player::Demonstrator, &plan, |_| {}).ok()?;
        results.iter().find(|result| result.success).map(|result| f64::from(result.ticks))
    }
}

impl LevelDetector for Shortcut {
    fn name(&self) -> &'static str {
        "shortcut"
    }

    fn describe(&self) -> &'static str {
        "the level is solved far faster than by the demonstrator, or than its par"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("factor", &mut self.factor, "share of the par that is too fast"),
            Setting::new(
                "par",
                &mut self.par,
                "ticks that a level should take; 0 for those of --par, or of the demonstrator",
            ),
        ]
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let solved = level.episodes().filter(|(_, _, result)| result.success);
        let Some((tester, episode, fastest)) = solved.min_by_key(|(_, _, result)| result.ticks) else {
            return Vec::new();
        };
        let Some(par) = self.par(level) else { return Vec::new() };
        if !is_too_fast(fastest, par, self.factor) {
            return Vec::new();
        }
        let message = format!("solved in {} ticks, where {par} are expected", fastest.ticks);
        let (tester, episode, tick) = (Some(tester.to_owned()), Some(episode), fastest.ticks.checked_sub(1));
        let settings = vec![format!("shortcut.par={par}")];
        vec![LevelDefect { tester, episode, tick, message, settings }]
    }

    fn shown_by(&self) -> ShownBy {
        ShownBy::Episode
    }

    /// Findings store their level's par. In older ones without it, an episode that is as fast counts.
    fn is_in_episode(&self, result: &EpisodeResult, tick: Option<u32>) -> bool {
        let is_fast = if self.par > 0.0 {
            is_too_fast(result, self.par, self.factor)
        } else {
            tick.is_none_or(|tick| result.ticks <= tick.saturating_add(1))
        };
        result.success && is_fast
    }
}

fn is_too_fast(result: &EpisodeResult, par: f64, factor: f64) -> bool {
    f64::from(result.ticks) < par * factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{LOST, WON, inspected};

    #[test]
    fn a_level_that_is_solved_far_faster_than_its_par_has_a_shortcut() {
        let episodes = [(WON, 90, [1.0; 2]), (WON, 40, [1.0; 2]), (LOST, 3, [1.0; 2])];
        let found = inspected(&Shortcut::default(), &episodes, Some(100.0));
        assert_eq!((found.len(), found[0].episode, found[0].tick), (1, Some(1), Some(39)));
        assert!(inspected(&Shortcut::default(), &episodes, Some(80.0)).is_empty(), "half the par is no shortcut");
        assert!(inspected(&Shortcut::default(), &episodes, None).is_empty(), "nobody demonstrates it");
    }

    #[test]
    fn an_episode_that_is_too_fast_for_its_par_shows_it_again() {
        let found = inspected(&Shortcut::default(), &[(WON, 40, [1.0; 2])], Some(100.0));
        assert_eq!(found[0].settings, ["shortcut.par=100"]);
        let ended =
            |end, ticks| EpisodeResult { level: 0, end, success: end == WON, ticks, clipped: 0, total_reward: 0.0 };
        let shows = |end, ticks| Shortcut::default().is_in_episode(&ended(end, ticks), Some(39));
        assert!(shows(WON, 40) && shows(WON, 12) && !shows(WON, 41) && !shows(LOST, 12));
        let shows = |factor, end, ticks| Shortcut { factor, par: 100.0 }.is_in_episode(&ended(end, ticks), Some(39));
        assert!(shows(0.5, WON, 49) && !shows(0.5, WON, 50) && !shows(0.5, LOST, 40) && !shows(0.3, WON, 40));
    }
}
