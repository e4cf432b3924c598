//! The command line's verbs and their dispatch. Help texts are in `help`.

mod help;

use crate::{
    arguments::default_mode,
    error::{CliError, Outcome},
    output::{GamesPrintElsewhere, log, program},
    progress,
    progress::interrupt,
    verbs::{
        bench, bugs, completions, config, demo, doctor, eval, explore, eyes, init, learn_skills, level, levels, play,
        policy, quickstart, record, replay, report, runs, study, test, trace, train, view,
    },
};
use bevy_playbot::unknown_name::nearest;
use clap::{
    Arg, Command, CommandFactory, FromArgMatches, Parser, Subcommand,
    error::{ContextKind, ContextValue, ErrorKind},
};
use playbot_harness::{
    game::Game,
    games::Games,
    level_files::{LevelFileError, is_level_files},
    split::{LevelSplit, SplitError},
};
use playbot_learner::UnknownDevice;
use std::{
    error::Error,
    ffi::OsString,
    io::IsTerminal,
    num::{IntErrorKind, ParseFloatError, ParseIntError},
    panic::AssertUnwindSafe,
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
  playbot replay runs/test/findings/NAME.finding --apng failure.png   what was found
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
    LearnSkills(learn_skills::Args),
    Train(train::Args),
    Study(study::Args),
    Config(config::Args),
    Eval(eval::Args),
    Test(test::Args),
    Replay(replay::Args),
    Report(report::Args),
    Explore(explore::Args),
    Eyes(eyes::Args),
    Policy(policy::Args),
    Runs(runs::Args),
    Level(level::Args),
    Levels(levels::Args),
    Trace(trace::Args),
    View(view::Args),
    Bench(bench::Args),
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
            match in_plain_words(&error) {
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
    let _elsewhere = GamesPrintElsewhere::begin();
    let games = match Games::new(games) {
        Ok(games) => games,
        Err(error) => {
            report!("error: {error}");
            return ExitCode::from(3);
        }
    };
    let verb = cli.verb.unwrap_or_else(|| Verb::Quickstart(quickstart::Args::default()));
    let ended = std::panic::catch_unwind(AssertUnwindSafe(|| run(verb, &games)));
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
    let args = with_level_numbers(std::env::args_os().collect(), games, &command);
    let args = args.map_err(|words| command.error(ErrorKind::InvalidValue, words))?;
    let matches = match command.try_get_matches_from_mut(&args) {
        Err(error) if is_help(&error) => {
            // Not before: to know which examples work, games are asked for a level, which takes them some work.
            let helpful = with_only_game(with_own_name(help::named(Cli::command(), program::name(), games)), games);
            helpful.try_get_matches_from(&args)?
        }
        matches => matches?,
    };
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
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
    match verb {
        Verb::Init(args) => init::run(&args),
        Verb::Quickstart(args) => quickstart::run(args, games),
        Verb::Record(args) => record::run(args, games),
        Verb::Play(args) => play::run(args, games),
        Verb::Demo(args) => demo::run(args, games),
        Verb::Doctor(args) => doctor::run(args, games),
        Verb::LearnSkills(args) => learn_skills::run(args, games),
        Verb::Train(args) => train::run(args, games),
        Verb::Study(args) => study::run(args, games),
        Verb::Config(args) => config::run(args, games),
        Verb::Eval(args) => eval::run(args, games),
        Verb::Test(args) => test::run(&args, games),
        Verb::Replay(args) => replay::run(&args, games),
        Verb::Report(args) => report::run(&args, games),
        Verb::Explore(args) => explore::run(args, games),
        Verb::Eyes(args) => eyes::run(args, games),
        Verb::Policy(args) => policy::run(args, games),
        Verb::Runs(args) => runs::run(args, games),
        Verb::Level(args) => level::run(args, games),
        Verb::Levels(args) => levels::run(&args, games),
        Verb::Trace(args) => trace::run(args, games),
        Verb::View(args) => view::run(args, games),
        Verb::Bench(args) => bench::run(args, games),
        Verb::Bugs(args) => bugs::run(args, games),
        Verb::Completions(args) => completions::run(&args, with_own_name(Cli::command())),
    }
}

// Levels that are named as in their level editor.

/// Options whose values are levels.
const OF_LEVELS: [&str; 4] = ["--level", "--levels", "--among", "--hold-out"];

/// Verbs whose option `--level` takes a mode in front of the number.
const WITH_MODE: [&str; 2] = ["explore", "demo"];

/// Replaces the names of levels by their modes and numbers, so that each option takes them: `--levels Cave`,
/// `--levels default:Cave..Tower`, `--level Cave`. The game is the one that is named behind the verb, or the program's
/// first. Names stay as they are if only a file says which of several games is meant.
///
/// # Errors
///
/// The game has names for its levels, but no such one.
fn with_level_numbers(
    mut args: Vec<OsString>,
    games: &[&dyn Game],
    command: &Command,
) -> Result<Vec<OsString>, String> {
    let words: Vec<String> = args.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let value_of = |option: &str, place: usize| -> Option<&str> {
        let rest = words[place].strip_prefix(option)?;
        if rest.is_empty() { words.get(place + 1).map(String::as_str) } else { rest.strip_prefix('=') }
    };
    let verb = words.iter().skip(1).map(String::as_str).find(|word| !word.starts_with('-'));
    let has = |option: &str| (1..words.len()).any(|place| value_of(option, place).is_some());
    let is_of_file = match verb {
        Some("demo") => true,
        Some("eval") => ["--experiment", "--run", "--policy"].into_iter().any(has),
        _ => has("--experiment"),
    };
    let first = first_positional(&words, command);
    let named = first.and_then(|word| games.iter().find(|game| game.name() == word || game.aliases().contains(&word)));
    let game = match (named, games) {
        (Some(game), _) | (None, [game]) => *game,
        (None, [game, ..]) if !is_of_file => *game,
        _ => return Ok(args),
    };
    let mode = (1..words.len()).find_map(|place| value_of("--mode", place));
    let takes_mode = verb.is_some_and(|verb| WITH_MODE.contains(&verb));
    for place in 1..words.len() {
        let found = OF_LEVELS.into_iter().find_map(|option| Some((option, value_of(option, place)?)));
        let Some((option, value)) = found else { continue };
        let Some(level) = NumberedLevels::of(game, mode, value)? else { continue };
        let text = level.in_words(option != "--level" || takes_mode);
        if words[place].contains('=') {
            args[place] = format!("{option}={text}").into();
        } else {
            args[place + 1] = text.into();
        }
    }
    Ok(args)
}

/// Returns the first word behind the verb that is neither an option nor the value of one.
fn first_positional<'a>(words: &'a [String], command: &Command) -> Option<&'a str> {
    let (mut command, mut words) = (command, words.iter().skip(1));
    while let Some(word) = words.next() {
        if let Some(option) = word.strip_prefix("--") {
            let is_it = |arg: &&Arg| arg.get_long_and_visible_aliases().is_some_and(|names| names.contains(&option));
            if command.get_arguments().find(is_it).is_some_and(|arg| arg.get_action().takes_values()) {
                words.next();
            }
        } else if word.starts_with('-') && word.len() > 1 {
            // The options with one letter have no values.
        } else if let Some(verb) = command.find_subcommand(word) {
            command = verb;
        } else {
            return Some(word);
        }
    }
    None
}

/// Levels whose names have been replaced by their numbers.
struct NumberedLevels {
    mode: String,
    /// True if the mode was named in front of the level.
    is_mode_named: bool,
    numbers: String,
}

impl NumberedLevels {
    /// Finds the levels with these names. `mode` is that of levels without one. Returns `None` for numbers and files, and
    /// for games whose levels have no names.
    fn of(game: &dyn Game, mode: Option<&str>, value: &str) -> Result<Option<Self>, String> {
        let is_range = |text: &str| text.parse::<LevelSplit>().is_ok();
        // Some options take numbers without a mode.
        if value.starts_with('-') || is_level_files(value) || is_range(value) || is_range(&format!("any:{value}")) {
            return Ok(None);
        }
        let own = value.split_once(':').filter(|(mode, _)| game.check_mode(mode).is_ok());
        let (mode, name) = own.unwrap_or_else(|| (mode.unwrap_or_else(|| default_mode(game)), value));
        let names = game.tools().levels.level_names(mode);
        let number = |name: &str| names.iter().position(|known| known == name);
        let numbers = number(name).map(|number| number.to_string()).or_else(|| {
            let (first, last) = name.split_once("..")?;
            Some(format!("{}..{}", number(first)?, number(last)?))
        });
        match (numbers, names.as_slice()) {
            (Some(numbers), _) => Ok(Some(Self { mode: mode.to_owned(), is_mode_named: own.is_some(), numbers })),
            (None, []) => Ok(None),
            (None, [first, ..]) => {
                let known: Vec<&str> = names.iter().map(String::as_str).collect();
                let near = nearest(name, &known).map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
                Err(format!(
                    "`{}` has no level `{name}`{near}: name one as in its level editor, such as `{first}`, or by its number, \
                     as in {mode}:0",
                    game.name()
                ))
            }
        }
    }

    /// Returns them as an option takes them. One that takes no mode gets it only if it was named, for the error that says
    /// where to name it.
    fn in_words(&self, takes_mode: bool) -> String {
        let Self { mode, is_mode_named, numbers } = self;
        if takes_mode || *is_mode_named { format!("{mode}:{numbers}") } else { numbers.clone() }
    }
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
    let mut plain = number_wanted(source)?;
    if let Some((mode, level)) = mode_and_level(error) {
        plain += &format!("; write --mode {mode} --level {level}");
    }
    Some(error.render().to_string().replacen(&format!(": {source}"), &format!(": {plain}"), 1))
}

/// Returns mode and level where both were given as the number of a level, as in `--level hard:7`.
fn mode_and_level(error: &clap::Error) -> Option<(&str, &str)> {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    text(ContextKind::InvalidArg).filter(|option| option.starts_with("--level "))?;
    text(ContextKind::InvalidValue)?.split_once(':')
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
            ("level rooms --level Cave", "level rooms --level 1"),
            ("level rooms --mode hard --level=Tower --json", "level rooms --mode hard --level=2 --json"),
            ("level rooms --level hard:Cave", "level rooms --level hard:1"),
            ("test rooms --levels Cave --out a", "test rooms --levels easy:1 --out a"),
            ("test --levels hard:Hall..Cave", "test --levels hard:0..1"),
            ("record rooms --levels=hard:Tower --hold-out Hall", "record rooms --levels=hard:2 --hold-out easy:0"),
            ("explore rooms --level Cave", "explore rooms --level easy:1"),
            // Values of options name no game.
            ("test --out plain --levels Cave", "test --out plain --levels easy:1"),
            ("test --out plain rooms --levels Cave", "test --out plain rooms --levels easy:1"),
            ("eval rooms --run runs/a --levels Cave", "eval rooms --run runs/a --levels easy:1"),
            ("train --run runs/a --hold-out Cave", "train --run runs/a --hold-out easy:1"),
        ] {
            assert_eq!(numbered(args).as_deref(), Ok(wanted));
        }
        for same in [
            "level rooms --level 7",
            "test rooms --levels easy:0..9 --out Cave",
            "play rooms --levels 0..9",
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
    fn a_program_of_one_game_knows_its_levels_beside_any_file() {
        let [rooms, _] = rooms();
        let args = ["playbot", "demo", "filter", "a.demo", "--levels", "Cave"].map(OsString::from).to_vec();
        let numbered = with_level_numbers(args, &[&rooms], &Cli::command()).expect("a level");
        assert_eq!(numbered.last(), Some(&OsString::from("easy:1")));
    }

    #[test]
    fn an_unknown_name_of_a_level_is_reported_with_the_nearest() {
        let words = numbered("test rooms --levels easy:Cvae").expect_err("no such level");
        assert_eq!(
            words,
            "`rooms` has no level `Cvae` (did you mean `Cave`?): name one as in its level editor, such as `Hall`, or by its \
             number, as in easy:0"
        );
        assert!(numbered("level rooms --level Attic").is_err_and(|words| words.contains("`Attic`: name one")));
    }

    #[test]
    fn numbers_that_cannot_be_read_are_refused_in_plain_words() {
        for (option, value, words) in [
            ("--seed", "x", "error: invalid value 'x' for '--seed <seed>': it must be a whole number, 0 or more"),
            ("--seed", "-1", "it must be a whole number, 0 or more"),
            ("--seed", "18446744073709551616", "the number is too large"),
            ("--level", "hard:7", "0 or more; write --mode hard --level 7"),
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
