//! Tests that commands in documents can be called.

use std::fs;

use super::blocks::{Document, blocks, documents, workspace};

/// Verbs whose first argument is the name of a game.
const OF_A_GAME: [&str; 9] = ["record", "play", "doctor", "level", "test", "explore", "trace", "view", "eyes"];

/// Returns the commands of a shell's text, in words: lines go on behind a backslash, `#` begins a comment, `&&` another
/// command.
fn commands(text: &str) -> Vec<Vec<String>> {
    let mut commands = Vec::new();
    for line in text.replace("\\\n", " ").lines() {
        let line = line.split(" #").next().unwrap_or_default();
        // A redirection of the shell is no part of the command.
        let line = line.split(" > ").next().unwrap_or_default();
        commands.extend(line.split("&&").map(words).filter(|words| !words.is_empty()));
    }
    commands
}

/// Splits words, those in quotes as one.
fn words(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    for (index, part) in line.split(['"', '\'']).enumerate() {
        if index % 2 == 1 {
            words.push(part.to_owned());
        } else {
            words.extend(part.split_whitespace().map(str::to_owned));
        }
    }
    words
}

/// Returns the arguments of the program; `None` for other programs.
fn arguments(words: &[String]) -> Option<Vec<String>> {
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let rest = match words.as_slice() {
        ["playbot", rest @ ..] => rest,
        [program, rest @ ..] if program.starts_with("foreign_") => rest,
        ["cargo", "run", options @ ..] if !options.contains(&"--example") => {
            let start = options.iter().position(|word| *word == "--").map_or(options.len(), |at| at + 1);
            &options[start..]
        }
        _ => return None,
    };
    Some(["playbot"].iter().chain(rest).map(|word| (*word).to_owned()).collect())
}

/// Returns the games in `tests/foreign`, each of which has a program of its own, `foreign_` and its name.
fn foreign_games() -> Vec<String> {
    let folders = ["tests/foreign", "tests/foreign/default_features"];
    let entries = folders.map(|folder| fs::read_dir(workspace().join(folder)).expect("the games are there"));
    let entries = entries.into_iter().flatten().map(|entry| entry.expect("readable"));
    let games = entries.filter(|entry| entry.path().join("src/main.rs").exists());
    games.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

/// Replaces `foreign_NAME` by the command of each of these games, and `NAME` elsewhere by the game; in a command with a file
/// of `tests/foreign/NAME` by those that lie there.
fn for_each_game(words: Vec<String>) -> Vec<Vec<String>> {
    if words.first().is_none_or(|program| program != "foreign_NAME") {
        return vec![words];
    }
    let names_folder = words.iter().any(|word| word.starts_with("tests/foreign/NAME/"));
    let lies_there = |game: &String| !names_folder || workspace().join("tests/foreign").join(game).exists();
    let games: Vec<String> = foreign_games().into_iter().filter(lies_there).collect();
    games.iter().map(|game| words.iter().map(|word| word.replace("NAME", game)).collect()).collect()
}

/// Returns the missing name in a command of `tests/foreign`: the program, or the game, which has the program's name.
fn missing_game(words: &[String]) -> Option<String> {
    let game = words.first()?.strip_prefix("foreign_")?;
    if !foreign_games().iter().any(|known| known == game) {
        return Some(format!("there is no `{game}` in tests/foreign"));
    }
    let (verb, named) = (words.get(1)?, words.get(2)?);
    let names_another = OF_A_GAME.contains(&verb.as_str()) && !named.starts_with('-') && named != game;
    names_another.then(|| format!("foreign_{game} has no game `{named}`"))
}

/// Returns the whole commands between single backticks in the text.
fn inline_commands(text: &str) -> Vec<Vec<String>> {
    let code = text.split('`').skip(1).step_by(2).map(|code| code.replace('\n', " "));
    let is_program = |code: &String| code.starts_with("playbot ") || code.starts_with("foreign_");
    let code = code.filter(is_program).filter(|code| code.contains(" --"));
    code.flat_map(|code| commands(&code)).collect()
}

/// Returns a document without its blocks.
fn prose(text: &str) -> String {
    text.split("\n```").step_by(2).collect::<Vec<_>>().join("\n")
}

#[test]
fn commands_are_read_as_a_shell_reads_them() {
    let text = "playbot a --b 'c d' # why\ncargo run --release --features window -- play \\\n  x && ls\n";
    let found = commands(text);
    assert_eq!(found[0], ["playbot", "a", "--b", "c d"]);
    assert_eq!(arguments(&found[1]), Some(vec!["playbot".into(), "play".into(), "x".into()]));
    assert_eq!(arguments(&found[2]), None);
    assert_eq!(arguments(&words("cargo run --release")), Some(vec!["playbot".into()]));
    assert_eq!(inline_commands("`playbot` and `playbot eval --run a` and `eval --run b`").len(), 1);
    assert_eq!(prose("a\n```sh\nplaybot\n```\nb"), "a\n\nb");
}

#[test]
fn a_command_that_does_not_exist_is_found() {
    for (line, word) in
        [("playbot trian --run a", "trian"), ("playbot train --rnu a", "--rnu"), ("playbot train", "--run")]
    {
        let error = playbot::check_usage(words(line)).expect_err(line);
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn commands_of_foreign_games_are_checked_for_each_game() {
    let games = foreign_games();
    assert!(["breakout", "alien_cake_addict", "gem_hop"].iter().all(|name| games.iter().any(|game| game == name)));
    let expanded = for_each_game(words("foreign_NAME record NAME --out runs/NAME.demo"));
    assert_eq!(expanded.len(), games.len());
    assert!(expanded.contains(&words("foreign_breakout record breakout --out runs/breakout.demo")), "{expanded:?}");
    assert_eq!(for_each_game(words("playbot record NAME")), [words("playbot record NAME")]);
    assert_eq!(arguments(&expanded[0]).map(|all| all[..2].join(" ")).as_deref(), Some("playbot record"));
    assert_eq!(inline_commands("`foreign_NAME` and `foreign_NAME eval --run a`").len(), 1);
}

#[test]
fn a_foreign_game_that_does_not_exist_is_found() {
    for (line, what) in [
        ("foreign_tetris eval --run a", Some("there is no `tetris` in tests/foreign")),
        ("foreign_breakout record gem_hop --out a.demo", Some("foreign_breakout has no game `gem_hop`")),
        ("foreign_breakout record breakout --out a.demo", None),
        ("foreign_breakout demo verify a.demo", None),
        ("playbot record breakout", None),
    ] {
        assert_eq!(missing_game(&words(line)).as_deref(), what, "{line}");
    }
}

#[test]
fn every_command_can_be_called() {
    let mut checked = 0;
    for Document { path, text } in documents() {
        let shell = blocks(&text).into_iter().filter(|block| block.language == "sh");
        let shown = shell.flat_map(|block| commands(&block.text)).chain(inline_commands(&prose(&text)));
        for words in shown.flat_map(for_each_game) {
            let Some(arguments) = arguments(&words) else { continue };
            let line = words.join(" ");
            playbot::check_usage(&arguments).unwrap_or_else(|error| panic!("{path}: {line}\n{error}"));
            assert_eq!(missing_game(&words), None, "{path}: {line}");
            let experiment = arguments.iter().skip_while(|word| *word != "--experiment").nth(1);
            if let Some(file) = experiment.filter(|file| file.starts_with("assets/") || file.starts_with("tests/")) {
                assert!(workspace().join(file).exists(), "{path}: {line}: there is no {file}");
            }
            checked += 1;
        }
    }
    assert!(checked > 70, "only {checked} commands were found");
}
