//! The command line's verbs and their dispatch. Help texts are in `help`.

mod help;

use crate::{
    arguments::{default_mode, first_levels},
    error::{CliError, Outcome},
    output::{GamesPrintElsewhere, log, program},
    progress,
    progress::interrupt,
    verbs::{
        bench, bisect, bugs, completions, config, demo, diagnose, doctor, eval, explore, eyes, history, imitate, init,
        learn_skills, level, levels, play, policy, quickstart, record, replay, report, review, runs, serve, skills,
        study, teach, test, trace, train, view, watch, work,
    },
};
use bevy_playbot::unknown_name::{nearest, question};
use clap::{Arg, ArgAction, Command, CommandFactory, FromArgMatches, Parser, Subcommand, error::ErrorKind};
use playbot_harness::{
    game::Game,
    games::Games,
    level_files::{LevelFileError, is_level_files, level_file_pattern},
    machine::usable_threads,
    parallel::default_threads,
    split::{LevelSplit, SplitError},
};
use playbot_learner::{UnknownDevice, Workers, limit_by_environment};
use std::{
    error::Error,
    ffi::{OsStr, OsString},
    io::IsTerminal,
    num::{IntErrorKind, ParseFloatError, ParseIntError},
    panic::AssertUnwindSafe,
    path::Path,
    process::ExitCode,
};

/// Playtesting bots that learn from demonstrations.
#[derive(Parser)]
#[command(name = program::DEFAULT_NAME, version, after_help = EXAMPLES)]
pub(crate) struct Cli {
    /// Verb to run; `quickstart` if left out.
    #[command(subcommand)]
    verb: Option<Verb>,
    /// Print what happens inside, and equal messages of a game each time. Given twice, it prints more.
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    verbose: u8,
}

/// The most columns of help on a terminal: longer lines are hard to read.
const WIDEST: usize = 100;

const EXAMPLES: &str = "\
Examples:
  playbot init --dry-run   which files would describe the game in this folder?
  playbot   learn from recordings of GAME, train, test, and write a report
  playbot level GAME --level 7   show a level
  playbot record GAME --levels MODE:0..9 --out my.demo
  playbot play GAME --level 7 --record my.demo   play it yourself
  playbot demo verify my.demo   does it replay?
  playbot doctor GAME   is the game the same every time?
  playbot explore GAME --level MODE:7   what can be reached?
  playbot learn-skills --out skills.safetensors
  playbot train --skills skills.safetensors --run runs/first
  playbot eval --run runs/first --json
  playbot test GAME --levels MODE:0..99 --out runs/test   which levels can be solved?
  playbot watch GAME --levels MODE:0..9   test levels while they are drawn
  playbot replay runs/test/findings/NAME.finding --apng failure.png   what was found
  playbot review runs/test   keep or pin the findings one by one
  playbot policy export --run runs/first --out GAME.policy
  playbot config show --set ppo.lr=0.0003   an experiment with all its values
  playbot study --experiment my.ron --out study
  playbot view GAME --level 64 --run runs/first --episode --out episode.png
  playbot runs compare runs/first runs/second --plot compare.svg
  playbot bugs make --seed 1 --out runs/bugs   plant defects, to measure testers

Exit codes: 0 all is well, 1 findings, 2 the program failed, 3 wrong usage or configuration,
130 stopped by Ctrl-C before it was done, 143 and 129 by the signals TERM and HUP.";

// Each is described where its arguments are.
#[derive(Subcommand)]
enum Verb {
    Init(init::Args),
    Quickstart(quickstart::Args),
    Record(record::Args),
    Play(play::Args),
    Demo(demo::Args),
    Doctor(doctor::Args),
    Teach(teach::Args),
    LearnSkills(learn_skills::Args),
    Imitate(imitate::Args),
    Train(train::Args),
    Diagnose(diagnose::Args),
    Study(study::Args),
    Config(config::Args),
    Eval(eval::Args),
    Test(test::Args),
    Replay(replay::Args),
    Report(report::Args),
    Review(review::Args),
    History(history::Args),
    Bisect(bisect::Args),
    Explore(explore::Args),
    Eyes(eyes::Args),
    Policy(policy::Args),
    Runs(runs::Args),
    Level(level::Args),
    Levels(levels::Args),
    Trace(trace::Args),
    View(view::Args),
    Skills(skills::Args),
    Watch(watch::Args),
    Bench(bench::Args),
    Serve(serve::Args),
    Work(work::Args),
    Bugs(bugs::Args),
    Completions(completions::Args),
}

/// Checks that a command line can be parsed, for tests of documentation. `args` begin with the name of the program.
/// Nothing is run, no game is asked for the names in them, and level files need not exist.
///
/// # Errors
///
/// The parser's message.
pub fn check_usage<Args>(args: Args) -> Result<(), String>
where
    Args: IntoIterator<Item: Into<OsString> + Clone>,
{
    match Cli::try_parse_from(args) {
        Ok(_) => Ok(()),
        // A request for help is no mistake.
        Err(error) if !error.use_stderr() || is_about_missing_files(&error) || is_about_device(&error) => Ok(()),
        Err(error) => Err(error.to_string()),
    }
}

/// Returns true if only another build has the device.
fn is_about_device(error: &clap::Error) -> bool {
    let device = std::error::Error::source(error).and_then(|source| source.downcast_ref::<UnknownDevice>());
    matches!(device, Some(UnknownDevice::NotBuilt { .. }))
}

fn is_about_missing_files(error: &clap::Error) -> bool {
    let split = std::error::Error::source(error).and_then(|source| source.downcast_ref::<SplitError>());
    matches!(split, Some(SplitError::Files(LevelFileError::NoFiles { .. })))
}

/// Runs the command line on the process's arguments, for these games. The first game is the default of verbs that name
/// no game.
///
/// Exit codes: 0 all is well, 1 findings, 2 the program failed, 3 wrong usage or configuration, 130 stopped by Ctrl-C,
/// 143 and 129 stopped by the signals TERM and HUP.
pub fn main(games: &[&dyn Game]) -> ExitCode {
    #[cfg(all(target_os = "linux", feature = "camera"))]
    log::silence_mesa();
    let cli = match read(games) {
        Ok(cli) => cli,
        Err(error) => {
            // A request for help is no mistake; anything else is a wrong usage, which is 3 here.
            let code = if error.use_stderr() { 3 } else { 0 };
            let words = in_plain_words(&error).or_else(|| with_own_mode(&error, games));
            let words = words.or_else(|| with_games(&error, games));
            let called: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
            let tip = expanded_pattern(&called).filter(|_| error.use_stderr());
            let words = tip.map(|tip| with_tip(words.as_deref(), &error, &tip)).or(words);
            match words {
                Some(words) => begin_report!("{words}"),
                None => {
                    if let Err(refused) = error.print()
                        && code == 0
                        && refused.kind() != std::io::ErrorKind::BrokenPipe
                    {
                        report!("error: cannot write to standard output: {refused}");
                        return ExitCode::from(2);
                    }
                }
            }
            return ExitCode::from(code);
        }
    };
    let repeats = log::init(cli.verbose, !matches!(cli.verb, Some(Verb::Bugs(_))));
    progress::start();
    let elsewhere = GamesPrintElsewhere::begin(&repeats);
    let games = match Games::new(games) {
        Ok(games) => games,
        Err(error) => {
            report!("error: {error}");
            return ExitCode::from(3);
        }
    };
    let verb = cli.verb.unwrap_or_else(|| Verb::Quickstart(quickstart::Args::default()));
    let ended = std::panic::catch_unwind(AssertUnwindSafe(|| run(verb, &games)));
    // What games have printed is counted then.
    drop(elsewhere);
    // Before an error, which is the last line.
    repeats.report();
    match ended {
        Ok(Ok(Outcome::Pass)) => ExitCode::SUCCESS,
        Ok(Ok(Outcome::Findings)) => ExitCode::from(1),
        Ok(Ok(Outcome::Stopped)) => ExitCode::from(interrupt::exit_code()),
        Ok(Err(CliError::BrokenPipe)) => ExitCode::SUCCESS,
        Ok(Err(error)) => {
            report!("error: {}", program::named(&error.to_string()));
            ExitCode::from(error.exit_code())
        }
        Err(_) => {
            report!("error: the program failed, which is a bug in it; please report the lines above");
            ExitCode::from(2)
        }
    }
}

/// Parses the arguments of the process.
fn read(games: &[&dyn Game]) -> Result<Cli, clap::Error> {
    let mut command = with_only_game(with_own_name(Cli::command()), games);
    let args: Vec<OsString> = std::env::args_os().collect();
    let args = match with_level_numbers(args.clone(), games, &command) {
        Ok(args) => args,
        Err(words) => return Err(error_of_verb(&mut command, &args, words)),
    };
    let matches = match command.try_get_matches_from_mut(&args) {
        Err(error) if is_help(&error) => {
            // Not before: to know which examples work, games are asked for a level, which takes them some work.
            let named = help::with_games(help::named(Cli::command(), program::name(), games), games);
            let helpful = with_only_game(with_own_name(named), games);
            helpful.try_get_matches_from(&args)?
        }
        matches => matches?,
    };
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

/// Returns an error with the usage of the verb that was called.
fn error_of_verb(command: &mut Command, args: &[OsString], error: String) -> clap::Error {
    // The usage of a verb begins with the name of the program only then.
    command.build();
    let words: Vec<String> = args.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let verbs: Vec<String> = CalledVerb::find(&words, command).verbs.into_iter().map(str::to_owned).collect();
    let mut called = command;
    for verb in &verbs {
        called = called.find_subcommand_mut(verb).expect("it was found in this command");
    }
    called.error(ErrorKind::InvalidValue, error)
}

fn is_help(error: &clap::Error) -> bool {
    matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand)
}

/// Returns the command line under the name of this program.
fn with_own_name(command: Command) -> Command {
    let command = with_width(with_negative_numbers(command).name(program::name()), std::io::stdout().is_terminal());
    if program::name() == program::DEFAULT_NAME {
        return command;
    }
    // The version is this crate's, since the game's is not known here.
    command.version(concat!("(playbot ", env!("CARGO_PKG_VERSION"), ")"))
}

/// Lets verbs that need the name of a game go without it in a program of one game.
fn with_only_game(command: Command, games: &[&dyn Game]) -> Command {
    let [only] = games else { return command };
    let name = only.name();
    command.mut_subcommands(|verb| {
        verb.mut_args(|arg| {
            let is_needed = arg.get_id() == "game" && arg.is_positional() && arg.is_required_set();
            if is_needed { arg.required(false).default_value(name) } else { arg }
        })
    })
}

/// Breaks lines of help between words, at the width of the terminal. Help in a file or a pipe is not broken, so it is the
/// same on every terminal.
fn with_width(command: Command, is_on_terminal: bool) -> Command {
    if is_on_terminal { command.max_term_width(WIDEST) } else { command.term_width(0) }
}

fn run(verb: Verb, games: &Games) -> Result<Outcome, CliError> {
    limit_by_environment().map_err(CliError::Usage)?;
    let threads = match &verb {
        Verb::Quickstart(args) => args.threads.count(),
        Verb::LearnSkills(args) => args.compute.threads(),
        Verb::Imitate(args) => args.compute.threads(),
        Verb::Teach(args) => args.compute.threads(),
        Verb::Train(args) => args.compute.threads(),
        Verb::Diagnose(args) => args.compute.threads(),
        Verb::Study(args) => args.compute.threads(),
        Verb::Eval(args) => args.compute.threads(),
        Verb::Test(args) => args.compute.threads(),
        Verb::Explore(args) => args.compute.threads(),
        Verb::Watch(args) => args.compute.threads(),
        Verb::Bench(args) => args.threads,
        Verb::Serve(args) => args.threads.count(),
        // There is a worker for each processor.
        Verb::Work(_) => 1,
        _ => usable_threads(default_threads()),
    };
    // Networks take no others, wherever they are computed.
    Workers::new(threads).bound(|| run_on_threads(verb, games))
}

fn run_on_threads(verb: Verb, games: &Games) -> Result<Outcome, CliError> {
    match verb {
        Verb::Init(args) => init::run(&args),
        Verb::Quickstart(args) => quickstart::run(args, games),
        Verb::Record(args) => record::run(args, games),
        Verb::Play(args) => play::run(args, games),
        Verb::Demo(args) => demo::run(args, games),
        Verb::Doctor(args) => doctor::run(args, games),
        Verb::LearnSkills(args) => learn_skills::run(args, games),
        Verb::Imitate(args) => imitate::run(args, games),
        Verb::Teach(args) => teach::run(args, games),
        Verb::Train(args) => train::run(args, games),
        Verb::Diagnose(args) => diagnose::run(args, games),
        Verb::Study(args) => study::run(args, games),
        Verb::Config(args) => config::run(args, games),
        Verb::Eval(args) => eval::run(args, games),
        Verb::Test(args) => test::run(&args, games),
        Verb::Replay(args) => replay::run(&args, games),
        Verb::Report(args) => report::run(&args, games),
        Verb::Review(args) => review::run(&args, games),
        Verb::History(args) => history::run(&args),
        Verb::Bisect(args) => bisect::run(&args),
        Verb::Explore(args) => explore::run(args, games),
        Verb::Eyes(args) => eyes::run(args, games),
        Verb::Policy(args) => policy::run(args, games),
        Verb::Runs(args) => runs::run(args, games),
        Verb::Level(args) => level::run(args, games),
        Verb::Levels(args) => levels::run(&args, games),
        Verb::Trace(args) => trace::run(args, games),
        Verb::View(args) => view::run(args, games),
        Verb::Skills(args) => skills::run(args, games),
        Verb::Watch(args) => watch::run(&args, games),
        Verb::Bench(args) => bench::run(args, games),
        Verb::Serve(args) => serve::run(args, games),
        Verb::Work(args) => work::run(&args, games),
        Verb::Bugs(args) => bugs::run(args, games),
        Verb::Completions(args) => completions::run(&args, with_own_name(Cli::command())),
    }
}

// Levels that are named as in their level editor, or by their number alone.

/// Options whose values are levels.
const OF_LEVELS: [&str; 4] = ["--level", "--levels", "--among", "--hold-out"];

/// Replaces the names of levels by their modes and numbers, so that each option takes them: `--levels Cave`,
/// `--levels default:Cave..Tower`, `--level Cave`, `--levels Cave,Tower`. Numbers alone get the mode where an option needs
/// one. A mode in front of a number moves to `--mode` where an option takes the number alone: `--level hard:7`. Names and
/// numbers stay as they are if only a file says which of several games is meant.
///
/// # Errors
///
/// The game has names for its levels, but no such one. Or the levels do not follow one another, and the option takes
/// one range. Or a mode in front of a number is not the game's, or is not that of `--mode`.
fn with_level_numbers(args: Vec<OsString>, games: &[&dyn Game], command: &Command) -> Result<Vec<OsString>, String> {
    let words: Vec<String> = args.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let called = CalledVerb::find(&words, command);
    let Some(game) = called.game(&words, games) else { return Ok(args) };
    let mode_options = called.names_of("mode");
    let of_option = |names: &[String]| {
        let mut places = (1..words.len()).flat_map(|place| names.iter().map(move |name| (name, place)));
        places.find_map(|(name, place)| Some((name.clone(), value_of(&words, name, place)?)))
    };
    let mode = of_option(&mode_options).map(|(_, mode)| mode);
    let of_levels = |(option, levels): (String, &str)| Some((option, levels.parse::<LevelSplit>().ok()?.mode));
    let named = of_option(&mode_options).map(|(option, mode)| (option, mode.to_owned()));
    let mut named = named.or_else(|| of_option(&called.names_of("levels")).and_then(of_levels));
    let mut numbered = Vec::new();
    let mut replaced = None;
    for (place, arg) in args.into_iter().enumerate() {
        if replaced == Some(place) {
            continue;
        }
        let found = OF_LEVELS.into_iter().find_map(|name| Some((name, value_of(&words, name, place)?)));
        let levels = found.and_then(|(name, value)| Some((name, called.levels_option(name)?, value)));
        let Some((name, option, value)) = levels else {
            numbered.push(arg);
            continue;
        };
        if let Some(files) = called.files_of_one_level(option, value) {
            numbered.extend(files);
            replaced = (!words[place].contains('=')).then_some(place + 1);
            continue;
        }
        let texts = NumberedLevels::of(game, mode, value, option)?;
        let is_changed = texts.is_some();
        let texts = texts.unwrap_or_else(|| vec![value.to_owned()]);
        let modes = texts.iter().map(|text| if option.takes_mode { Ok(None) } else { mode_and_number(game, text) });
        let modes = modes.collect::<Result<Vec<_>, _>>()?;
        if !is_changed && modes.iter().all(Option::is_none) {
            numbered.push(arg);
            continue;
        }
        for (text, of_mode) in texts.iter().zip(modes) {
            let (own, number) = of_mode.map_or((None, text.as_str()), |(own, number)| (Some(own), number));
            match (own, &named) {
                (Some(own), Some((option, known))) if own != known => {
                    return Err(format!(
                        "`{name} {text}` is of the mode {own}, and {option} names {known}: name one mode, such as `{name} {text}` \
                         alone"
                    ));
                }
                (Some(own), None) => {
                    numbered.push(OsString::from(format!("--mode={own}")));
                    named = Some((name.to_owned(), own.to_owned()));
                }
                (Some(_), Some(_)) | (None, _) => {}
            }
            numbered.push(OsString::from(format!("{name}={number}")));
        }
        replaced = (!words[place].contains('=')).then_some(place + 1);
    }
    Ok(numbered)
}

/// Returns the value of an option if it stands at this place: in the same word, or in the next one.
fn value_of<'a>(words: &'a [String], option: &str, place: usize) -> Option<&'a str> {
    let rest = words.get(place)?.strip_prefix(option)?;
    if rest.is_empty() { words.get(place + 1).map(String::as_str) } else { rest.strip_prefix('=') }
}

/// The verb of a command line.
struct CalledVerb<'a> {
    /// The verb, and those below it, such as `demo` and `filter`.
    verbs: Vec<&'a str>,
    command: &'a Command,
    /// The first word behind the verb that is neither an option nor the value of one.
    positional: Option<&'a str>,
}

impl<'a> CalledVerb<'a> {
    fn find(words: &'a [String], command: &'a Command) -> Self {
        let mut called = Self { verbs: Vec::new(), command, positional: None };
        let mut words = words.iter().skip(1);
        while let Some(word) = words.next() {
            if let Some(option) = word.strip_prefix("--") {
                if called.option(option).is_some_and(|arg| arg.get_action().takes_values()) {
                    words.next();
                }
            } else if word.starts_with('-') && word.len() > 1 {
                // The options with one letter have no values.
            } else if let Some(verb) = called.command.find_subcommand(word) {
                called.verbs.push(word);
                called.command = verb;
            } else {
                called.positional = Some(word);
                break;
            }
        }
        called
    }

    fn option(&self, name: &str) -> Option<&'a Arg> {
        let is_it = |arg: &&Arg| arg.get_long_and_visible_aliases().is_some_and(|names| names.contains(&name));
        self.command.get_arguments().find(is_it)
    }

    /// Returns all names of an option, as they are written; none if the verb has no such option.
    fn names_of(&self, option: &str) -> Vec<String> {
        let names = self.option(option).and_then(Arg::get_long_and_visible_aliases).unwrap_or_default();
        names.into_iter().map(|name| format!("--{name}")).collect()
    }

    /// Returns the game: the one that is named behind the verb, or the program's first. `None` if only a file says which
    /// of several games is meant.
    fn game<'g>(&self, words: &[String], games: &[&'g dyn Game]) -> Option<&'g dyn Game> {
        let has = |option: &str| (1..words.len()).any(|place| value_of(words, option, place).is_some());
        let is_of_file = match self.verbs.first() {
            Some(&"demo") => true,
            Some(&"eval") => ["--experiment", "--run", "--policy"].into_iter().any(has),
            _ => has("--experiment"),
        };
        let is_named = |game: &&&dyn Game, word| game.name() == word || game.aliases().contains(&word);
        let named = self.positional.and_then(|word| games.iter().find(|game| is_named(game, word)));
        match (named, games) {
            (Some(game), _) | (None, [game]) => Some(*game),
            (None, [game, ..]) if !is_of_file => Some(*game),
            _ => None,
        }
    }

    /// Returns the options that name level files, in place of an option that takes the number of a level; `None` for
    /// other values, and for options that take level files themselves.
    fn files_of_one_level(&self, option: LevelsOption, value: &str) -> Option<Vec<OsString>> {
        if option.takes_mode || !is_level_files(value) {
            return None;
        }
        let options = match self.option("levels") {
            Some(_) => vec![format!("--levels={value}")],
            None => vec![format!("--mode={value}"), "--level=0".to_owned()],
        };
        Some(options.into_iter().map(OsString::from).collect())
    }

    /// Returns what an option takes; `None` if the verb has no such option, or one that names a game before the levels.
    fn levels_option(&self, name: &str) -> Option<LevelsOption<'a>> {
        let arg = self.option(name.trim_start_matches('-')).filter(|_| self.verbs.first() != Some(&"bugs"))?;
        // `--level` is the number of a level beside `--mode`, or else an alias of `--levels`.
        let takes_mode = arg.get_id() != "level" || self.verbs.first() == Some(&"explore");
        let is_repeatable = matches!(arg.get_action(), ArgAction::Append);
        Some(LevelsOption { verb: self.verbs.last().copied()?, takes_mode, is_repeatable })
    }
}

/// An option whose value are levels.
#[derive(Clone, Copy)]
struct LevelsOption<'a> {
    verb: &'a str,
    /// True for a range of levels with their mode, false for the number of a level.
    takes_mode: bool,
    is_repeatable: bool,
}

/// Levels by their numbers, which follow one another.
struct NumberedLevels {
    mode: String,
    /// True if the mode was named in front of the level.
    is_mode_named: bool,
    first: u64,
    last: u64,
}

impl NumberedLevels {
    /// Finds the levels of a value, and returns them as an option takes them. `mode` is that of levels without one. Returns
    /// `None` for a value that needs no change, and for one that names no levels of the game, which has no names for them.
    fn of(
        game: &dyn Game,
        mode: Option<&str>,
        value: &str,
        option: LevelsOption,
    ) -> Result<Option<Vec<String>>, String> {
        let is_range = |text: &str| text.parse::<LevelSplit>().is_ok();
        if value.starts_with('-') || is_level_files(value) || is_range(value) {
            return Ok(None);
        }
        if let Err(error @ SplitError::MisspeltFiles { .. }) = value.parse::<LevelSplit>() {
            return Err(error.to_string());
        }
        let default = mode.unwrap_or_else(|| default_mode(game));
        if is_range(&format!("any:{value}")) {
            return Ok(option.takes_mode.then(|| vec![format!("{default}:{value}")]));
        }
        let mut levels: Vec<Self> = Vec::new();
        // A name may have a comma in it.
        let whole = Self::one(game, (default, false), value);
        let parts = if whole.is_some() { vec![value] } else { value.split(',').map(str::trim).collect() };
        for part in parts {
            let before = levels.last().filter(|before| before.is_mode_named);
            let inherited = before.map_or((default, false), |before| (before.mode.as_str(), true));
            let Some(level) = Self::one(game, inherited, part) else {
                return unknown_level(game, inherited.0, part, option).map_or(Ok(None), Err);
            };
            match levels.last_mut().filter(|before| option.takes_mode && before.is_followed_by(&level)) {
                Some(before) => before.last = level.last,
                None => levels.push(level),
            }
        }
        if levels.len() > 1 && !option.is_repeatable {
            let LevelsOption { verb, takes_mode, .. } = option;
            let (found, wanted) = match takes_mode {
                true => ("ranges of levels", "levels that follow one another"),
                false => ("levels", "one level"),
            };
            let (count, first) = (levels.len(), levels[0].in_words(takes_mode));
            return Err(format!("`{value}` names {count} {found}: `{verb}` takes {wanted}, such as {first}"));
        }
        Ok(Some(levels.iter().map(|levels| levels.in_words(option.takes_mode)).collect()))
    }

    /// Finds a level, or a range of levels, by names or numbers. A mode may stand in front.
    fn one(game: &dyn Game, (mode, is_mode_named): (&str, bool), text: &str) -> Option<Self> {
        let own = own_mode(game, text);
        let (mode, name) = own.unwrap_or((mode, text));
        let names = game.tools().levels.level_names(mode);
        let number = |name: &str| -> Option<u64> {
            let by_name = || names.iter().position(|known| known == name).map(|number| number as u64);
            name.parse().ok().or_else(by_name)
        };
        let range = || name.split_once("..").and_then(|(first, last)| Some((number(first)?, number(last)?)));
        let (first, last) = number(name).map(|level| (level, level)).or_else(range)?;
        Some(Self { mode: mode.to_owned(), is_mode_named: is_mode_named || own.is_some(), first, last })
    }

    fn is_followed_by(&self, next: &Self) -> bool {
        self.mode == next.mode && self.first <= self.last && self.last.checked_add(1) == Some(next.first)
    }

    /// Returns them as an option takes them. One that takes no mode gets it only if it was named, and it moves to `--mode`.
    fn in_words(&self, takes_mode: bool) -> String {
        let Self { mode, is_mode_named, first, last } = self;
        let numbers = if first == last { first.to_string() } else { format!("{first}..{last}") };
        if takes_mode || *is_mode_named { format!("{mode}:{numbers}") } else { numbers }
    }
}

/// Returns the mode in front of a level, and the level, if it is a mode of the game. A name may have a colon in it.
fn own_mode<'a>(game: &dyn Game, text: &'a str) -> Option<(&'a str, &'a str)> {
    text.split_once(':').filter(|(mode, _)| game.check_mode(mode).is_ok())
}

/// Returns the mode in front of the number of a level, and the number; `None` if no mode is there.
///
/// # Errors
///
/// The game does not have the mode.
fn mode_and_number<'a>(game: &dyn Game, text: &'a str) -> Result<Option<(&'a str, &'a str)>, String> {
    let is_number = |(mode, number): &(&str, &str)| !mode.is_empty() && number.parse::<u64>().is_ok();
    let Some((mode, number)) = text.rsplit_once(':').filter(is_number).filter(|_| !is_level_files(text)) else {
        return Ok(None);
    };
    game.check_mode(mode).map_err(|error| error.to_string())?;
    Ok(Some((mode, number)))
}

/// Names that are listed for a name that does not exist.
const LISTED: usize = 3;

/// Returns the error of a name that no level has; `None` for a game whose levels have no names.
fn unknown_level(game: &dyn Game, mode: &str, text: &str, option: LevelsOption) -> Option<String> {
    let (mode, name) = own_mode(game, text).unwrap_or((mode, text));
    let names = game.tools().levels.level_names(mode);
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    let near = question(nearest(name, &known));
    let listed = match known.as_slice() {
        [] => return None,
        [only] => format!("its level is {only}"),
        _ if known.len() > LISTED + 1 => {
            format!("its levels are {} and {} more", known[..LISTED].join(", "), known.len() - LISTED)
        }
        [others @ .., last] => format!("its levels are {} and {last}", others.join(", ")),
    };
    let number = if option.takes_mode { format!("{mode}:0") } else { "0".to_owned() };
    Some(format!("`{}` has no level `{name}`{near}: {listed}, which have numbers too, such as {number}", game.name()))
}

// Plain wording of errors of the command line's parser.

/// Lets options take numbers below 0, so that the error is about the number, and not about an unknown option.
pub(crate) fn with_negative_numbers(command: Command) -> Command {
    command
        .mut_args(|arg| {
            let takes_number = !arg.is_positional() && arg.get_action().takes_values();
            if takes_number { arg.allow_negative_numbers(true) } else { arg }
        })
        .mut_subcommands(with_negative_numbers)
}

/// Returns the whole text of an error about a number in plain words; `None` for other errors.
pub(crate) fn in_plain_words(error: &clap::Error) -> Option<String> {
    let source = error.source()?;
    let plain = number_wanted(source)?;
    Some(error.render().to_string().replacen(&format!(": {source}"), &format!(": {plain}"), 1))
}

/// Returns the whole text of an error about levels with a mode of the game in its example; `None` for other errors.
fn with_own_mode(error: &clap::Error, games: &[&dyn Game]) -> Option<String> {
    error.source()?;
    let words: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    let command = Cli::command();
    let game = CalledVerb::find(&words, &command).game(&words, games)?;
    own_example(&error.render().to_string(), game)
}

/// Returns the whole text of an error about a missing name of a game, with the games; `None` for other errors.
fn with_games(error: &clap::Error, games: &[&dyn Game]) -> Option<String> {
    const MISSING: &str = "\n  <GAME>\n";
    let text = error.render().to_string();
    let is_missing = error.kind() == ErrorKind::MissingRequiredArgument && text.contains(MISSING);
    let names: Vec<&str> = games.iter().map(|game| game.name()).collect();
    is_missing.then(|| text.replacen(MISSING, &format!("\n  <GAME>, one of {}\n", names.join(", ")), 1))
}

/// Returns the advice to quote a pattern, if the shell has made several files of one: further files stand behind a
/// value of levels.
fn expanded_pattern(words: &[String]) -> Option<String> {
    let is_file = |word: &String| !word.starts_with('-') && (is_level_files(word) || Path::new(word).is_file());
    let place = (1..words.len()).find(|place| {
        let is_value = OF_LEVELS.iter().any(|name| words[place - 1] == *name);
        is_value && is_file(&words[*place]) && words.get(place + 1).is_some_and(is_file)
    })?;
    let files = words[place..].iter().take_while(|word| is_file(word));
    let paths: Vec<&Path> = files.map(|word| Path::new(level_file_pattern(word).unwrap_or(word))).collect();
    let common = |part: fn(&Path) -> Option<&OsStr>| {
        let first = part(paths[0])?.to_str()?;
        paths.iter().all(|path| part(path).is_some_and(|own| own == first)).then(|| first.to_owned())
    };
    let folder = common(|path| path.parent().map(Path::as_os_str)).unwrap_or_else(|| "levels".to_owned());
    let folder = if folder.is_empty() { String::new() } else { format!("{folder}/") };
    let ending = common(Path::extension).map_or_else(String::new, |ending| format!(".{ending}"));
    Some(format!(
        "{} files stand behind {}, as if the shell had expanded a pattern: quote it, such as {} \"files:{folder}*{ending}\"",
        paths.len(),
        words[place - 1],
        words[place - 1]
    ))
}

/// Returns the text of an error with a tip, above the last line, which names the help.
fn with_tip(words: Option<&str>, error: &clap::Error, tip: &str) -> String {
    const LAST: &str = "\nFor more information";
    let text = words.map_or_else(|| error.render().to_string(), str::to_owned);
    let tip = format!("\n  tip: {tip}\n");
    match text.rfind(LAST) {
        Some(at) => format!("{}{tip}{}", &text[..at], &text[at..]),
        None => format!("{text}{tip}"),
    }
}

/// Replaces the mode of examples that are written for any game.
fn own_example(text: &str, game: &dyn Game) -> Option<String> {
    let (range, level) = (first_levels(game, 9), first_levels(game, 7));
    let mut own = text.replace("such as MODE:7", &format!("such as {}:{}", level.mode, level.last));
    if !game.modes().contains(&"hard") {
        own = own.replace("such as hard:64..127", &format!("such as {range}"));
    }
    (own != text).then_some(own)
}

/// Describes the wanted number.
fn number_wanted(error: &(dyn Error + 'static)) -> Option<String> {
    if let Some(error) = error.downcast_ref::<ParseIntError>() {
        let words = match error.kind() {
            IntErrorKind::PosOverflow => "the number is too large",
            _ => "it must be a whole number, 0 or more",
        };
        return Some(words.to_owned());
    }
    if error.downcast_ref::<ParseFloatError>().is_some() {
        return Some("it must be a number, such as 0.5".to_owned());
    }
    let words = error.to_string();
    let (_, bounds) = words.split_once(" is not in ")?;
    let (first, last) = bounds.split_once("..=")?;
    Some(format!("it must be a whole number from {first} to {last}"))
}

#[cfg(test)]
mod tests {
    use bevy::{app::App, math::Vec2};
    use clap::value_parser;
    use playbot_harness::foreign::{EditorLevel, ForeignGame};

    use super::*;

    fn said(option: &str, value: &str) -> String {
        let inner = Command::new("inner")
            .arg(Arg::new("seed").long("seed").value_parser(value_parser!(u64)))
            .arg(Arg::new("level").long("level").value_parser(value_parser!(u64)))
            .arg(Arg::new("noise").long("noise").value_parser(value_parser!(f64)))
            .arg(Arg::new("scale").long("scale").value_parser(value_parser!(u32).range(1..=32)));
        let command = with_negative_numbers(Command::new("outer").subcommand(inner));
        match command.try_get_matches_from(["outer", "inner", option, value]) {
            Ok(_) => "taken".to_owned(),
            Err(error) => in_plain_words(&error).unwrap_or_else(|| format!("in other words: {error}")),
        }
    }

    #[test]
    fn help_breaks_between_words_on_terminals_alone() {
        let about = ["every word of this long text stays whole"; 4].join(", and ");
        let help = |command: Command| command.about(about.clone()).render_help().to_string();
        let narrow = help(Command::new("outer").term_width(40));
        let first: Vec<_> = narrow.lines().take_while(|line| !line.is_empty()).collect();
        assert!(first.len() > 4 && first.iter().all(|line| line.len() <= 40), "{narrow}");
        assert_eq!(first.join(" ").split_whitespace().collect::<Vec<_>>().join(" "), about);
        assert!(help(with_width(Command::new("outer"), false)).starts_with(&format!("{about}\n")));
    }

    /// A game whose levels are drawn in an editor, and one whose levels have numbers only.
    fn rooms() -> [ForeignGame; 2] {
        let level = |name: &str| EditorLevel::of_rows(name, vec!["S.G".to_owned()], Vec2::ONE);
        let game = |name| ForeignGame::new(name, 1, |_: &mut App| {}).modes(&["easy", "hard"]);
        [game("rooms").editor_levels(Ok(vec![level("Hall"), level("Cave"), level("Tower")])), game("plain")]
    }

    fn numbered(args: &str) -> Result<String, String> {
        let [rooms, plain] = rooms();
        let args = format!("playbot {args}").split(' ').map(OsString::from).collect();
        let words = with_level_numbers(args, &[&rooms, &plain], &Cli::command())?;
        Ok(words.iter().skip(1).map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn names_of_levels_become_their_numbers() {
        for (args, wanted) in [
            ("level rooms --level Cave", "level rooms --level=1"),
            ("level rooms --mode hard --level=Tower --json", "level rooms --mode hard --level=2 --json"),
            ("level rooms --level hard:Cave", "level rooms --mode=hard --level=1"),
            ("test rooms --levels Cave --out a", "test rooms --levels=easy:1 --out a"),
            ("test --levels hard:Hall..Cave", "test --levels=hard:0..1"),
            ("record rooms --levels=hard:Tower --hold-out Hall", "record rooms --levels=hard:2 --hold-out=easy:0"),
            ("explore rooms --level Cave", "explore rooms --level=easy:1"),
            // Values of options name no game.
            ("test --out plain --levels Cave", "test --out plain --levels=easy:1"),
            ("test --out plain rooms --levels Cave", "test --out plain rooms --levels=easy:1"),
            ("eval rooms --run runs/a --levels Cave", "eval rooms --run runs/a --levels=easy:1"),
            ("record rooms --out a.demo --hold-out Cave", "record rooms --out a.demo --hold-out=easy:1"),
            // Each verb takes `--level`.
            ("test rooms --level Cave", "test rooms --level=easy:1"),
            ("eval rooms --level Cave --bot random", "eval rooms --level=easy:1 --bot random"),
            ("record rooms --level Cave", "record rooms --level=easy:1"),
            ("levels rooms --level Cave", "levels rooms --level=easy:1"),
            // Lists, of levels that follow one another unless the option is repeatable.
            ("test rooms --levels Hall,Cave,Tower", "test rooms --levels=easy:0..2"),
            ("test rooms --levels hard:Hall,Cave", "test rooms --levels=hard:0..1"),
            ("test rooms --levels Hall,1", "test rooms --levels=easy:0..1"),
            ("eval rooms --levels Hall,Tower", "eval rooms --levels=easy:0 --levels=easy:2"),
            ("eval plain --levels 3,5..6,7", "eval plain --levels=easy:3 --levels=easy:5..7"),
            ("doctor rooms --level Hall,Cave", "doctor rooms --level=0 --level=1"),
        ] {
            assert_eq!(numbered(args).as_deref(), Ok(wanted));
        }
        for same in [
            "level rooms --level 7",
            "test rooms --levels easy:0..9 --out Cave",
            "level rooms --level 0..9",
            "test rooms --level",
            "bugs make rooms --levels rooms=easy:0..9",
            "test rooms --levels files:Cave",
            "test plain --levels Cave",
            "level rooms --level",
            "level rooms --level --json",
            // A file says which game it is.
            "eval --experiment a.ron --levels Cave",
            "eval --run=runs/a --levels Cave",
            "eval --policy a.policy --levels Cave",
            "demo filter a.demo --levels Cave --out b.demo",
            "test --out rooms plain --levels Cave",
        ] {
            assert_eq!(numbered(same).as_deref(), Ok(same), "there is nothing to replace");
        }
    }

    #[test]
    fn numbers_alone_get_the_mode_where_one_is_needed() {
        for (args, wanted) in [
            ("explore rooms --level 1", "explore rooms --level=easy:1"),
            ("explore plain --level 7", "explore plain --level=easy:7"),
            ("test plain --levels 0..9 --out a", "test plain --levels=easy:0..9 --out a"),
            ("test plain --level=3", "test plain --level=easy:3"),
            ("levels plain --levels 0..9 --among 10..19", "levels plain --levels=easy:0..9 --among=easy:10..19"),
            ("play rooms --mode hard --levels 0..9", "play rooms --mode hard --levels=hard:0..9"),
        ] {
            assert_eq!(numbered(args).as_deref(), Ok(wanted));
        }
    }

    #[test]
    fn a_mode_in_front_of_a_number_is_taken_wherever_a_level_is_named() {
        for (args, wanted) in [
            ("level plain --level hard:7", "level plain --mode=hard --level=7"),
            ("trace plain --level=hard:7 --actions 0", "trace plain --mode=hard --level=7 --actions 0"),
            ("view rooms --level hard:Cave", "view rooms --mode=hard --level=1"),
            ("play plain --level hard:7 --name me", "play plain --mode=hard --level=7 --name me"),
            ("doctor plain --level hard:3 --level hard:4", "doctor plain --mode=hard --level=3 --level=4"),
            ("doctor rooms --level hard:Hall,Cave", "doctor rooms --mode=hard --level=0 --level=1"),
            // The mode is named already.
            ("level plain --mode hard --level hard:7", "level plain --mode hard --level=7"),
            ("trace plain --level hard:7 --map hard", "trace plain --level=7 --map hard"),
            ("view plain --levels hard:0..9 --level hard:7", "view plain --levels hard:0..9 --level=7"),
            // These take the mode themselves.
            ("explore plain --level hard:7", "explore plain --level hard:7"),
            ("test plain --level hard:7", "test plain --level hard:7"),
        ] {
            assert_eq!(numbered(args).as_deref(), Ok(wanted));
        }
        for (args, words) in [
            ("level plain --mode easy --level hard:7", "`--level hard:7` is of the mode hard, and --mode names easy: "),
            ("view plain --levels easy:0..9 --level hard:7", "and --levels names easy: "),
            ("doctor plain --level easy:0 --level hard:7", "and --level names easy: "),
            ("trace plain --level hrad:7", "did you mean `hard`?"),
        ] {
            let error = numbered(args).expect_err(args);
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn level_files_are_taken_wherever_a_single_level_is_named() {
        for (args, wanted) in [
            ("level rooms --level files:a.json", "level rooms --levels=files:a.json"),
            ("trace plain --level=files:a/*.json:3 --actions 0", "trace plain --levels=files:a/*.json:3 --actions 0"),
            ("doctor plain --level files:a.json", "doctor plain --mode=files:a.json --level=0"),
            ("explore plain --level files:a.json", "explore plain --level files:a.json"),
        ] {
            assert_eq!(numbered(args).as_deref(), Ok(wanted));
        }
        for args in ["level plain --level file:a.json", "test rooms --levels file:a.json"] {
            let words = numbered(args).expect_err(args);
            assert!(words.ends_with("did you mean `files:a.json`?"), "{words}");
        }
    }

    #[test]
    fn files_of_a_pattern_that_the_shell_has_expanded_are_followed_by_advice() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, "{}").expect("writable");
            path.to_str().expect("text").to_owned()
        };
        let (a, b, other) = (file("a.json"), file("b.json"), file("c.txt"));
        let tip = |words: &[&str]| expanded_pattern(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>());
        let quoted = format!("--levels \"files:{}/*.json\"", folder.path().display());
        let words = tip(&["playbot", "test", "rooms", "--levels", &a, &b, "--out", "o"]).expect("two files");
        assert!(words.starts_with("2 files stand behind --levels") && words.ends_with(&quoted), "{words}");
        let words = tip(&["playbot", "watch", "--level", &a, &b, &other]).expect("three files");
        assert!(words.ends_with("/*\""), "{words}");
        let words = tip(&["playbot", "watch", "--levels", "files:a.json", "files:b.json"]).expect("two patterns");
        assert!(words.ends_with("\"files:*.json\""), "{words}");
        for words in [&["playbot", "test", "--levels", &a][..], &["playbot", "test", "--levels", &a, "--out", &b]] {
            assert_eq!(tip(words), None);
        }
        let error = Cli::command().try_get_matches_from(["playbot", "level", "a", "b"]).expect_err("one too many");
        let text = with_tip(None, &error, "quote it");
        assert!(text.contains("\n  tip: quote it\n\nFor more information"), "{text}");
    }

    #[test]
    fn levels_that_do_not_follow_one_another_need_an_option_that_is_repeatable() {
        assert_eq!(
            numbered("test rooms --levels Hall,Tower").expect_err("two ranges"),
            "`Hall,Tower` names 2 ranges of levels: `test` takes levels that follow one another, such as easy:0"
        );
        assert_eq!(
            numbered("level rooms --level Hall,Cave").expect_err("two levels"),
            "`Hall,Cave` names 2 levels: `level` takes one level, such as 0"
        );
    }

    #[test]
    fn an_error_about_levels_has_the_usage_of_its_verb() {
        let usage = |args: &str| {
            let args: Vec<OsString> = format!("playbot {args}").split(' ').map(OsString::from).collect();
            error_of_verb(&mut with_own_name(Cli::command()), &args, "no such level".to_owned()).to_string()
        };
        let text = usage("level rooms --level Attic");
        assert!(text.starts_with("error: no such level\n") && text.contains(" level [OPTIONS] <GAME>"), "{text}");
        let text = usage("demo filter a.demo --levels Attic");
        assert!(text.contains(" demo filter [OPTIONS]"), "{text}");
    }

    #[test]
    fn the_error_of_a_missing_game_lists_those_of_the_program() {
        let [rooms, plain] = rooms();
        let error = |args: &[&str]| Cli::command().try_get_matches_from(args).expect_err("no game is named");
        let words = with_games(&error(&["playbot", "level"]), &[&rooms, &plain]).expect("a game is missing");
        assert!(words.contains("\n  <GAME>, one of rooms, plain\n"), "{words}");
        assert_eq!(with_games(&error(&["playbot", "trace", "rooms"]), &[&rooms, &plain]), None, "actions are missing");
    }

    #[test]
    fn examples_in_errors_have_a_mode_of_the_game() {
        let game = ForeignGame::new("plain", 1, |_: &mut App| {}).modes(&["calm"]);
        let own = |text: &str, game: &ForeignGame| own_example(text, game);
        let range = "write mode:first..last, both ends included, such as hard:64..127, or";
        let wanted = "write mode:first..last, both ends included, such as calm:0..9, or";
        assert_eq!(own(range, &game).as_deref(), Some(wanted));
        assert_eq!(own("such as MODE:7", &game).as_deref(), Some("such as calm:7"));
        let few = ForeignGame::new("plain", 1, |_: &mut App| {}).levels(3);
        assert_eq!(own("such as MODE:7", &few).as_deref(), Some("such as default:2"));
        assert_eq!(own(range, &rooms()[0]), None, "it has a mode `hard`");
    }

    #[test]
    fn a_program_of_one_game_knows_its_levels_beside_any_file() {
        let [rooms, _] = rooms();
        let args = ["playbot", "demo", "filter", "a.demo", "--levels", "Cave"].map(OsString::from).to_vec();
        let numbered = with_level_numbers(args, &[&rooms], &Cli::command()).expect("a level");
        assert_eq!(numbered.last(), Some(&OsString::from("--levels=easy:1")));
    }

    #[test]
    fn an_unknown_name_of_a_level_is_reported_with_the_nearest() {
        let words = numbered("test rooms --levels easy:Cvae").expect_err("no such level");
        assert_eq!(
            words,
            "`rooms` has no level `Cvae` (did you mean `Cave`?): its levels are Hall, Cave and Tower, which have numbers too, \
             such as easy:0"
        );
        let words = numbered("level rooms --level Attic").expect_err("no such level");
        assert!(
            words.ends_with("`Attic`: its levels are Hall, Cave and Tower, which have numbers too, such as 0"),
            "{words}"
        );
        assert!(numbered("test rooms --levels Hall,Attic").is_err_and(|words| words.contains("no level `Attic`: ")));
        let level = |number: u32| EditorLevel::of_rows(format!("Room_{number}"), vec!["S.G".to_owned()], Vec2::ONE);
        let many = |count: u32| {
            let levels = (0..count).map(level).collect();
            let game = ForeignGame::new("rooms", 1, |_: &mut App| {}).editor_levels(Ok(levels));
            let args = ["playbot", "level", "rooms", "--level", "Attic"].map(OsString::from).to_vec();
            with_level_numbers(args, &[&game], &Cli::command()).expect_err("no such level")
        };
        assert!(many(1).contains("its level is Room_0, "), "{}", many(1));
        assert!(many(4).contains("Room_0, Room_1, Room_2 and Room_3, "), "{}", many(4));
        assert!(many(240).contains("Room_0, Room_1, Room_2 and 237 more, "), "{}", many(240));
    }

    #[test]
    fn numbers_that_cannot_be_read_are_refused_in_plain_words() {
        for (option, value, words) in [
            ("--seed", "x", "error: invalid value 'x' for '--seed <seed>': it must be a whole number, 0 or more"),
            ("--seed", "-1", "it must be a whole number, 0 or more"),
            ("--seed", "18446744073709551616", "the number is too large"),
            ("--seed", "hard:7", "it must be a whole number, 0 or more\n"),
            ("--noise", "abc", "it must be a number, such as 0.5"),
            ("--scale", "0", "it must be a whole number from 1 to 32"),
        ] {
            let text = said(option, value);
            assert!(text.contains(words) && text.ends_with('\n'), "{text}");
        }
        assert_eq!(said("--noise", "-1"), "taken", "its reader reports what is wrong with it");
        assert!(said("--nose", "1").starts_with("in other words: "));
    }
}
