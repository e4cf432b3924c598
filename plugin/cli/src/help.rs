//! Help with the names of this program and of its games.
//!
//! Examples are written for the program `playbot` with the words `GAME`, `MODE` and `BOT`, which stand for the program's
//! first game, its last mode, and its demonstrator.

use clap::{Arg, Command};
use playbot_lab::game::Game;

use super::program::{USUAL, with_name};

/// The column in which examples are explained.
const COLUMN: usize = 48;

/// Puts the names of a program and its games into all that a command says of itself. Examples of games that the program
/// does not have are left out.
pub fn named(command: Command, program: &'static str, games: &[&dyn Game]) -> Command {
    let plays = command.get_arguments().any(|argument| argument.get_id() == "game");
    let examples = command.get_after_help().map(|text| examples(&text.to_string(), plays, program, games));
    let command = command.mut_args(|argument| of_argument(argument, program));
    let command = command.mut_subcommands(|verb| named(verb, program, games));
    match examples {
        Some(text) => command.after_help(text),
        None => command,
    }
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

/// What stands below a command's options. `plays` says whether the command is given the name of a game.
fn examples(text: &str, plays: bool, program: &str, games: &[&dyn Game]) -> String {
    let first = games.first();
    let mode = first.and_then(|game| game.modes().last().copied());
    let bot = first.and_then(|game| game.demonstrator());
    let names = [
        ("GAME", first.map_or("GAME", |game| game.name())),
        ("MODE", mode.unwrap_or("default")),
        ("BOT", bot.unwrap_or("random")),
    ];
    let is_there = |example: &str| {
        let game = example.split_whitespace().nth(2).filter(|_| plays);
        game.is_none_or(|wanted| wanted == "GAME" || games.iter().any(|game| game.name() == wanted))
    };
    let mut lines = Vec::new();
    for line in text.lines() {
        match line.strip_prefix("  ").filter(|line| line.starts_with(USUAL)) {
            Some(example) if is_there(example) => lines.push(own_example(example, program, &names)),
            Some(_) => {}
            None => lines.push(line.to_owned()),
        }
    }
    if lines.iter().all(|line| !line.starts_with("  ")) {
        lines.retain(|line| line != "Examples:");
    }
    lines.join("\n").trim().to_owned()
}

/// An example with the names in it, and its explanation, if it has one, in the usual column.
fn own_example(example: &str, program: &str, names: &[(&str, &str)]) -> String {
    let own = |text: &str| names.iter().fold(text.to_owned(), |text, (word, name)| text.replace(word, name));
    let (command, explanation) = example.split_once("   ").unwrap_or((example, ""));
    let (command, explanation) = (own(&command.replacen(USUAL, program, 1)), own(explanation));
    format!("  {command:<COLUMN$} {}", explanation.trim_start()).trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use playbot_lab::foreign::ForeignGame;

    use super::*;
    use crate::command_line::{Cli, check_usage};

    /// All that a command and those below it say of themselves.
    fn said(command: &Command, all: &mut Vec<String>) {
        all.extend(command.get_after_help().map(ToString::to_string));
        all.extend(command.get_arguments().filter_map(Arg::get_help).map(ToString::to_string));
        command.get_subcommands().for_each(|verb| said(verb, all));
    }

    #[test]
    fn the_help_of_another_program_speaks_of_its_own_game() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let mut all = Vec::new();
        said(&named(Cli::command(), "jump", &[&game]), &mut all);
        let mut examples = 0;
        for line in all.iter().flat_map(|text| text.lines()) {
            let strange =
                ["playbot ", "GAME", "MODE", "BOT", "coinrun", "maze"].iter().find(|word| line.contains(**word));
            if let Some(example) = line.strip_prefix("  jump") {
                assert_eq!(strange, None, "{line}");
                let words = example.split("   ").next().unwrap_or_default().split_whitespace();
                check_usage(std::iter::once("jump").chain(words)).unwrap_or_else(|error| panic!("{line}\n{error}"));
                examples += 1;
            }
            assert!(!line.contains("`playbot "), "{line}");
        }
        assert!(examples > 40, "only {examples} examples were found");
        assert!(all.iter().any(|text| text.contains("  jump doctor runner ")), "{all:?}");
    }

    #[test]
    fn examples_of_other_games_are_left_out_and_explanations_stand_in_one_column() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let text = "Examples:\n  playbot view GAME --seed 5   look\n  playbot view chess --seed 5\n\nMore words.";
        let own = examples(text, true, "jump", &[&game]);
        assert_eq!(own, format!("Examples:\n  {:<48} look\n\nMore words.", "jump view runner --seed 5"));
        assert_eq!(examples("Examples:\n  playbot view chess", true, "jump", &[&game]), "");
    }
}
