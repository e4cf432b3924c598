//! Assertions about levels, with settings.

use std::path::{Path, PathBuf};

use bevy_playbot::policy::ActionDraw;

use super::{error::LevelTestError, testers::Named, usual_folder::usual_folder, wanted::Wanted};
use crate::{detectors::DetectorChoice, eval::Player, game::Game, parallel::default_threads, verdict::LevelVerdict};

/// A test of levels: set up first, then asserted.
///
/// Testers are named with [`bot`](Self::bot), [`policy`](Self::policy) and [`player`](Self::player). Without them, the
/// game's demonstrator or else its first bot must solve the levels, and all of its bots play when findings are
/// asserted.
#[derive(Clone)]
#[must_use = "nothing is tested before something is asserted"]
pub struct LevelTest<'a> {
    pub(super) game: &'a dyn Game,
    pub(super) levels: String,
    pub(super) named: Vec<Named>,
    pub(super) draw: ActionDraw,
    pub(super) episodes: u32,
    pub(super) seed: u64,
    pub(super) detectors: DetectorChoice,
    pub(super) threads: usize,
    pub(super) folder: PathBuf,
    pub(super) minimise: bool,
    pub(super) program: String,
}

impl<'a> LevelTest<'a> {
    /// Creates a test of these levels: `MODE:first..last`, both included, or `files:levels/*.json`. Each tester plays
    /// one episode on each level, with the default detectors, on all cores.
    pub fn new(game: &'a dyn Game, levels: &str) -> Self {
        Self {
            game,
            levels: levels.to_owned(),
            named: Vec::new(),
            draw: ActionDraw::Sample,
            episodes: 1,
            seed: 0,
            detectors: DetectorChoice::default(),
            threads: default_threads(),
            folder: usual_folder(game.name()),
            minimise: false,
            program: "playbot".to_owned(),
        }
    }

    /// Adds a bot of the game.
    pub fn bot(mut self, name: &str) -> Self {
        self.named.push(Named::Bot(name.to_owned()));
        self
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
    /// A level was not solved: the message names each, with the results of its testers, the proof if it is unsolvable,
    /// and the commands that show it. Or the levels cannot be tested.
    #[track_caller]
    pub fn assert_solvable(&self) {
        if let Err(message) = self.check(Wanted::Solvable) {
            panic!("{message}");
        }
    }

    /// Asserts that every tester reaches the goal of each level in every episode.
    ///
    /// # Panics
    ///
    /// As for [`assert_solvable`](Self::assert_solvable).
    #[track_caller]
    pub fn assert_solved(&self) {
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

    /// Returns the verdicts on all levels, in their order, for assertions of one's own. Writes no file.
    ///
    /// # Errors
    ///
    /// The levels cannot be tested.
    pub fn verdicts(&self) -> Result<Vec<LevelVerdict>, LevelTestError> {
        self.all()
    }
}
