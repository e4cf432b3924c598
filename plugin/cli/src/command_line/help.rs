//! Help texts with the names of this program and of its games.
//!
//! Examples are written for the program `playbot` with the words `GAME`, `MODE` and `BOT`. They stand for the program's
//! first game, the mode that it is trained in, and its demonstrator. Examples that cannot work in a program are left
//! out.

use crate::{
    arguments::default_mode,
    output::program::{DEFAULT_NAME, with_name},
    verbs::level::shows_levels,
};
use clap::{Arg, Command};
use playbot_harness::prelude::{ActionSpace, Game};

/// The column of explanations of examples.
const COLUMN: usize = 48;

/// Puts the names of a program and its games into all texts of a command. Examples are left out if the program does not
/// have their game, or the game lacks a part that they need.
pub(crate) fn named(command: Command, program: &'static str, games: &[&dyn Game]) -> Command {
    let plays = command.get_arguments().any(|argument| argument.get_id() == "game");
    let examples = command.get_after_help().map(|text| examples(&text.to_string(), plays, program, games));
    let command = command.mut_args(|argument| of_argument(argument, program));
    let mut command = command.mut_subcommands(|verb| named(verb, program, games));
    if let Some(text) = command.get_about().map(ToString::to_string) {
        command = command.about(with_name(&text, program));
    }
    if let Some(text) = command.get_long_about().map(ToString::to_string) {
        command = command.long_about(with_name(&text, program));
    }
    match examples {
        Some(text) => command.after_help(text),
        None => command,
    }
}

/// Puts the games of a program in front of the text below the options: a line for each, with its modes.
pub(crate) fn with_games(command: Command, games: &[&dyn Game]) -> Command {
    let below = command.get_after_help().map_or_else(String::new, ToString::to_string);
    command.after_help(format!("{}\n\n{below}", list(games)))
}

/// Most modes of a game that are listed.
const MOST_MODES: usize = 8;

/// Lists games with their modes.
fn list(games: &[&dyn Game]) -> String {
    let width = games.iter().map(|game| game.name().chars().count()).max().unwrap_or(0);
    let line = |game: &&dyn Game| {
        let modes = game.modes();
        let more = modes.len().saturating_sub(MOST_MODES);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let what = if modes.len() == 1 { "mode" } else { "modes" };
        format!("  {:width$}   {what} {}{more}", game.name(), modes[..modes.len().min(MOST_MODES)].join(", "))
    };
    let head = if games.len() == 1 { "Game:" } else { "Games:" };
    std::iter::once(head.to_owned()).chain(games.iter().map(line)).collect::<Vec<_>>().join("\n")
}

fn of_argument(argument: Arg, program: &str) -> Arg {
    let own = |text: String| with_name(&text, program);
    let (short, long) =
        (argument.get_help().map(ToString::to_string), argument.get_long_help().map(ToString::to_string));
    let argument = match short {
        Some(text) => argument.help(own(text)),
        None => argument,
    };
    match long {
        Some(text) => argument.long_help(own(text)),
        None => argument,
    }
}

/// Returns the text below a command's options. `plays` is true if the command takes the name of a game.
fn examples(text: &str, plays: bool, program: &str, games: &[&dyn Game]) -> String {
    let first = games.first();
    let mode = first.map(|game| default_mode(*game));
    let bot = first.and_then(|game| game.tools().bots.demonstrator());
    let names = [
        ("GAME", first.map_or("GAME", |game| game.name())),
        ("MODE", mode.unwrap_or("default")),
        ("BOT", bot.unwrap_or("random")),
    ];
    let mut lines = Vec::new();
    for line in text.lines() {
        match line.strip_prefix("  ").filter(|line| line.starts_with(DEFAULT_NAME)) {
            Some(example) if works(example, plays, games) => lines.push(own_example(example, program, &names)),
            Some(_) => {}
            None => lines.push(line.to_owned()),
        }
    }
    if lines.iter().all(|line| !line.starts_with("  ")) {
        lines.retain(|line| line != "Examples:");
    }
    lines.join("\n").trim().to_owned()
}

/// Returns true if the program has the game of an example, and the game the parts that the verb needs.
fn works(example: &str, plays: bool, games: &[&dyn Game]) -> bool {
    let mut words = example.split_whitespace().skip(1);
    let (verb, name) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let is_first = name == "GAME";
    let game = if is_first { games.first() } else { games.iter().find(|game| game.name() == name) };
    // An optional game is left out where an option follows the verb.
    let Some(game) = game else { return !plays || name.starts_with('-') };
    match verb {
        "record" => game.tools().bots.demonstrator().is_some(),
        "eyes" => game.tools().pictures.picture().is_some(),
        "level" => shows_levels(*game),
        // The games named here trace their continuous actions in a form of their own.
        "trace" => !is_first || matches!(game.actions(), ActionSpace::Discrete(_)),
        _ => true,
    }
}

/// Returns an example with the names in it. Its explanation, if any, stands in the common column, at least three blanks
/// behind it. So it does not look like a part of the command.
fn own_example(example: &str, program: &str, names: &[(&str, &str)]) -> String {
    let own = |text: &str| names.iter().fold(text.to_owned(), |text, (word, name)| text.replace(word, name));
    let (command, explanation) = example.split_once("   ").unwrap_or((example, ""));
    let (command, explanation) = (own(&command.replacen(DEFAULT_NAME, program, 1)) + "  ", own(explanation));
    format!("  {command:<COLUMN$} {}", explanation.trim_start()).trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use playbot_harness::foreign::ForeignGame;

    use super::*;
    use crate::command_line::{Cli, check_usage};

    /// Words of games that a program need not have.
    const STRANGE: [&str; 5] = ["coinrun", "maze", "hard", "search", "right-jump"];

    fn runner() -> ForeignGame {
        ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {})
    }

    /// Collects all texts of a command and of those below it: descriptions, options with all their values, and
    /// examples.
    fn said(command: &Command, all: &mut Vec<String>) {
        let texts = [
            command.get_about(),
            command.get_long_about(),
            command.get_before_help(),
            command.get_after_help(),
            command.get_after_long_help(),
        ];
        all.extend(texts.into_iter().flatten().map(ToString::to_string));
        for argument in command.get_arguments() {
            let texts = [argument.get_help(), argument.get_long_help()];
            all.extend(texts.into_iter().flatten().map(ToString::to_string));
            all.extend(argument.get_default_values().iter().map(|value| value.to_string_lossy().into_owned()));
            all.extend(argument.get_possible_values().iter().map(|value| value.get_name().to_owned()));
        }
        command.get_subcommands().for_each(|verb| said(verb, all));
    }

    /// Returns all texts of the program `jump` with this game alone.
    fn said_of(game: &ForeignGame) -> Vec<String> {
        let mut all = Vec::new();
        said(&named(Cli::command(), "jump", &[game]), &mut all);
        all
    }

    /// Returns the words of a line as a shell takes them: quotes keep spaces together.
    fn shell_words(line: &str) -> Vec<String> {
        let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
        for letter in line.chars().chain([' ']) {
            match quote {
                Some(mark) if letter == mark => quote = None,
                None if letter == '"' || letter == '\'' => quote = Some(letter),
                None if letter.is_whitespace() => {
                    words.extend(Some(std::mem::take(&mut word)).filter(|word| !word.is_empty()))
                }
                _ => word.push(letter),
            }
        }
        words
    }

    #[test]
    fn the_help_of_another_program_speaks_of_its_own_game() {
        let all = said_of(&runner());
        let mut examples = 0;
        for line in all.iter().flat_map(|text| text.lines()) {
            // Shards are parts of a test, whatever its game is.
            let small = line.to_lowercase().replace("shard", "part");
            assert_eq!(STRANGE.iter().find(|word| small.contains(**word)), None, "{line}");
            let strange = ["playbot ", "GAME", "MODE", "BOT"].iter().find(|word| line.contains(**word));
            if let Some(example) = line.strip_prefix("  jump") {
                assert_eq!(strange, None, "{line}");
                let words = shell_words(example.split("   ").next().unwrap_or_default());
                let words = std::iter::once("jump".to_owned()).chain(words);
                check_usage(words).unwrap_or_else(|error| panic!("{line}\n{error}"));
                examples += 1;
            }
            assert!(!line.contains("`playbot "), "{line}");
        }
        assert!(examples > 40, "only {examples} examples were found");
        for example in ["doctor runner ", "train runner --skills", "train --run runs/first --resume", "eval --skills"] {
            assert!(all.iter().any(|text| text.contains(&format!("  jump {example}"))), "{example}: {all:?}");
        }
    }

    #[test]
    fn the_help_of_a_program_lists_its_games_with_their_modes() {
        let game = |name, modes| ForeignGame::new(name, 1, |_: &mut bevy::prelude::App| {}).modes(modes);
        let (chess, go) = (game("chess", &["default"]), game("go", &["9", "13", "19"]));
        let below = |games: &[&dyn Game]| {
            let command = with_games(named(Cli::command(), "jump", games), games);
            command.get_after_help().map(ToString::to_string).unwrap_or_default()
        };
        let several = below(&[&chess, &go]);
        let wanted = "Games:\n  chess   mode default\n  go      modes 9, 13, 19\n\nExamples:\n  jump ";
        assert!(several.starts_with(wanted), "{several}");
        assert!(below(&[&chess]).starts_with("Game:\n  chess   mode default\n\nExamples:\n"), "{}", below(&[&chess]));
        let many = game("many", &["1", "2", "3", "4", "5", "6", "7", "8", "9", "10"]);
        assert_eq!(list(&[&many]), "Game:\n  many   modes 1, 2, 3, 4, 5, 6, 7, 8 and 2 more");
        let without = Cli::command().get_after_help().map(ToString::to_string).unwrap_or_default();
        assert!(without.starts_with("Examples:"), "the reference is that of any program: {without}");
    }

    #[test]
    fn examples_that_cannot_work_are_left_out() {
        let has = |all: &[String], verb: &str| all.iter().any(|text| text.contains(&format!("  jump {verb} runner")));
        let without = said_of(&runner());
        for verb in ["record", "eyes"] {
            assert!(!has(&without, verb), "{verb}: {without:?}");
        }
        assert!(["view", "trace", "level"].iter().all(|verb| has(&without, verb)), "{without:?}");
        let with = said_of(&runner().demonstrator("walker", || 0_u32));
        assert!(has(&with, "record") && !has(&with, "eyes"), "{with:?}");
    }

    #[test]
    fn examples_of_other_games_are_left_out_and_explanations_stand_in_one_column() {
        let game = runner();
        let text = "Examples:\n  playbot view GAME --level 5   look\n  playbot view chess --level 5\n\nMore words.";
        let own = examples(text, true, "jump", &[&game]);
        assert_eq!(own, format!("Examples:\n  {:<48} look\n\nMore words.", "jump view runner --level 5"));
        assert_eq!(examples("Examples:\n  playbot view chess", true, "jump", &[&game]), "");
        let program = "a_program_whose_name_is_longer_than_most";
        let own = examples("Examples:\n  playbot view GAME   look", true, program, &[&game]);
        assert_eq!(own, format!("Examples:\n  {program} view runner   look"));
    }
}
