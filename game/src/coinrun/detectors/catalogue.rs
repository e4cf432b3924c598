//! All detectors of CoinRun.

use playbot_lab::detector::Detector;

use super::{coin, inside::inside_ground, lanes::StrayEnemy, lethal};

/// Returns the detectors of the game.
pub(in crate::coinrun) fn detectors() -> Vec<Box<dyn Detector>> {
    vec![
        Box::new(lethal::harmless_hazard()),
        Box::new(lethal::FarHazard),
        Box::new(coin::goal_ignored()),
        Box::new(StrayEnemy),
        Box::new(inside_ground()),
    ]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::coinrun::detectors::testing::{Bot, findings, sound};

    #[test]
    fn names_are_different_and_all_are_usual() {
        let names: BTreeSet<_> = detectors().iter().map(|detector| detector.name()).collect();
        assert_eq!(names.len(), 5);
        assert!(detectors().iter().all(|detector| detector.is_usual()));
    }

    #[test]
    fn a_hundred_sound_levels_give_no_finding_whether_they_are_solved_or_not() {
        for bot in [Bot::Search, Bot::Random, Bot::RightJump] {
            for level in 0..100 {
                let found = findings(&sound(), level, bot, 200);
                assert!(found.is_empty(), "level {level}, {bot:?}: {found:?}");
            }
        }
    }
}
