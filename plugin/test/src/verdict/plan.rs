//! The plan of a test: levels, testers and settings.

use crate::{
    detectors::Detectors,
    verdict::{
        error::{TestError, io_error, json_fault},
        maps::{MapScope, hash_of_files},
        played::{Played, Task},
        shard::Shard,
    },
};
use bevy_playbot::{skill_prior::NamedSkill, state_hash::StateHash, vision::ObservationConfig};
use playbot_harness::{
    brief::shell_word,
    eval::{EvalError, Player},
    game::Game,
    machine::{MemoryError, check_bytes},
    split::LevelSplit,
    worlds::Arrangement,
};
use playbot_learner::{settings::is_off, unseal_json};
use playbot_report::counted;
use serde::{Deserialize, Serialize};
use std::{fs, path::Path};

/// Name of the file with the description of a test, in its folder.
pub(super) const RECORD: &str = "test.json";

/// Bytes of a listed level, and of its entry in the journal.
const LEVEL: usize = size_of::<u64>() + size_of::<(u64, (u64, usize))>();

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

    /// Checks that the list of levels and the episodes on one of them fit into the free memory.
    ///
    /// # Errors
    ///
    /// [`MemoryError`].
    pub fn check_memory(&self) -> Result<(), MemoryError> {
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

/// Data in memory: description, bytes, and the option to lower.
type Kept = (String, u64, &'static str);

impl TestRecord {
    /// Reads a file.
    pub(super) fn read(file: &Path) -> Result<Self, TestError> {
        let text = fs::read_to_string(file).map_err(io_error("read", file))?;
        let next = "replace the results with --force, or choose another --out";
        let damaged = |line, message| TestError::Damaged { path: file.into(), line, message, next };
        let text = unseal_json(&text).map_err(|error| damaged(1, error.to_string()))?.text;
        serde_json::from_str(&text).map_err(|error| damaged(error.line(), json_fault(&error)))
    }

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

    /// Returns the command that goes on with this test in a folder.
    pub(super) fn resumed_in(&self, folder: &Path) -> String {
        let Self { game, range, testers: records, episodes, seed, options, shard, .. } = self;
        let [levels, folder] = [range.to_string(), folder.display().to_string()].map(|word| shell_word(&word));
        let options: String = options.iter().map(|word| format!(" {}", shell_word(word))).collect();
        let shard = shard.map_or_else(String::new, |shard| format!(" --shard {shard}"));
        let played = testers(records);
        format!(
            "playbot test {game} --levels {levels} {played} --episodes {episodes} --seed {seed}{options}{shard} --out \
             {folder} --resume"
        )
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

// Testers.

/// A player with a name and its observations.
#[derive(Clone)]
pub struct Tester {
    /// Its description for files.
    pub record: TesterRecord,
    /// The player.
    pub player: Player,
    /// Observations of a learned policy; bots keep vectors.
    pub observation_config: ObservationConfig,
}

/// Description of a tester in files.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TesterRecord {
    /// Its name, unique in the test.
    pub name: String,
    /// Checksum of a policy's file: another file is another tester.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checksum: Option<String>,
    /// True if a policy takes its most probable action instead of drawing one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub greedy: bool,
    /// The policy's file, if it differs from the tester's name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The policy's run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<TestedRun>,
    /// Levels of the tested range that the policy has learned from: by number, as a file, by their layout or their play.
    #[serde(default, skip_serializing_if = "is_off")]
    pub known: u64,
    /// Named regions of the policy's skills, whose names results have. Files do not have the regions.
    #[serde(skip)]
    pub skill_names: Vec<NamedSkill>,
}

/// A checkpoint of a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TestedRun {
    /// The run's folder.
    pub folder: String,
    /// The checkpoint's number of environment steps.
    pub step: u64,
}

/// Neither the path of a policy's file nor the levels that it knows nor the names of its skills identify the tester.
impl PartialEq for TesterRecord {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, &self.checksum, self.greedy) == (&other.name, &other.checksum, other.greedy)
    }
}

impl Eq for TesterRecord {}

/// Most named regions of a tester's skills that count, the first ones: each takes a counter for each square of a map.
pub(super) const MOST_REGIONS: usize = 64;

impl TesterRecord {
    /// Returns the regions of its skills whose names count.
    pub(super) fn regions(&self) -> &[NamedSkill] {
        &self.skill_names[..self.skill_names.len().min(MOST_REGIONS)]
    }

    /// Makes the tester of a bot of the game.
    pub fn bot(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            checksum: None,
            greedy: false,
            file: None,
            run: None,
            known: 0,
            skill_names: Vec::new(),
        }
    }

    /// Makes the tester of a policy's file, under its own name or else the file's.
    pub fn policy(name: Option<String>, path: &Path, checksum: String) -> Self {
        let of_file = || path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let name = name.unwrap_or_else(of_file);
        let file = (path != Path::new(&name)).then(|| path.display().to_string());
        Self { checksum: Some(checksum), file, ..Self::bot(name) }
    }

    /// Describes the tester.
    pub fn describe(&self) -> String {
        let checksum = self.checksum.as_ref().map_or_else(String::new, |sum| format!(" (file {sum})"));
        format!("{}{checksum}{}", self.name, if self.greedy { ", greedy" } else { "" })
    }

    /// Describes how many of the tested levels the tester has learned from; `None` if there are none.
    pub fn describe_known(&self) -> Option<String> {
        let levels = counted(self.known, "level");
        (self.known > 0).then(|| format!("{} has learned from {levels} of this test, or from equal ones", self.name))
    }
}

/// Returns the testers as arguments of `playbot test`. The draws of a policy depend on its name, so the name is
/// included.
pub(super) fn testers(testers: &[TesterRecord]) -> String {
    let bots: Vec<&str> =
        testers.iter().filter(|tester| tester.checksum.is_none()).map(|tester| tester.name.as_str()).collect();
    let bots = (!bots.is_empty()).then(|| format!("--bot {}", bots.join(",")));
    let policies = testers.iter().filter(|tester| tester.checksum.is_some() && tester.run.is_none());
    let policies = policies.map(|TesterRecord { name, file, .. }| {
        let given = file.as_ref().map_or_else(|| name.clone(), |file| format!("{name}={file}"));
        format!("--policy {}", shell_word(&given))
    });
    let greedy = testers.iter().any(|tester| tester.greedy).then(|| "--greedy".to_owned());
    bots.into_iter().chain(policies).chain(runs(testers)).chain(greedy).collect::<Vec<_>>().join(" ")
}

/// Returns the arguments for runs among testers. One checkpoint applies to all, so runs with different checkpoints
/// get none.
fn runs(testers: &[TesterRecord]) -> Vec<String> {
    let runs: Vec<_> = testers.iter().filter_map(|tester| tester.run.as_ref()).collect();
    let folders = runs.iter().map(|run| format!("--run {}", shell_word(&run.folder)));
    let step = runs.first().map(|run| run.step).filter(|step| runs.iter().all(|run| run.step == *step));
    folders.chain(step.map(|step| format!("--checkpoint {step}"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detectors::Detectors,
        verdict::{TestError, Tester, TesterRecord},
    };
    use bevy_playbot::{bot::BlindBot, vision::ObservationConfig};
    use playbot_harness::eval::Player;
    use playbot_learner::HasExitCode as _;

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
    fn only_the_first_of_many_regions_count() {
        let region = NamedSkill { name: "jump".to_owned(), z: vec![0.0], radius: 0.5 };
        let tester = TesterRecord { skill_names: vec![region; 99], ..TesterRecord::bot("ppo") };
        assert_eq!(tester.regions().len(), MOST_REGIONS);
        assert!(TesterRecord::bot("random").regions().is_empty());
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

    #[test]
    fn a_file_is_reported_where_it_is_not_the_name() {
        let record = |name: Option<&str>, path: &str| {
            let record = TesterRecord::policy(name.map(str::to_owned), Path::new(path), "0f".to_owned());
            (record.name, record.file)
        };
        let wanted = |name: &str, file: Option<&str>| (name.to_owned(), file.map(str::to_owned));
        assert_eq!(record(None, "a.policy"), wanted("a.policy", None));
        assert_eq!(record(None, "new/a.policy"), wanted("a.policy", Some("new/a.policy")));
        assert_eq!(record(Some("ppo"), "a.policy"), wanted("ppo", Some("a.policy")));
    }

    #[test]
    fn a_policy_is_known_by_name_and_checksum_and_not_by_its_place() {
        let here = TesterRecord { checksum: Some("0f".to_owned()), ..TesterRecord::bot("ppo") };
        let there = TesterRecord { file: Some("runs/new.policy".to_owned()), ..here.clone() };
        assert_eq!(here, there);
        assert_ne!(here, TesterRecord { checksum: Some("1f".to_owned()), ..there.clone() });
        assert_ne!(here, TesterRecord { greedy: true, ..there.clone() });
        assert_ne!(here, TesterRecord { name: "bot".to_owned(), ..there.clone() });
        assert_eq!(there.describe(), "ppo (file 0f)");
        let knowing = TesterRecord { known: 1, ..there.clone() };
        assert_eq!((&knowing, there.describe_known()), (&here, None));
        let words = "ppo has learned from 1 level of this test, or from equal ones";
        assert_eq!(knowing.describe_known().as_deref(), Some(words));
        let text = serde_json::to_string(&[knowing, there.clone()]).expect("JSON");
        assert_eq!(text.matches("known").count(), 1, "{text}");
        assert_eq!(serde_json::from_str::<Vec<TesterRecord>>(&text).expect("JSON")[0].known, 1);
        let text = serde_json::to_string(&there).expect("JSON");
        assert_eq!(text, r#"{"name":"ppo","checksum":"0f","file":"runs/new.policy"}"#);
        assert_eq!(serde_json::to_string(&here).expect("JSON"), r#"{"name":"ppo","checksum":"0f"}"#);
    }

    fn sized_plan(levels: &str, testers: usize, episodes: u32) -> TestPlan {
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
        assert!(sized_plan("hard:0..9", 64, 100).check().is_ok());
        let error = sized_plan("hard:0..9", 64, u32::MAX).check().expect_err("terabytes");
        let words = error.to_string();
        assert!(error.is_usage() && matches!(error, TestError::Eval(_)), "{words}");
        assert!(words.starts_with("the results of testers × episodes = 64 × 4294967295 on a level need "), "{words}");
        assert!(words.ends_with(": lower `--episodes`"), "{words}");
    }

    #[test]
    fn levels_are_counted_without_those_of_other_shards() {
        let whole = sized_plan("hard:0..16777215", 1, 1);
        let [(what, bytes, option), _] = whole.kept();
        assert_eq!((what.as_str(), option), ("the places of the results of 16777216 levels", "`--levels`"));
        assert_eq!(bytes, (LEVEL as u64) << 24);
        let part = TestPlan { shard: Some("1/4".parse().expect("a shard")), ..whole };
        assert_eq!(part.kept()[0].1, (LEVEL as u64) << 22);
    }
}
