//! Commands that documents show can be called.

use super::blocks::{Document, blocks, documents, workspace};

/// The commands of a shell's text, in words: lines go on behind a backslash, `#` begins a comment, `&&` another command.
fn commands(text: &str) -> Vec<Vec<String>> {
    let mut commands = Vec::new();
    for line in text.replace("\\\n", " ").lines() {
        let line = line.split(" #").next().unwrap_or_default();
        commands.extend(line.split("&&").map(words).filter(|words| !words.is_empty()));
    }
    commands
}

/// Words, those in quotes as one.
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

/// What the program would be called with; `None` for other programs.
fn arguments(words: &[String]) -> Option<Vec<String>> {
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let rest = match words.as_slice() {
        ["playbot", rest @ ..] => rest,
        ["cargo", "run", options @ ..] if !options.contains(&"--example") => {
            let start = options.iter().position(|word| *word == "--").map_or(options.len(), |at| at + 1);
            &options[start..]
        }
        _ => return None,
    };
    Some(["playbot"].iter().chain(rest).map(|word| (*word).to_owned()).collect())
}

/// What stands in the text between single backticks and is a whole command.
fn inline_commands(text: &str) -> Vec<Vec<String>> {
    let code = text.split('`').skip(1).step_by(2).map(|code| code.replace('\n', " "));
    let code = code.filter(|code| code.starts_with("playbot ") && code.contains(" --"));
    code.flat_map(|code| commands(&code)).collect()
}

/// A document without its blocks.
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
        let error = playbot_cli::check_usage(words(line)).expect_err(line);
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn every_command_can_be_called() {
    let mut checked = 0;
    for Document { path, text } in documents() {
        let shell = blocks(&text).into_iter().filter(|block| block.language == "sh");
        let shown = shell.flat_map(|block| commands(&block.text)).chain(inline_commands(&prose(&text)));
        for arguments in shown.filter_map(|words| arguments(&words)) {
            let line = arguments.join(" ");
            playbot_cli::check_usage(&arguments).unwrap_or_else(|error| panic!("{path}: {line}\n{error}"));
            let experiment = arguments.iter().skip_while(|word| *word != "--experiment").nth(1);
            if let Some(file) = experiment.filter(|file| file.starts_with("assets/")) {
                assert!(workspace().join(file).exists(), "{path}: {line}: there is no {file}");
            }
            checked += 1;
        }
    }
    assert!(checked > 30, "only {checked} commands were found");
}
