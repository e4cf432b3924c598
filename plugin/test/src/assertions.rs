//! Assertions about levels, for a game's own `cargo test`.
//!
//! ```
//! use bevy::prelude::*;
//! use playbot_harness::prelude::*;
//! use playbot_harness::foreign::{ForeignGame, Restart};
//! use playbot_test::assertions::test;
//!
//! #[derive(Component)]
//! struct Walker;
//!
//! fn game(app: &mut App) {
//!     app.add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn((Walker, Transform::default()));
//!     })
//!     .add_systems(Update, |keys: Res<ButtonInput<KeyCode>>, mut walker: Single<&mut Transform, With<Walker>>| {
//!         walker.translation.x += f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
//!     });
//! }
//!
//! fn walk() -> ForeignGame {
//!     ForeignGame::new("walk", 1, game)
//!         .keys([vec![], vec![KeyCode::ArrowRight]])
//!         .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
//!         .end(|walker: Single<&Transform, With<Walker>>| (walker.translation.x >= 5.0).then_some(EpisodeEnd::WON))
//!         .time_limit(20)
//!         .restart(Restart::Startup)
//!         .demonstrator("walker", || 1_u32)
//! }
//!
//! // In a function with `#[test]`:
//! test(&walk()).levels("default:0..3").assert_levels_solvable();
//! test(&walk()).levels("default:0..1").assert_deterministic();
//! test(&walk()).levels("default:0..3").bots(["walker"]).episodes(2).assert_levels_solved();
//! ```
//!
//! Levels are named as on the command line: `MODE:first..last`, both included, or `files:levels/**/*.json`. Paths are
//! relative to the folder of the package, in which `cargo test` runs tests. A range without a level is a failure, and
//! so is any other reason why levels cannot be tested.
//!
//! A failure names each broken level with its defect, and the commands that show it. Failed episodes and findings are
//! written below `target/playbot-findings`, so that `playbot replay` shows them; `playbot` stands for the program with
//! the game. Without such a program, [`LevelTest::assert_replays`] plays a file again in a test.
//!
//! The files of the folder, in reading order:
//!
//! - `examine`: the testers of an assertion, by name, their run over the levels, and the failure message.
//! - `assert_recordings`: assertions about recordings and findings.

mod assert_recordings;
mod examine;

use crate::{
    assertions::examine::Named,
    detectors::DetectorChoice,
    verdict::{LevelOutcome, LevelVerdict},
};
use bevy_playbot::policy::ActionDraw;
use playbot_harness::{eval::Player, game::Game, parallel::default_threads};
use playbot_report::counted;
use std::{
    env,
    path::{Path, PathBuf},
};

pub use crate::assertions::examine::LevelTestError;

/// The program in the commands of a failure, unless another is named.
const DEFAULT_PROGRAM: &str = "playbot";

/// The finding that a goal is out of reach. It says nothing about determinism.
const UNREACHABLE: &str = "unreachable-goal";

/// Begins a test of a game: `playbot::test(&game).levels("default:0..29").assert_no_findings()`. Each tester plays one
/// episode on each level, with the default detectors, on all cores, unless the test says otherwise.
pub fn test(game: &dyn Game) -> LevelTest<'_> {
    LevelTest {
        game,
        levels: String::new(),
        named: Vec::new(),
        draw: ActionDraw::Sample,
        episodes: 1,
        seed: 0,
        detectors: DetectorChoice::default(),
        threads: default_threads(),
        folder: default_folder(game.name()),
        minimise: false,
        program: DEFAULT_PROGRAM.to_owned(),
    }
}

/// A test of levels, recordings or findings: set up first, then asserted. [`test()`] begins one.
///
/// Testers are named with [`bots`](Self::bots), [`policy`](Self::policy) and [`player`](Self::player). Without them, the
/// game's demonstrator or else its first bot must solve the levels, and all of its bots play when findings are
/// asserted.
#[derive(Clone)]
#[must_use = "nothing is tested before something is asserted"]
pub struct LevelTest<'a> {
    game: &'a dyn Game,
    levels: String,
    named: Vec<Named>,
    draw: ActionDraw,
    episodes: u32,
    seed: u64,
    detectors: DetectorChoice,
    threads: usize,
    folder: PathBuf,
    minimise: bool,
    program: String,
}

impl LevelTest<'_> {
    /// Names the levels: `MODE:first..last`, both included, or `files:levels/*.json`. Assertions about recordings and
    /// findings need no levels.
    pub fn levels(mut self, levels: &str) -> Self {
        levels.clone_into(&mut self.levels);
        self
    }

    /// Adds a bot of the game.
    pub fn bot(mut self, name: &str) -> Self {
        self.named.push(Named::Bot(name.to_owned()));
        self
    }

    /// Adds bots of the game.
    pub fn bots<'b>(self, names: impl IntoIterator<Item = &'b str>) -> Self {
        names.into_iter().fold(self, Self::bot)
    }

    /// Adds the policy in a file that `playbot policy export` has written.
    pub fn policy(mut self, file: impl AsRef<Path>) -> Self {
        self.named.push(Named::Policy { path: file.as_ref().to_owned(), draw: self.draw });
        self
    }

    /// Makes policies that are added from here on take their most probable action instead of drawing one.
    pub fn greedy(mut self) -> Self {
        self.draw = ActionDraw::Greedy;
        self
    }

    /// Adds any player. The command line does not know it, so a failure shows only the commands that replay files.
    pub fn player(mut self, name: &str, player: Player) -> Self {
        self.named.push(Named::Player { name: name.to_owned(), player });
        self
    }

    /// Sets the episodes of each tester on each level, at least 1.
    pub fn episodes(mut self, episodes: u32) -> Self {
        self.episodes = episodes.max(1);
        self
    }

    /// Sets the random seed of the testers. Default: 0.
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Adds an opt-in detector; `all` for all of them. `playbot test --detectors` lists them.
    pub fn detect(mut self, detector: &str) -> Self {
        self.detectors.with.push(detector.to_owned());
        self
    }

    /// Leaves out a default detector; `all` leaves out every detector that is not named.
    pub fn without_detector(mut self, detector: &str) -> Self {
        self.detectors.without.push(detector.to_owned());
        self
    }

    /// Changes a setting of a detector, such as `stuck.ticks=200`.
    pub fn set_detector(mut self, setting: &str) -> Self {
        self.detectors.settings.push(setting.to_owned());
        self
    }

    /// Sets the number of threads, at least 1. It changes no result.
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads.max(1);
        self
    }

    /// Sets the folder for findings and failed episodes. They go into its subfolder `findings`.
    pub fn findings_in(mut self, folder: impl AsRef<Path>) -> Self {
        self.folder = folder.as_ref().to_owned();
        self
    }

    /// Shortens findings: leaves out the actions that they do not need, which takes up to 500 replays each.
    pub fn minimise(mut self) -> Self {
        self.minimise = true;
        self
    }

    /// Sets the command that starts the program in a failure's messages, such as `cargo run --release --`. Default:
    /// `playbot`.
    pub fn program(mut self, program: &str) -> Self {
        program.clone_into(&mut self.program);
        self
    }

    /// Asserts that at least one tester reaches the goal of each level.
    ///
    /// # Panics
    ///
    /// A level was not solved. The message names each, with the results of its testers, the proof if it is unsolvable,
    /// and the commands that show it. Or the levels cannot be tested.
    #[track_caller]
    pub fn assert_levels_solvable(&self) {
        if let Err(message) = self.check(Wanted::Solvable) {
            panic!("{message}");
        }
    }

    /// Asserts that every tester reaches the goal of each level in every episode.
    ///
    /// # Panics
    ///
    /// As for [`assert_levels_solvable`](Self::assert_levels_solvable).
    #[track_caller]
    pub fn assert_levels_solved(&self) {
        if let Err(message) = self.check(Wanted::Solved) {
            panic!("{message}");
        }
    }

    /// Asserts that nothing is found on any level: no finding of a detector, no panic, and no proof that the goal is
    /// out of reach.
    ///
    /// # Panics
    ///
    /// Something was found: the message has it, with the command that replays it. Or the levels cannot be tested.
    #[track_caller]
    pub fn assert_no_findings(&self) {
        if let Err(message) = self.check(Wanted::NoFindings) {
            panic!("{message}");
        }
    }

    /// Asserts that each tester repeats its episode on each level, with the detector `determinism` alone and on every
    /// level.
    ///
    /// # Panics
    ///
    /// An episode differed: the message has the first tick that differs. Or it broke, or the levels cannot be tested.
    #[track_caller]
    pub fn assert_deterministic(&self) {
        if let Err(message) = self.check(Wanted::Deterministic) {
            panic!("{message}");
        }
    }

    /// Asserts that a recording replays bit for bit, or that a finding (a `.finding`) happens again in the same tick and
    /// with the same state. For a folder, this is asserted of all recordings and findings in it. Levels, testers and
    /// detectors are those of the files.
    ///
    /// # Panics
    ///
    /// A replay differs: the message has the first tick that differs, and the command that shows it. Or the path has no
    /// recording or finding, holds no episode, is damaged, or is of another game or version.
    #[track_caller]
    pub fn assert_replays(&self, path: impl AsRef<Path>) {
        if let Err(message) = self.check_replays(path.as_ref()) {
            panic!("{message}");
        }
    }

    /// Asserts that no finding in this folder happens any more, so that repaired defects stay repaired:
    /// `playbot test --regress` for `cargo test`. Findings that are pinned in a `pins.ron` there do not count up to
    /// their last day. Levels, testers and detectors are those of the files.
    ///
    /// # Panics
    ///
    /// A finding still happens or cannot be played: the message has the commands that show it. Or the folder has no
    /// findings.
    #[track_caller]
    pub fn assert_findings_gone(&self, folder: impl AsRef<Path>) {
        if let Err(message) = self.check_gone(folder.as_ref()) {
            panic!("{message}");
        }
    }

    /// Returns the verdicts on all levels, in their order, for assertions of one's own. Writes no file.
    ///
    /// # Errors
    ///
    /// The levels cannot be tested.
    pub fn verdicts(&self) -> Result<Vec<LevelVerdict>, LevelTestError> {
        self.all()
    }
}

/// An assertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    /// At least one tester reaches the goal.
    Solvable,
    /// Every tester reaches the goal in every episode.
    Solved,
    /// Nothing is found.
    NoFindings,
    /// Episodes are the same again.
    Deterministic,
    /// No condition: the caller reads the verdicts.
    Nothing,
}

impl Wanted {
    /// Returns whether the assertion holds for a level.
    pub fn holds(self, level: &LevelVerdict) -> bool {
        match self {
            Self::Solvable => level.outcome == LevelOutcome::Solved,
            Self::Solved => {
                level.score.episodes > 0
                    && level.testers.iter().all(|tester| tester.score.solved == tester.score.episodes)
            }
            Self::NoFindings => level.findings.is_empty(),
            // A panic hides whether the episode would repeat.
            Self::Deterministic => level.findings.iter().all(|finding| finding.detector == UNREACHABLE),
            Self::Nothing => false,
        }
    }

    /// Returns the headline for this number of broken levels.
    pub fn complaint(self, broken: usize, levels: u64) -> String {
        let was = if broken == 1 { "was" } else { "were" };
        let of = format!("{broken} of {}", counted(levels, "level"));
        match self {
            Self::Solvable => format!("{of} {was} not solved by any tester"),
            Self::Solved => format!("{of} {was} not solved by every tester in every episode"),
            Self::NoFindings => format!("something was found on {of}"),
            Self::Deterministic => format!("{of} did not play the same again"),
            Self::Nothing => of,
        }
    }

    /// Returns whether an unsolved episode is a failure.
    pub fn is_about_solving(self) -> bool {
        matches!(self, Self::Solvable | Self::Solved)
    }
}

/// Returns the folder for the findings of a game: `target/playbot-findings/` and the game's name.
fn default_folder(game: &str) -> PathBuf {
    let program = env::current_exe().ok();
    let target = program.as_deref().and_then(target_of).map(Path::to_owned);
    let target = target.or_else(|| env::var_os("CARGO_TARGET_DIR").map(PathBuf::from));
    let folder = target.unwrap_or_else(|| "target".into()).join("playbot-findings").join(game);
    // Commands may be called from other folders.
    std::path::absolute(&folder).unwrap_or(folder)
}

/// Returns the folder that cargo built a program into: the ancestor that cargo marks as a cache.
fn target_of(program: &Path) -> Option<&Path> {
    program.ancestors().skip(1).find(|folder| folder.join("CACHEDIR.TAG").is_file())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Two testers with two episodes each, and the solved ones of each.
    fn level(solved: [u64; 2], found: &[&str]) -> LevelVerdict {
        let score = |solved: u64, episodes: u64| {
            json!({
                "solved": solved, "episodes": episodes, "interval": [0.0, 1.0], "ticks": null,
                "lost": episodes - solved, "timed_out": 0, "broken": 0,
            })
        };
        let all = solved[0] + solved[1];
        let mut level = score(all, 4);
        level["level"] = "hard:0".into();
        level["index"] = 0.into();
        level["outcome"] = if all > 0 { "solved".into() } else { "bot-failed".into() };
        level["proof"] = "unknown".into();
        level["ends"] = json!([]);
        let testers = ["a", "b"].into_iter().zip(solved).map(|(name, solved)| {
            let mut tester = score(solved, 2);
            tester["tester"] = name.into();
            tester["exact"] = true.into();
            tester
        });
        level["testers"] = testers.collect();
        let finding = |detector: &&str| json!({ "detector": detector, "tester": null, "episode": null, "tick": null, "message": "" });
        level["findings"] = found.iter().map(finding).collect();
        serde_json::from_value(level).expect("a verdict")
    }

    #[test]
    fn each_assertion_asks_for_something_else() {
        let all = [Wanted::Solvable, Wanted::Solved, Wanted::NoFindings, Wanted::Deterministic];
        let holds = |level: &LevelVerdict| all.map(|wanted| wanted.holds(level));
        assert_eq!(holds(&level([2, 2], &[])), [true; 4]);
        assert_eq!(holds(&level([2, 1], &[])), [true, false, true, true]);
        assert_eq!(holds(&level([0, 0], &["stuck"])), [false; 4]);
        assert_eq!(holds(&level([0, 0], &[UNREACHABLE])), [false, false, false, true]);
        assert!(!Wanted::Nothing.holds(&level([2, 2], &[])), "all are asked for");
        assert_eq!(Wanted::Solvable.complaint(1, 3), "1 of 3 levels was not solved by any tester");
    }

    #[test]
    fn findings_go_below_the_folder_that_cargo_builds_into() {
        let folder = tempfile::tempdir().expect("a folder");
        let deps = folder.path().join("target/release/deps");
        std::fs::create_dir_all(&deps).expect("writable");
        let program = deps.join("levels-0f");
        assert_eq!(target_of(&program), None);
        std::fs::write(folder.path().join("target/CACHEDIR.TAG"), "").expect("writable");
        assert_eq!(target_of(&program), Some(folder.path().join("target").as_path()));
        let default = default_folder("garden");
        assert!(default.is_absolute() && default.ends_with("playbot-findings/garden"), "{}", default.display());
    }
}
