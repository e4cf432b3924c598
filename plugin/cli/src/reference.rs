//! The reference page of all verbs, written from the parser of the command line.

use crate::{command_line::Cli, output::program::DEFAULT_NAME};
use clap::{Arg, Command, CommandFactory};
use std::fmt::Write;

/// The groups of verbs on the page, in the order of the page.
const GROUPS: [(&str, &[&str]); 7] = [
    ("Begin", &["init"]),
    (
        "Test levels",
        &["test", "doctor", "replay", "review", "explore", "levels", "watch", "report", "history", "bisect", "bugs"],
    ),
    ("See levels and episodes", &["level", "trace", "view", "eyes", "skills", "play"]),
    ("Record", &["record", "demo"]),
    (
        "Learn",
        &[
            "quickstart",
            "teach",
            "learn-skills",
            "imitate",
            "train",
            "diagnose",
            "study",
            "eval",
            "config",
            "runs",
            "policy",
            "bench",
        ],
    ),
    ("Let other programs play", &["serve", "work"]),
    ("Use the shell", &["completions"]),
];

const INTRODUCTION: &str = "\
# Verbs

`playbot` stands for the program with your game. Each verb prints its options and examples with `--help`, with the names
of your games in them:

```sh
playbot --help
playbot test --help
```

Data goes to standard output, as JSON with `--json`. Everything else goes to standard error. On Linux and macOS that is also
what games print. [Exit codes](exit-codes.md) are the same for all verbs.

In every verb that has them, `--level` names a level and `--seed` the random seed. In `level`, `trace`, `view`, `play` and
`doctor`, `--seed` alone named the level before: for one version it still does, with a warning.

A picture or a page replaces an earlier one of its name. What took work is kept: recordings, findings, models, policies, runs
and results are overwritten only with `--force`.

If no mode is named, a verb takes the mode of the game's training levels: that of the game's own experiment, or else the
game's first mode. Only `trace` takes the game's last mode.

In the examples, `GAME` stands for the name of a game, `MODE` for one of its modes, and `BOT` for one of its bots. Examples
that name a game are for the games of this repository.
";

/// Returns the reference page of all verbs as Markdown: what each does, its usage, its options with their defaults, and
/// examples. The page is the same for every list of games, and on every machine.
pub fn verbs_page() -> String {
    let mut program = Cli::command();
    // Gives each verb the whole line of its usage.
    program.build();
    let mut page = INTRODUCTION.to_owned();
    contents(&mut page, &program);
    page.push_str("\n## Options of all verbs\n");
    options(&mut page, program.get_arguments().filter(|argument| argument.is_global_set()));
    after_options(&mut page, &program);
    for (title, verbs) in GROUPS {
        let _ = write!(page, "\n## {title}\n");
        for name in verbs {
            if let Some(verb) = program.find_subcommand(name) {
                section(&mut page, verb, &format!("{DEFAULT_NAME} {name}"), 3);
            }
        }
    }
    page
}

/// Writes the table of the groups, with links to the sections of their verbs.
fn contents(page: &mut String, program: &Command) {
    page.push_str("\n| to | verbs |\n| --- | --- |\n");
    for (title, verbs) in GROUPS {
        let verbs = verbs.iter().filter_map(|name| program.find_subcommand(name));
        let links: Vec<_> = verbs.map(|verb| format!("[`{0}`](#{DEFAULT_NAME}-{0})", verb.get_name())).collect();
        let _ = writeln!(page, "| {} | {} |", title.to_lowercase(), links.join(", "));
    }
}

/// Writes the section of a verb, and below it those of its own verbs.
fn section(page: &mut String, verb: &Command, name: &str, depth: usize) {
    let _ = write!(page, "\n{} `{name}`\n", "#".repeat(depth));
    if let Some(about) = verb.get_long_about().or(verb.get_about()) {
        let _ = write!(page, "\n{}\n", sentence(&plain(&about.to_string())));
    }
    let usage = verb.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage:").lines().map(str::trim).collect::<Vec<_>>().join("\n");
    let _ = write!(page, "\n```text\n{}\n```\n", usage.trim());
    options(page, verb.get_arguments().filter(|argument| !argument.is_global_set()));
    after_options(page, verb);
    for inner in own_verbs(verb) {
        section(page, inner, &format!("{name} {}", inner.get_name()), depth + 1);
    }
}

/// Returns the verbs below a command, but for the parser's own `help`.
fn own_verbs(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|verb| verb.get_name() != "help" && !verb.is_hide_set())
}

/// Writes the table of options and other arguments, if there are any.
fn options<'a>(page: &mut String, arguments: impl Iterator<Item = &'a Arg>) {
    let shown = |argument: &&Arg| !argument.is_hide_set() && !["help", "version"].contains(&argument.get_id().as_str());
    let rows: Vec<_> = arguments.filter(shown).map(row).collect();
    if !rows.is_empty() {
        let _ = write!(page, "\n| option | default | |\n| --- | --- | --- |\n{}", rows.concat());
    }
}

/// Returns the row of an argument: how it is written, its default, and its help with the values that it takes.
fn row(argument: &Arg) -> String {
    let help = argument.get_long_help().or(argument.get_help()).map(ToString::to_string).unwrap_or_default();
    let mut help = sentence(&plain(&help)).replace("\n\n", " ").replace('\n', " ");
    let takes = argument.get_action().takes_values();
    let values = argument.get_possible_values();
    let values: Vec<_> = values.iter().filter(|value| !value.is_hide_set()).map(|value| value.get_name()).collect();
    if takes && !values.is_empty() {
        let _ = write!(help, " One of `{}`.", values.join("`, `"));
    }
    let defaults = argument.get_default_values().iter().map(|value| value.to_string_lossy());
    let default = defaults.filter(|value| !value.is_empty()).collect::<Vec<_>>().join(",");
    let default = match (takes, argument.get_id().as_str()) {
        _ if argument.is_required_set() => "required".to_owned(),
        (true, "threads") => "one per core".to_owned(),
        (true, _) if !default.is_empty() => format!("`{default}`"),
        _ => String::new(),
    };
    let cells = [spelling(argument), default, help];
    format!("| {} |\n", cells.map(|cell| cell.replace('|', "\\|")).join(" | "))
}

/// Returns how an argument is written, with all its names and the names of its values.
fn spelling(argument: &Arg) -> String {
    let takes = argument.get_action().takes_values();
    let names = argument.get_value_names().unwrap_or_default();
    let names = if takes { names.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ") } else { String::new() };
    let many = argument.get_num_args().is_some_and(|count| count.max_values() > names.split(' ').count().max(1));
    let values = if many { format!("{names}...") } else { names };
    if argument.is_positional() {
        return format!("`{values}`");
    }
    let short = argument.get_short().map(|letter| format!("-{letter}"));
    let long = argument.get_long_and_visible_aliases().unwrap_or_default();
    let all = short.into_iter().chain(long.iter().map(|name| format!("--{name}")));
    all.map(|name| format!("`{}`", format!("{name} {values}").trim_end())).collect::<Vec<_>>().join(", ")
}

/// Writes what stands below the options in the help of a verb: examples, keys, exit codes.
fn after_options(page: &mut String, command: &Command) {
    let Some(text) = command.get_after_help().map(ToString::to_string) else { return };
    for paragraph in text.split("\n\n") {
        let (title, lines) = paragraph.split_once('\n').unwrap_or((paragraph, ""));
        if !title.ends_with(':') || lines.is_empty() {
            let _ = write!(page, "\n{}\n", plain(paragraph));
            continue;
        }
        let is_examples = title == "Examples:";
        let language = if is_examples { "sh" } else { "text" };
        let _ = write!(page, "\n{title}\n\n```{language}\n");
        for line in lines.lines().map(|line| line.strip_prefix("  ").unwrap_or(line)) {
            let line = match line.split_once("   ").filter(|_| is_examples) {
                Some((command, meaning)) => format!("{command}   # {}", meaning.trim()),
                None => line.to_owned(),
            };
            let _ = writeln!(page, "{line}");
        }
        page.push_str("```\n");
    }
}

/// Returns a text with its last sentence closed; the parser takes the full stop away.
fn sentence(text: &str) -> String {
    let text = text.trim_end();
    let is_closed = text.is_empty() || text.ends_with(['.', ':', '?', '!']);
    if is_closed { text.to_owned() } else { format!("{text}.") }
}

/// Returns a text in which Markdown changes nothing: code stays code, and other signs are escaped.
fn plain(text: &str) -> String {
    let mut parts = Vec::new();
    for (index, part) in text.split('`').enumerate() {
        let is_code = index % 2 == 1;
        parts.push(if is_code { part.to_owned() } else { part.replace('*', "\\*").replace('<', "\\<") });
    }
    parts.join("`")
}

#[cfg(test)]
mod tests {
    use clap::ArgAction;

    use super::*;

    #[test]
    fn every_verb_stands_in_one_group() {
        let program = Cli::command();
        let mut verbs: Vec<_> = own_verbs(&program).map(Command::get_name).collect();
        let mut grouped: Vec<_> = GROUPS.iter().flat_map(|(_, verbs)| verbs.iter().copied()).collect();
        verbs.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(verbs, grouped);
    }

    #[test]
    fn every_verb_and_those_below_it_have_a_section() {
        fn check(page: &str, command: &Command, name: &str) {
            for verb in own_verbs(command) {
                let name = format!("{name} {}", verb.get_name());
                let heading = format!(" `{name}`");
                assert!(page.lines().any(|line| line.trim_start_matches('#') == heading), "{name} has no section");
                check(page, verb, &name);
            }
        }
        let page = verbs_page();
        check(&page, &Cli::command(), DEFAULT_NAME);
        assert_eq!(page.matches("`--verbose`").count(), 1, "options of all verbs stand on the page once");
    }

    #[test]
    fn an_argument_is_a_row_with_its_names_its_default_and_its_values() {
        let steps = Arg::new("steps").long("steps").value_name("N").default_value("5").help("Steps of *all* | arenas");
        let form = Arg::new("form").value_name("FORM").required(true).value_parser(["a", "b"]).help("Form");
        let flag = Arg::new("force").short('f').long("force").action(ArgAction::SetTrue).help("Replace `<a>`.");
        let mut command = Command::new("verb").args([form, steps, flag]);
        command.build();
        let mut page = String::new();
        options(&mut page, command.get_arguments());
        let rows: Vec<_> = page.lines().skip(3).collect();
        assert_eq!(
            rows,
            [
                "| `FORM` | required | Form. One of `a`, `b`. |",
                "| `--steps N` | `5` | Steps of \\*all\\* \\| arenas. |",
                "| `-f`, `--force` |  | Replace `<a>`. |",
            ]
        );
    }

    #[test]
    fn examples_are_commands_with_comments_and_other_lists_are_text() {
        let command =
            Command::new("verb").after_help("Keys:\n  P   pause\n\nExamples:\n  playbot a   why\n  playbot b\n\nEnd.");
        let mut page = String::new();
        after_options(&mut page, &command);
        let keys = "\nKeys:\n\n```text\nP   pause\n```\n";
        let shown = "\nExamples:\n\n```sh\nplaybot a   # why\nplaybot b\n```\n";
        assert_eq!(page, format!("{keys}{shown}\nEnd.\n"));
    }
}
