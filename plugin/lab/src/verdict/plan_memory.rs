//! Least memory of a test, checked before it begins.

use super::{
    plan::TestPlan,
    played::{Played, Task},
};
use crate::{
    arrangement::Arrangement,
    machine::{MemoryError, check_bytes},
};

/// Bytes of a listed level, and of its entry in the journal.
const LEVEL: usize = size_of::<u64>() + size_of::<(u64, (u64, usize))>();

/// Data in memory: description, bytes, and the option to lower.
type Kept = (String, u64, &'static str);

impl TestPlan {
    /// Checks that the list of levels and the episodes on one of them fit into the free memory.
    ///
    /// # Errors
    ///
    /// [`MemoryError`].
    pub(super) fn check_memory(&self) -> Result<(), MemoryError> {
        let worlds = Arrangement { worlds: 1, arenas: 1 };
        self.kept().into_iter().try_for_each(|(what, bytes, options)| check_bytes(what, bytes, options, worlds))
    }

    fn kept(&self) -> [Kept; 2] {
        let levels = self.shard.map_or(self.split.len(), |shard| shard.places(self.split.len()).count() as u64);
        let (testers, episodes) = (self.testers.len() as u64, u64::from(self.episodes.max(1)));
        let of_levels = levels.saturating_mul(LEVEL as u64);
        // A level is judged when all testers have played all of their episodes on it.
        let one_tester = episodes.saturating_mul(size_of::<Task>() as u64);
        let all_testers = episodes.saturating_mul(testers).saturating_mul(size_of::<Played>() as u64);
        [
            (format!("the places of the results of {levels} levels"), of_levels, "`--levels`"),
            (
                format!("the results of testers × episodes = {testers} × {episodes} on a level"),
                one_tester.saturating_add(all_testers),
                "`--episodes`",
            ),
        ]
    }
}

#[cfg(test)]
mod tests {
    use bevy_playbot::{bot::BlindBot, vision::ObservationConfig};
    use playbot_learner::HasExitCode as _;

    use super::super::{TestError, Tester, TesterRecord};
    use super::*;
    use crate::{detectors::Detectors, eval::Player};

    fn plan(levels: &str, testers: usize, episodes: u32) -> TestPlan {
        let tester = |number: usize| Tester {
            record: TesterRecord::bot(number.to_string()),
            player: Player::Blind(BlindBot::Uniform),
            observation_config: ObservationConfig::default(),
        };
        TestPlan {
            split: levels.parse().expect("a split"),
            testers: (0..testers).map(tester).collect(),
            episodes,
            seed: 0,
            detectors: Detectors::default(),
            shard: None,
            threads: 1,
        }
    }

    #[test]
    fn what_no_machine_has_room_for_is_refused_by_the_name_of_its_option() {
        assert!(plan("hard:0..9", 64, 100).check().is_ok());
        let error = plan("hard:0..9", 64, u32::MAX).check().expect_err("terabytes");
        let words = error.to_string();
        assert!(error.is_usage() && matches!(error, TestError::Eval(_)), "{words}");
        assert!(words.starts_with("the results of testers × episodes = 64 × 4294967295 on a level need "), "{words}");
        assert!(words.ends_with(": lower `--episodes`"), "{words}");
    }

    #[test]
    fn levels_are_counted_without_those_of_other_shards() {
        let whole = plan("hard:0..16777215", 1, 1);
        let [(what, bytes, option), _] = whole.kept();
        assert_eq!((what.as_str(), option), ("the places of the results of 16777216 levels", "`--levels`"));
        assert_eq!(bytes, (LEVEL as u64) << 24);
        let part = TestPlan { shard: Some("1/4".parse().expect("a shard")), ..whole };
        assert_eq!(part.kept()[0].1, (LEVEL as u64) << 22);
    }
}
