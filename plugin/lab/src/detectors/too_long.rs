//! Levels that take longer than they should.

use super::level_detector::{LevelDefect, LevelDetector, TestedLevel};
use crate::detector::Setting;

/// A finding for levels that testers solve, but never within their par, by the designer or by demonstrations. Levels
/// without a par are skipped.
pub struct TooLong {
    factor: f64,
    par: f64,
}

impl Default for TooLong {
    fn default() -> Self {
        Self { factor: 1.0, par: 0.0 }
    }
}

impl LevelDetector for TooLong {
    fn name(&self) -> &'static str {
        "too-long"
    }

    fn describe(&self) -> &'static str {
        "the level is solved, and never within its par"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("factor", &mut self.factor, "times the par that it may take"),
            Setting::new("par", &mut self.par, "ticks that a level should take; 0 for those of --par"),
        ]
    }

    fn compares_testers(&self) -> bool {
        true
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let par = if self.par > 0.0 { Some(self.par) } else { level.par };
        let Some(most) = par.map(|par| par * self.factor) else { return Vec::new() };
        let solved = level.episodes().filter(|(_, _, result)| result.success);
        let fastest = solved.min_by_key(|(_, _, result)| result.ticks);
        let slow = fastest.filter(|(_, _, result)| f64::from(result.ticks) > most);
        let defect = slow.map(|(tester, episode, result)| LevelDefect {
            tester: Some(tester.to_owned()),
            episode: Some(episode),
            tick: result.ticks.checked_sub(1),
            settings: Vec::new(),
            message: format!("solved in {} ticks at best, where {most} should be enough", result.ticks),
        });
        defect.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{LOST, WON, inspected};

    #[test]
    fn a_level_that_nobody_solves_within_its_par_is_found() {
        let episodes = [(WON, 90, [1.0; 2]), (WON, 70, [1.0; 2]), (LOST, 5, [1.0; 2])];
        let found = inspected(&TooLong::default(), &episodes, Some(60.0));
        assert_eq!((found.len(), found[0].episode, found[0].tick), (1, Some(1), Some(69)));
        assert!(found[0].message.contains("solved in 70 ticks at best, where 60"), "{}", found[0].message);
        let by_setting = TooLong { par: 50.0, ..TooLong::default() };
        assert_eq!(inspected(&by_setting, &episodes, Some(100.0)).len(), 1);
    }

    #[test]
    fn a_level_within_its_par_without_one_or_that_nobody_solves_is_silent() {
        let episodes = [(WON, 90, [1.0; 2]), (WON, 70, [1.0; 2])];
        assert!(inspected(&TooLong::default(), &episodes, Some(70.0)).is_empty());
        assert!(inspected(&TooLong::default(), &episodes, None).is_empty());
        assert!(inspected(&TooLong::default(), &[(LOST, 90, [1.0; 2])], Some(1.0)).is_empty());
    }
}
