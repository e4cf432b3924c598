//! The plan of a test: levels, testers and settings.

use bevy_playbot::state_hash::StateHash;
use serde::{Deserialize, Serialize};

use super::{
    error::TestError,
    level_name::hash_of_files,
    map_scope::MapScope,
    shard::Shard,
    tester::{Tester, TesterRecord},
};
use crate::{detectors::Detectors, eval::EvalError, game::Game, split::LevelSplit};

/// Plan of a test.
#[derive(Clone)]
pub struct TestPlan {
    /// Levels.
    pub split: LevelSplit,
    /// Testers with distinct names, at least one.
    pub testers: Vec<Tester>,
    /// Episodes of each tester on each level; at least 1.
    pub episodes: u32,
    /// Seed of the testers' random streams.
    pub seed: u64,
    /// The detectors at work during play.
    pub detectors: Detectors,
    /// Shard of the levels; all levels if `None`.
    pub shard: Option<Shard>,
    /// Number of threads, which does not affect the results.
    pub threads: usize,
}

/// Description of a plan in files: everything that the results depend on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TestRecord {
    /// Name of the game.
    pub game: String,
    /// Version of its rules.
    pub game_version: u32,
    /// The levels, as `mode:first..last`.
    pub range: LevelSplit,
    /// Hash of the levels, if they are files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub files: Option<String>,
    /// Seed of the testers' random streams.
    pub seed: u64,
    /// The testers, in the order in which results have them.
    pub testers: Vec<TesterRecord>,
    /// Episodes of each tester on each level.
    pub episodes: u32,
    /// The detectors, each with its settings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub detectors: Vec<String>,
    /// The detectors as words of a command line: all options that differ from the default. Files are named as the
    /// test named them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub options: Vec<String>,
    /// Levels whose results have maps of where agents went.
    #[serde(default, skip_serializing_if = "MapScope::is_none")]
    pub maps: MapScope,
    /// Shard of the levels; all levels if `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<Shard>,
}

impl TestPlan {
    /// Checks that the plan has testers with distinct names and levels, and that memory suffices.
    ///
    /// # Errors
    ///
    /// [`TestError::NoTester`], [`TestError::SameName`], [`TestError::EmptyShard`], or [`TestError::Eval`] with what
    /// to lower.
    pub fn check(&self) -> Result<(), TestError> {
        if self.testers.is_empty() {
            return Err(TestError::NoTester);
        }
        for (index, tester) in self.testers.iter().enumerate() {
            if self.testers[..index].iter().any(|other| other.record.name == tester.record.name) {
                return Err(TestError::SameName(tester.record.name.clone()));
            }
        }
        match self.shard {
            Some(shard) if shard.places(self.split.len()).next().is_none() => {
                Err(TestError::EmptyShard { shard, range: self.split.to_string(), length: self.split.len() })
            }
            _ => self.check_memory().map_err(|error| EvalError::from(error).into()),
        }
    }

    /// Returns its description for files.
    pub fn record(&self, game: &dyn Game) -> TestRecord {
        TestRecord {
            game: game.name().to_owned(),
            game_version: game.version(),
            range: self.split.clone(),
            files: hash_of_files(game, &self.split),
            seed: self.seed,
            testers: self.testers.iter().map(|tester| tester.record.clone()).collect(),
            episodes: self.episodes.max(1),
            detectors: self.detectors.record().to_vec(),
            options: self.detectors.options().to_vec(),
            maps: self.maps(),
            shard: self.shard,
        }
    }

    /// Returns the scope of the maps in results. The whole range decides, not the shard.
    pub fn maps(&self) -> MapScope {
        MapScope::of(self.split.len())
    }

    /// Returns the indices in the range of the levels to test.
    pub fn places(&self) -> Vec<u64> {
        match self.shard {
            Some(shard) => shard.places(self.split.len()).collect(),
            None => (0..self.split.len()).collect(),
        }
    }

    /// Returns the seed of an episode, from the plan's seed, the names of tester and level, and the number of the
    /// episode. So the episode is the same beside any other levels and testers, and on any machine.
    pub fn episode_seed(&self, tester: &TesterRecord, level: &str, episode: u32) -> u64 {
        let bytes = |text: &str| text.bytes().map(u64::from).chain([u64::from(u8::MAX) + 1]).collect::<Vec<_>>();
        let names = bytes(&tester.name).into_iter().chain(bytes(level));
        StateHash::of([self.seed].into_iter().chain(names).chain([u64::from(episode)])).0
    }
}

impl TestRecord {
    /// Describes the differences between two tests, without their shards.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut found = self.differences_of_game(other);
        let mut compare = |what: &str, one: String, other: String| {
            if one != other {
                found.push(format!("{what} {one} and {other}"));
            }
        };
        compare("levels", self.range.to_string(), other.range.to_string());
        let hash = |record: &Self| record.files.clone().unwrap_or_else(|| "none".to_owned());
        compare("hashes of the level files", hash(self), hash(other));
        compare("seeds", self.seed.to_string(), other.seed.to_string());
        compare("episodes per level", self.episodes.to_string(), other.episodes.to_string());
        compare("testers", self.describe_testers(), other.describe_testers());
        compare("detectors", self.describe_detectors(), other.describe_detectors());
        compare("levels with maps", self.maps.name().to_owned(), other.maps.name().to_owned());
        found
    }

    /// Describes the differences between the games and their versions.
    pub fn differences_of_game(&self, other: &Self) -> Vec<String> {
        if self.game != other.game {
            return vec![format!("games `{}` and `{}`", self.game, other.game)];
        }
        let (one, another) = (self.game_version, other.game_version);
        if one == another { Vec::new() } else { vec![format!("versions {one} and {another} of `{}`", self.game)] }
    }

    fn describe_detectors(&self) -> String {
        if self.detectors.is_empty() { "none".to_owned() } else { self.detectors.join(" + ") }
    }

    fn describe_testers(&self) -> String {
        self.testers.iter().map(TesterRecord::describe).collect::<Vec<_>>().join(" + ")
    }
}

#[cfg(test)]
mod tests {
    use bevy_playbot::{bot::BlindBot, vision::ObservationConfig};

    use super::*;
    use crate::eval::Player;

    fn plan(testers: &[&str], shard: Option<&str>) -> TestPlan {
        let tester = |name: &&str| Tester {
            record: TesterRecord::bot(*name),
            player: Player::Blind(BlindBot::Uniform),
            observation_config: ObservationConfig::default(),
        };
        TestPlan {
            split: "hard:5..9".parse().expect("a split"),
            testers: testers.iter().map(tester).collect(),
            episodes: 2,
            seed: 3,
            detectors: Detectors::default(),
            shard: shard.map(|shard| shard.parse().expect("a shard")),
            threads: 1,
        }
    }

    #[test]
    fn a_plan_needs_testers_and_levels() {
        assert!(plan(&["a", "b"], Some("4/5")).check().is_ok());
        assert!(matches!(plan(&[], None).check(), Err(TestError::NoTester)));
        assert!(matches!(plan(&["a", "b", "a"], None).check(), Err(TestError::SameName(name)) if name == "a"));
        let error = plan(&["a"], Some("5/6")).check().expect_err("five levels").to_string();
        assert!(error.contains("5/6") && error.contains("hard:5..9 has only 5"), "{error}");
        let shard = plan(&["a"], Some("1/2"));
        assert_eq!((shard.places(), shard.maps()), (vec![1, 3], MapScope::All));
        let many = TestPlan { split: "hard:0..4001".parse().expect("a split"), ..shard };
        assert_eq!((many.places().len(), many.maps()), (2001, MapScope::Failed));
    }

    #[test]
    fn the_seed_of_an_episode_comes_from_names_and_numbers_alone() {
        let (all, shard) = (plan(&["a", "b"], None), plan(&["b"], Some("0/2")));
        let tester = TesterRecord::bot("b");
        assert_eq!(all.episode_seed(&tester, "hard:7", 1), shard.episode_seed(&tester, "hard:7", 1));
        let mut seeds: Vec<u64> = [("a", "7", 0), ("b", "7", 0), ("b", "8", 0), ("b", "7", 1), ("b", "70", 1)]
            .map(|(name, level, episode)| all.episode_seed(&TesterRecord::bot(name), level, episode))
            .to_vec();
        seeds.push(TestPlan { seed: 4, ..all }.episode_seed(&tester, "7", 0));
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 6);
    }

    #[test]
    fn what_differs_is_named() {
        let record = TestRecord {
            game: "a".to_owned(),
            game_version: 1,
            range: "hard:5..9".parse().expect("a split"),
            files: None,
            seed: 0,
            testers: vec![TesterRecord::bot("search")],
            episodes: 1,
            detectors: Vec::new(),
            options: Vec::new(),
            maps: MapScope::default(),
            shard: None,
        };
        let trained = TesterRecord { checksum: Some("0f".to_owned()), greedy: true, ..TesterRecord::bot("ppo") };
        let other = TestRecord { seed: 7, testers: vec![trained], game_version: 2, ..record.clone() };
        let expected = ["versions 1 and 2 of `a`", "seeds 0 and 7", "testers search and ppo (file 0f), greedy"];
        assert_eq!(record.differences(&other), expected);
        assert_eq!(record.differences(&TestRecord { game: "b".to_owned(), ..record.clone() }), ["games `a` and `b`"]);
        assert!(record.differences(&record).is_empty());
        let mapped = TestRecord { maps: MapScope::All, ..record.clone() };
        assert_eq!(record.differences(&mapped), ["levels with maps none and all"]);
    }
}
