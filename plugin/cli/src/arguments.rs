//! Options that several verbs have: threads and device, levels, and overwriting of recordings; numbers on the command
//! line; and the default mode and levels.
//!
//! The folder, in reading order:
//!
//! - `open`: opening of files that the command line names, with advice for missing ones.
//! - `experiment`: reading of experiments, from a path or from those that come with the program, with the changes of
//!   the command line.
//! - `cluster`: workers on this machine and on others.
//! - `player`: players named on the command line, and their measurement.

pub(crate) mod cluster;
pub(crate) mod experiment;
pub(crate) mod open;
pub(crate) mod player;

use crate::{error::CliError, output::prepare};
use bevy_playbot::demo::file::{DemoFault, DemoFileError, DemoHeader, DemoWriter};
use playbot_harness::{
    doctor::UnequalSteps,
    game::Game,
    games::Games,
    held_out::is_only_level,
    machine::usable_threads,
    parallel::default_threads,
    split::{LevelSplit, check_level, last_level},
    worlds,
};
use playbot_learner::DeviceKind;
use playbot_train::{
    Experiment,
    experiment::{experiment_of, file::parse_experiment},
};
use std::{num::IntErrorKind, path::Path};

/// Checks that a game starts in this mode, before a verb prints or writes anything. A panic is the first thing that is
/// printed.
///
/// # Errors
///
/// The game panicked while it was added to the app, or in a startup system.
pub(crate) fn check_start(game: &dyn Game, mode: &str, level: u64) -> Result<(), CliError> {
    Ok(worlds::check_start(game, mode, level, report_panic)?)
}

/// Checks as [`check_start`] does, and warns if the game's fixed steps may see a press several times, or never: for verbs
/// whose results depend on that.
///
/// # Errors
///
/// As for [`check_start`].
pub(crate) fn check_start_and_steps(game: &dyn Game, mode: &str, level: u64) -> Result<(), CliError> {
    unequal_steps(game, mode, level)?.iter().for_each(|steps| report!("warning: {}", steps.line()));
    Ok(())
}

/// Checks as [`check_start`] does, and returns the lengths of frames and fixed steps, if they differ and that matters.
fn unequal_steps(game: &dyn Game, mode: &str, level: u64) -> Result<Option<UnequalSteps>, CliError> {
    let mut unequal = None;
    worlds::check_start_and_look(game, mode, level, report_panic, |world, agent| {
        unequal = UnequalSteps::of_presses(world, agent);
    })?;
    Ok(unequal)
}

fn report_panic(panic: &str) {
    report!("the game panicked: {panic}");
}

/// Returns the game of this name, or the only game of the program if none is named. `verb` says what is done with it,
/// and `instead` what can be named in its place.
///
/// # Errors
///
/// The program has no such game, or it has several and none is named.
pub(crate) fn named_or_only<'a>(
    games: &Games<'a>,
    name: Option<&str>,
    verb: &str,
    instead: &str,
) -> Result<&'a dyn Game, CliError> {
    let names: Vec<&str> = games.iter().map(|game| game.name()).collect();
    match (name, names.as_slice()) {
        (Some(name), _) => Ok(games.get(name)?),
        (None, [_]) => Ok(games.first()),
        (None, _) => Err(CliError::Usage(format!("name the game to {verb} ({}){instead}", names.join(", ")))),
    }
}

/// More threads than any machine has cores.
pub(crate) const MOST_THREADS: usize = 1024;

/// The number of threads.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct Threads {
    /// Most threads that compute at a time. The result does not depend on their number.
    #[arg(long, default_value_t = threads_for_cores(), value_parser = number_of_threads)]
    threads: usize,
}

impl Threads {
    /// Returns the number of threads: the requested one, or as many as the system's limits allow.
    pub fn count(self) -> usize {
        usable_threads(self.threads)
    }
}

impl Default for Threads {
    fn default() -> Self {
        Self { threads: threads_for_cores() }
    }
}

/// Returns one thread for each core, up to the limit.
fn threads_for_cores() -> usize {
    default_threads().min(MOST_THREADS)
}

/// Parses a number of threads.
///
/// # Errors
///
/// It is 0, no number, or more than [`MOST_THREADS`].
fn number_of_threads(text: &str) -> Result<usize, String> {
    match at_least_one(text)? {
        threads if threads > MOST_THREADS => {
            Err(format!("it must be at most {MOST_THREADS}: more threads than a machine has cores make nothing faster"))
        }
        threads => Ok(threads),
    }
}

/// The device that computes networks.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct Device {
    /// Device: flex or ndarray on the CPU, wgpu or cuda on a graphics card in programs built with these features.
    #[arg(long, default_value_t)]
    pub device: DeviceKind,
}

/// Threads and device, for verbs that learn or measure.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct Compute {
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    device: Device,
}

impl Compute {
    /// Returns the number of threads: the requested one, or as many as the system's limits allow.
    pub fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Returns the device that computes networks.
    pub fn device(&self) -> DeviceKind {
        self.device.device
    }
}

/// Returns the revision of playbot that this program was built from.
pub(crate) fn revision() -> &'static str {
    env!("PLAYBOT_REVISION")
}

/// Returns the version of playbot that trained something. A game's own version stands elsewhere.
pub(crate) fn code(version: &str, revision: &str) -> String {
    format!("playbot {version} ({revision})")
}

/// Returns the version of playbot that runs.
pub(crate) fn own_code() -> String {
    code(env!("CARGO_PKG_VERSION"), revision())
}

/// Parses a number of steps, also as `1_000_000`, `1e6` or `2.5e6`.
///
/// # Errors
///
/// It is no whole number, is below 0, or is too large.
pub(crate) fn number_of_steps(text: &str) -> Result<u64, String> {
    let wanted = || "it must be a whole number, 0 or more, such as 1000000 or 1e6".to_owned();
    let too_large = || "the number is too large".to_owned();
    let (digits, power) = match text.split_once(['e', 'E']) {
        Some((digits, power)) => (digits, power.parse::<u32>().map_err(|_| wanted())?),
        None => (text, 0),
    };
    let digits = digits.replace('_', "");
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits.as_str(), ""));
    let fraction = fraction.trim_end_matches('0');
    let zeros = power.checked_sub(fraction.len() as u32).ok_or_else(wanted)?;
    let number = format!("{whole}{fraction}").parse::<u64>().map_err(|error| match error.kind() {
        IntErrorKind::PosOverflow => too_large(),
        _ => wanted(),
    })?;
    10_u64.checked_pow(zeros).and_then(|factor| number.checked_mul(factor)).ok_or_else(too_large)
}

/// Parses a number of steps that is at least 1.
///
/// # Errors
///
/// As for [`number_of_steps`], and it is 0.
pub(crate) fn at_least_one_step(text: &str) -> Result<u64, String> {
    match number_of_steps(text)? {
        0 => Err("it must be at least 1".to_owned()),
        steps => Ok(steps),
    }
}

/// Parses a number that others can be compared with. Nothing is above or below NaN.
///
/// # Errors
///
/// It is no number, or is not finite.
pub(crate) fn finite_number(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| "it must be a number, such as 0.5".to_owned())
}

/// Parses a number of at least one.
///
/// # Errors
///
/// It is 0 or no number.
fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("it must be at least 1".to_owned()),
        Ok(number) => Ok(number),
        Err(_) => Err("it must be a whole number, at least 1".to_owned()),
    }
}

/// Parses a name in a list with commas.
///
/// # Errors
///
/// It is empty.
pub(crate) fn name_in_list(name: &str) -> Result<String, String> {
    match name.trim() {
        "" => Err("a name is missing beside a comma".to_owned()),
        name => Ok(name.to_owned()),
    }
}

/// The level of verbs that play a single one.
#[derive(clap::Args, Clone, Debug)]
pub struct LevelsArg {
    /// Levels, as mode:first..last or files:pattern, such as "files:levels/*.json". The first of them is taken, or the
    /// one of --level.
    #[arg(long, conflicts_with = "mode")]
    levels: Option<LevelSplit>,
    /// Number of the level, also as mode:number, as files:path, or its name in a level editor (default: 0, or the first of
    /// the levels).
    #[arg(long, value_name = "N")]
    level: Option<u64>,
}

/// Returns the number of the level. Up to version 0.1 it was named by --seed in verbs that play a single level: alone
/// it still is, with a warning.
pub(crate) fn level_number(level: Option<u64>, seed: Option<u64>) -> Option<u64> {
    if let (None, Some(seed)) = (level, seed) {
        report!(
            "warning: --seed {seed} is taken as the level, which the next version will not do: --seed names the random \
             seed; for a level use --level {seed}"
        );
    }
    level.or(seed)
}

impl LevelsArg {
    /// Returns true if levels are named, and with them their mode.
    pub fn is_named(&self) -> bool {
        self.levels.is_some()
    }

    /// Returns the number of the level if one is named: by --level, or by `seed`, the value of --seed.
    pub fn number(&self, seed: Option<u64>) -> Option<u64> {
        level_number(self.level, seed)
    }

    /// Returns the random seed for the value of --seed, which names the level instead where no --level is given.
    pub fn random_seed(&self, seed: Option<u64>) -> u64 {
        self.level.and(seed).unwrap_or(0)
    }

    /// Returns the mode and the level to play. Without levels these are `mode`, and level 0 unless another one is
    /// named by --level, or by `seed`, the value of --seed.
    ///
    /// # Errors
    ///
    /// The game does not have these levels, or the named level is none of them.
    pub fn choose<'a>(
        &'a self,
        game: &dyn Game,
        mode: Option<&'a str>,
        seed: Option<u64>,
    ) -> Result<(Option<&'a str>, u64), CliError> {
        let Some(levels) = &self.levels else {
            let level = self.number(seed).unwrap_or(0);
            check_level(game, mode.unwrap_or_else(|| default_mode(game)), level)?;
            return Ok((mode, level));
        };
        levels.check(game)?;
        let level = self.number(seed).unwrap_or(levels.first);
        if levels.contains(&levels.mode, level) {
            return Ok((Some(levels.mode.as_str()), level));
        }
        Err(CliError::Usage(format!("--level {level} is none of the levels {levels}")))
    }
}

/// Options for an existing recording.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct OverwriteArgs {
    /// Add to an existing recording.
    #[arg(long, conflicts_with = "force")]
    append: bool,
    /// Overwrite an existing recording.
    #[arg(long)]
    force: bool,
}

impl OverwriteArgs {
    /// Returns whether the file exists and is added to.
    pub fn adds_to(self, path: &Path) -> bool {
        self.append && path.is_file()
    }

    /// Returns whether an existing file is overwritten.
    pub fn replaces(self) -> bool {
        self.force
    }

    /// Opens the file, and makes its folder.
    ///
    /// # Errors
    ///
    /// The file exists without --append or --force, was recorded under other conditions, or cannot be written.
    pub fn open(self, path: &Path, header: DemoHeader) -> Result<DemoWriter, CliError> {
        if !self.adds_to(path) {
            prepare(path)?;
        }
        let opened = match self {
            Self { append: true, .. } => DemoWriter::append(path, &header),
            Self { force: true, .. } => DemoWriter::replace(path, header),
            _ => DemoWriter::create(path, header),
        };
        opened.map_err(explain)
    }
}

/// Explains the error of a recording that was not opened, with the options that would open it.
fn explain(error: DemoFileError) -> CliError {
    match error.fault {
        DemoFault::Exists => CliError::Usage(format!(
            "{error}: add to it with --append, overwrite it with --force, or name another file"
        )),
        DemoFault::HeaderDiffers { .. } => CliError::Usage(format!("{error}, or overwrite this one with --force")),
        _ => error.into(),
    }
}

// Default mode and levels of every verb.

/// The default experiment of a game.
pub struct DefaultExperiment {
    /// Its origin, in words or as a path.
    pub origin: String,
    /// All its values.
    pub experiment: Experiment,
}

/// Returns the default experiment of a game; `None` if the game brings one that cannot be read.
pub(crate) fn default_experiment_of(game: &dyn Game) -> Option<DefaultExperiment> {
    let text = experiment_of(game);
    let experiment = parse_experiment(&text.text, Path::new(&*text.origin)).ok()?;
    Some(DefaultExperiment { origin: text.origin.into_owned(), experiment })
}

/// Returns the default mode of every verb: the one of the training levels, without its options.
pub(crate) fn default_mode(game: &dyn Game) -> &'static str {
    let modes = game.modes();
    let trained = default_experiment_of(game).map(|default| default.experiment.train.mode).unwrap_or_default();
    let name = trained.split('+').next().unwrap_or_default();
    let known = |wanted: &str| modes.iter().copied().find(|mode| *mode == wanted);
    known(&trained).or_else(|| known(name)).or(modes.first().copied()).unwrap_or_default()
}

/// Returns the default held-out levels, those of the game's experiment; `None` if the game brings none that it has, or
/// has a [single level](is_only_level).
pub(crate) fn default_held_out(game: &dyn Game) -> Option<LevelSplit> {
    let test = default_experiment_of(game)?.experiment.test;
    (test.check(game).is_ok() && !is_only_level(game, &test.mode)).then_some(test)
}

/// Returns the levels 0 to `last` of the [`default_mode`], as far as the game has them.
pub(crate) fn first_levels(game: &dyn Game, last: u64) -> LevelSplit {
    LevelSplit { mode: default_mode(game).to_owned(), first: 0, last }.within(game)
}

/// The most levels that are tested and audited by default.
const MOST_TESTED: u64 = 64;

/// Returns the default levels of tests and audits: the default held-out ones, or all levels of a game that brings no
/// experiment and has at most 64.
pub(crate) fn default_tested(game: &dyn Game) -> LevelSplit {
    let mode = default_mode(game);
    let has_few = last_level(game, mode).is_some_and(|last| last < MOST_TESTED);
    let held_out = if has_few && game.tools().training.experiment().is_none() { None } else { default_held_out(game) };
    held_out.unwrap_or_else(|| first_levels(game, MOST_TESTED - 1))
}

/// Reports how the other agents play, where a verb is about one of several agents that play together.
pub(crate) fn report_agents_along(game: &dyn Game) {
    let (agents, name) = (game.tools().host.agents_per_arena(), game.name());
    if agents > 1 {
        let along = match game.tools().bots.demonstrator() {
            Some(demonstrator) => format!("by the demonstrator `{demonstrator}`"),
            None => "at random, as `chaos` does".to_owned(),
        };
        report!(
            "`{name}` has {agents} agents that play together: this is about the first one, and the others play along {along}"
        );
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    };

    use bevy::prelude::*;
    use bevy_playbot::action::ActionSpace;
    use playbot_harness::foreign::ForeignGame;

    use super::*;

    #[test]
    fn the_first_world_shows_whether_fixed_steps_see_each_press_once() {
        let built = Arc::new(AtomicU32::new(0));
        let count = Arc::clone(&built);
        let game = ForeignGame::new("hop", 1, move |app: &mut App| {
            count.fetch_add(1, Ordering::Relaxed);
            app.add_systems(FixedUpdate, |_: Res<ButtonInput<KeyCode>>| {});
        });
        let game = game.observe(["nothing"], || [0.0]);
        let keys = || game.clone().keys([vec![], vec![KeyCode::Space]]);
        let line = |game: ForeignGame| {
            let unequal = unequal_steps(&game, "default", 0).expect("it starts");
            unequal.map(|steps| steps.line())
        };
        let words = "a frame is 16.667 ms, a fixed step 15.625 ms: systems in fixed steps see a key that was just pressed \
                     once or more often, and once if you set `.hz(64.0)` in the adapter, or \
                     `Time::<Fixed>::from_hz(60.0)` in the game";
        assert_eq!(line(keys()).as_deref(), Some(words));
        assert_eq!(built.load(Ordering::Relaxed), 1, "one World is enough");
        assert_eq!(line(keys().hz(64.0)), None, "the clocks agree");
        assert_eq!(line(game.clone().actions(ActionSpace::Discrete(2), || {})), None, "its actions press nothing");
        let broken = ForeignGame::new("hop", 1, |_: &mut App| panic!("no track"));
        let broken = broken.keys([vec![], vec![KeyCode::Space]]).observe(["nothing"], || [0.0]);
        assert!(unequal_steps(&broken, "default", 0).is_err());
    }

    #[test]
    fn a_game_needs_no_name_in_a_program_that_has_only_one() {
        let game = |name| ForeignGame::new(name, 1, |_: &mut App| {});
        let (hop, run) = (game("hop"), game("run"));
        let one: [&dyn Game; 1] = [&hop];
        let two: [&dyn Game; 2] = [&hop, &run];
        let chosen = |games: &[&dyn Game], name| {
            let games = Games::new(games).expect("different names");
            let chosen = named_or_only(&games, name, "watch", ", or a file");
            chosen.map(|game| game.name()).map_err(|error| error.to_string())
        };
        assert_eq!(chosen(&one, None), Ok("hop"));
        assert_eq!(chosen(&two, Some("run")), Ok("run"));
        assert_eq!(chosen(&two, None), Err("name the game to watch (hop, run), or a file".to_owned()));
        assert!(chosen(&one, Some("run")).is_err_and(|words| words.contains("`run`")));
    }

    #[test]
    fn steps_are_read_with_underscores_and_powers_of_ten() {
        for (text, steps) in [
            ("0", 0),
            ("200000", 200_000),
            ("1_000_000", 1_000_000),
            ("1e6", 1_000_000),
            ("2.5E6", 2_500_000),
            ("3e0", 3),
            ("10.0", 10),
            ("18446744073709551615", u64::MAX),
        ] {
            assert_eq!(number_of_steps(text), Ok(steps), "{text}");
        }
        for text in ["", "_", "e6", "1e", "1.5", "1e-3", "2.55e1", "-1", "many", "1e6e6", "1.2.3e9"] {
            let words = number_of_steps(text).expect_err(text);
            assert_eq!(words, "it must be a whole number, 0 or more, such as 1000000 or 1e6", "{text}");
        }
        for text in ["18446744073709551616", "1e20", "2e19", "1e4000000000"] {
            assert_eq!(number_of_steps(text), Err("the number is too large".to_owned()), "{text}");
        }
        assert_eq!(at_least_one_step("0"), Err("it must be at least 1".to_owned()));
        assert_eq!(at_least_one_step("5e5"), Ok(500_000));
        assert_eq!((finite_number("-1.5e3"), finite_number("0")), (Ok(-1500.0), Ok(0.0)));
        for wrong in ["nan", "inf", "-inf", "1e999", "a", ""] {
            assert_eq!(finite_number(wrong), Err("it must be a number, such as 0.5".to_owned()), "{wrong}");
        }
    }

    #[test]
    fn the_first_level_is_meant_unless_another_one_is_named() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let named =
            |levels: Option<&str>, level| LevelsArg { levels: levels.map(|it| it.parse().expect("levels")), level };
        let chosen = |levels, level, seed| {
            let args = named(levels, level);
            args.choose(&game, None, seed)
                .map(|(mode, level)| (mode.map(str::to_owned), level))
                .map_err(|it| it.to_string())
        };
        let (range, default) = (Some("default:4..9"), Some("default".to_owned()));
        assert_eq!(chosen(range, None, None), Ok((default.clone(), 4)));
        assert_eq!(chosen(range, Some(7), None), Ok((default.clone(), 7)));
        assert_eq!(chosen(range, None, Some(7)), Ok((default.clone(), 7)), "as it was up to version 0.1");
        assert_eq!(chosen(range, Some(8), Some(7)), Ok((default, 8)));
        assert_eq!(chosen(range, Some(3), None), Err("--level 3 is none of the levels default:4..9".to_owned()));
        assert_eq!(named(None, None).choose(&game, Some("x"), Some(3)).expect("a level"), (Some("x"), 3));
        assert_eq!(chosen(None, None, None), Ok((None, 0)));
        assert!(chosen(Some("other:0..1"), None, None).is_err(), "the game has no such mode");
        assert_eq!(named(None, Some(3)).random_seed(Some(7)), 7);
        assert_eq!(named(None, Some(3)).random_seed(None), 0);
        assert_eq!(named(None, None).random_seed(Some(7)), 0, "it names the level");
    }

    #[test]
    fn what_is_in_the_way_is_named_with_the_options_that_help() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("new/a.demo");
        let said = |args: OverwriteArgs, game: &str, path: &Path| {
            let header = DemoHeader::new(game, 1, "easy", 60.0, ActionSpace::Discrete(3));
            args.open(path, header).map(|_| ()).map_err(|error| (error.exit_code(), error.to_string()))
        };
        let (plain, append) = (OverwriteArgs::default(), OverwriteArgs { append: true, force: false });
        said(plain, "runner", &path).expect("nothing is there yet");
        let (code, words) = said(plain, "runner", &path).expect_err("there already");
        assert_eq!(code, 3);
        assert!(words.contains("exists already; nothing was written: add to it with --append"), "{words}");
        assert!(words.contains("--force"), "{words}");
        let (code, words) = said(append, "maze", &path).expect_err("another game");
        assert_eq!(code, 3);
        assert!(words.contains("record to another file, or overwrite this one with --force"), "{words}");
        said(append, "runner", &path).expect("of the same game");
        let (code, words) = said(plain, "runner", folder.path()).expect_err("a folder");
        assert!(code == 3 && words.contains("is a folder: name a file"), "{words}");
        let (code, words) = said(plain, "runner", &path.join("b.demo")).expect_err("below a file");
        assert!(code == 2 && words.contains("name a file in another folder"), "{words}");
    }

    #[test]
    fn a_game_without_an_experiment_has_its_first_mode_and_other_levels_held_out() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let default = default_experiment_of(&game).expect("the plainest");
        assert_eq!(default.origin, "the experiment of runner");
        assert_eq!(default_mode(&game), Game::modes(&game)[0]);
        let held_out = default_held_out(&game).expect("a mode of the game");
        assert_eq!(held_out, default.experiment.test);
        assert!(!held_out.overlaps(&default.experiment.train));
        assert_eq!(first_levels(&game, 9).to_string(), "default:0..9");
        assert_eq!(default_tested(&game), held_out);
    }

    #[test]
    fn default_levels_are_levels_of_the_game() {
        let game = |count| ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {}).levels(count);
        for (count, first, tested, held_out) in [
            (1, "default:0..0", "default:0..0", None),
            (8, "default:0..7", "default:0..7", Some("default:4..7")),
            (64, "default:0..63", "default:0..63", Some("default:32..63")),
            (100, "default:0..99", "default:50..99", Some("default:50..99")),
            (240, "default:0..239", "default:64..127", Some("default:64..127")),
        ] {
            let game = game(count);
            assert_eq!(first_levels(&game, 499).to_string(), first);
            assert_eq!(default_tested(&game).to_string(), tested);
            assert_eq!(default_held_out(&game).map(|split| split.to_string()).as_deref(), held_out);
        }
    }
}
