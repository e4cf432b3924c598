//! Reading of experiments, from a path or from those that come with the program, with the changes of the command line.

use crate::error::CliError;
use playbot_harness::{
    game::Game,
    games::{Artifact, Games},
    inspect::ExperimentText,
};
use playbot_train::{
    Experiment,
    experiment::{
        ExperimentError, default_experiment, experiment_of,
        file::{
            ConfigError, locate, parse_experiment, parse_experiment_with, read_experiment, read_experiment_text,
            read_experiment_with,
        },
    },
    runs::group::settings,
};
use std::{
    collections::BTreeSet,
    fmt::Display,
    path::{Path, PathBuf},
};

/// Options that choose an experiment and change it.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct ExperimentArgs {
    /// Name of the game, whose own experiment is the default (default: the program's first game).
    pub game: Option<String>,
    /// Experiment file, or - for standard input (default: that of the game, for `eval --run` the run's own).
    #[arg(long, value_name = "FILE")]
    pub experiment: Option<PathBuf>,
    /// Change a setting of the experiment, such as ppo.lr=0.0003 (repeatable).
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl ExperimentArgs {
    /// Returns the default experiment of a game.
    pub fn of_game(game: &str) -> Self {
        Self { game: Some(game.to_owned()), ..Self::default() }
    }

    /// Reads the experiment, applies `--set` and then the options with names of their own, and checks it.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] with file, line and column, or with the `key=value` that does not fit; or two games are named.
    pub fn load(
        &self,
        games: &Games,
        options: impl IntoIterator<Item = Option<String>>,
    ) -> Result<Experiment, ConfigError> {
        self.check_game(games)?;
        let sets = self.sets(options);
        let mut experiment = match &self.experiment {
            Some(path) => read_experiment_with(path, &sets),
            None => {
                let ExperimentText { origin, text } = unnamed(games, &sets);
                parse_experiment_with(&text, Path::new(&*origin), &sets)
            }
        }?;
        // Runs and policies name a game by its own name, not by an alias.
        if let Ok(game) = games.get(&experiment.game) {
            game.name().clone_into(&mut experiment.game);
        }
        Ok(experiment)
    }

    /// Reads the experiment as [`load`](Self::load) does, and finds its game. Reports values of `--set` that its
    /// algorithm does not read.
    ///
    /// # Errors
    ///
    /// As for [`load`](Self::load) and [`find_game`](Self::find_game).
    pub fn open<'a>(
        &self,
        games: &Games<'a>,
        options: impl IntoIterator<Item = Option<String>>,
    ) -> Result<(Experiment, &'a dyn Game), CliError> {
        let experiment = self.load(games, options)?;
        report_unread("--set ", &self.set, &[&experiment]);
        let game = self.find_game(games, &experiment)?;
        Ok((experiment, game))
    }

    /// Returns the game of an experiment.
    ///
    /// # Errors
    ///
    /// This program does not have it: with the file that names it, or the nearest name if the command line does.
    pub fn find_game<'a>(&self, games: &Games<'a>, experiment: &Experiment) -> Result<&'a dyn Game, CliError> {
        match &self.experiment {
            Some(path) if !self.names_game_itself() => {
                Ok(games.of_file(Artifact::Experiment, path, &experiment.game)?)
            }
            _ => Ok(games.get(&experiment.game)?),
        }
    }

    /// Adds the position of the faulty key to an error of an experiment that was [loaded](Self::load): file, line and
    /// column, or its `key=value`.
    pub fn locate(
        &self,
        games: &Games,
        options: impl IntoIterator<Item = Option<String>>,
        error: ExperimentError,
    ) -> ConfigError {
        let sets = self.sets(options);
        match &self.experiment {
            Some(path) => locate(&read_experiment_text(path).unwrap_or_default(), path, &sets, error),
            None => {
                let ExperimentText { origin, text } = unnamed(games, &sets);
                locate(&text, Path::new(&*origin), &sets, error)
            }
        }
    }

    /// Refuses a game behind the verb that differs from the one in a file or in `--set`. That would be a slip, while
    /// `--set` changes the game of a file on purpose.
    fn check_game(&self, games: &Games) -> Result<(), ConfigError> {
        let Some(game) = &self.game else { return Ok(()) };
        let is_other = |other: &str| match (games.get(game), games.get(other)) {
            (Ok(one), Ok(other)) => one.name() != other.name(),
            _ => game != other,
        };
        let refused = |message| Err(ConfigError::Set { set: format!("game={game}"), message });
        if let Some(other) = game_of(&self.set).filter(|other| is_other(other)) {
            return refused(format!("`--set` names the game `{other}`: leave one of them out"));
        }
        let Some(path) = &self.experiment else { return Ok(()) };
        match read_experiment(path) {
            Ok(own) if is_other(&own.game) => refused(format!(
                "{} is an experiment of `{}`: leave the game out, or change it with --set game={game}",
                path.display(),
                own.game
            )),
            _ => Ok(()),
        }
    }

    /// Returns true if a game is named: behind the verb, in an experiment file, or with `--set`.
    pub fn names_game(&self) -> bool {
        self.experiment.is_some() || self.names_game_itself()
    }

    /// Returns true if a game is named behind the verb or with `--set`.
    pub fn names_game_itself(&self) -> bool {
        self.game.is_some() || game_of(&self.set).is_some()
    }

    /// Returns the path of an experiment's recordings, see [`find_recordings`](Self::find_recordings). Reports it if
    /// the path is not the experiment's.
    ///
    /// # Errors
    ///
    /// The experiment names none.
    pub fn recordings(&self, experiment: &Experiment, games: &Games) -> Result<PathBuf, ExperimentError> {
        let path = experiment.recordings()?;
        let found = self.find_recordings(path, games);
        if found != path {
            report!("recordings are taken from {}, since there are none at {} here", found.display(), path.display());
        }
        Ok(found)
    }

    /// Returns the path of recordings that an experiment names, relative to this folder: those beside its file were
    /// found when it was read. Missing recordings of experiments that come with the program are also looked for in its
    /// sources, so that `cargo run` works from any folder.
    pub fn find_recordings(&self, path: &Path, games: &Games) -> PathBuf {
        let beside = sources().join(path);
        let is_set = self.set.iter().any(|set| sets_key(set, "demos"));
        let is_default = self.experiment.is_none() && !is_set;
        let folder = self.experiment.as_deref().and_then(Path::parent).filter(|folder| *folder != Path::new(""));
        if let Some(folder) = folder.filter(|_| !is_set && path.is_relative() && !path.exists()) {
            report!("there are no recordings at {}, beside the experiment", folder.join(path).display());
        }
        let is_beside = is_default && !path.exists() && beside.exists();
        if is_beside && is_shipped(path, &unnamed(games, &self.sets([]))) { beside } else { path.into() }
    }

    /// Formats the options as they are written behind a verb, with a blank in front of each.
    pub fn words(&self) -> String {
        let game = self.game.iter().map(|game| format!(" {}", quoted(game)));
        let experiment =
            self.experiment.iter().map(|path| format!(" --experiment {}", quoted(&path.to_string_lossy())));
        let set = self.set.iter().map(|set| format!(" --set {}", quoted(set)));
        game.chain(experiment).chain(set).collect()
    }

    /// Returns these options with known `key=value`s of the experiment below them.
    pub fn over(&self, known: impl IntoIterator<Item = String>) -> Self {
        let set = known.into_iter().chain(self.set.iter().cloned()).collect();
        Self { game: self.game.clone(), experiment: self.experiment.clone(), set }
    }

    /// Returns the `key=value`s of the game's name, then `--set`, then the options with names of their own.
    pub fn sets(&self, options: impl IntoIterator<Item = Option<String>>) -> Vec<String> {
        let game = self.game.iter().map(|game| format!("game={game}"));
        game.chain(self.set.iter().cloned()).chain(options.into_iter().flatten()).collect()
    }
}

/// Reports the `key=value`s that none of these experiments reads.
pub(crate) fn report_unread(whose: &str, sets: &[String], experiments: &[&Experiment]) {
    let mut names: Vec<&str> = experiments.iter().map(|experiment| experiment.algorithm.name()).collect();
    names.sort_unstable();
    names.dedup();
    for set in sets {
        let key = set.split('=').next().unwrap_or(set).trim();
        if !experiments.iter().any(|experiment| experiment.reads(key)) {
            report!("warning: {whose}{set} changes nothing: {} does not read `{key}`", names.join(" or "));
        }
    }
}

/// Returns the default experiment: that of the game that `sets` name, since levels and settings of another one would
/// not fit it. An unknown game is refused later.
fn unnamed(games: &Games, sets: &[String]) -> ExperimentText {
    let game = game_of(sets).and_then(|name| games.get(name).ok());
    game.map_or_else(|| default_experiment(games), experiment_of)
}

/// Returns the game that `key=value`s name; the last of them counts.
fn game_of(sets: &[String]) -> Option<&str> {
    let (_, name) = sets.iter().rev().find(|set| sets_key(set, "game"))?.split_once('=')?;
    Some(name.trim().trim_matches('"'))
}

/// Returns true if these are the recordings of an unchanged experiment of the sources.
fn is_shipped(recordings: &Path, ExperimentText { origin, text }: &ExperimentText) -> bool {
    let is_there = std::fs::read_to_string(sources().join(&**origin)).is_ok_and(|found| found == **text);
    is_there
        && parse_experiment(text, Path::new(&**origin))
            .is_ok_and(|default| default.demos.as_deref() == Some(recordings))
}

/// Returns true if a `key=value` sets exactly this key.
pub(crate) fn sets_key(set: &str, key: &str) -> bool {
    set.split_once('=').is_some_and(|(name, _)| name.trim() == key)
}

/// Quotes a word for the shell.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:".contains(c);
    if word.chars().all(is_plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

/// Returns an option with a name of its own, as `key=value`.
pub(crate) fn option<T: Display>(key: &str, value: &Option<T>) -> Option<String> {
    value.as_ref().map(|value| format!("{key}={value}"))
}

/// Returns the setting of `--include-seen`, if it is given.
pub(crate) fn include_seen(is_given: bool) -> Option<String> {
    is_given.then(|| "eval.include_seen=true".to_owned())
}

/// Returns the folder of this library's sources at build time. The program's sources are there only if it was built
/// with them: a game elsewhere has its own.
fn sources() -> &'static Path {
    let this = Path::new(env!("CARGO_MANIFEST_DIR"));
    this.ancestors().nth(2).unwrap_or(this)
}

// Differences between the options and the work to resume.

/// Most differences to print.
const NAMED: usize = 4;

/// The options of a verb, as they were written.
pub struct Options<'a> {
    /// The options of the experiment.
    pub from: &'a ExperimentArgs,
    /// The options with names of their own: the key that each sets, and the option with its value, if it was given.
    pub own: &'a [(&'a str, Option<String>)],
}

impl Options<'_> {
    /// Returns the settings in which the options differ from the work of `whose`, with both values; keys in `free` may
    /// differ.
    pub fn differences(&self, wanted: &Experiment, kept: &Experiment, whose: &str, free: &[&str]) -> Vec<String> {
        let (kept, wanted) = (settings(kept), settings(wanted));
        let keys: BTreeSet<&String> = kept.keys().chain(wanted.keys()).collect();
        let value = |value: Option<&String>| value.cloned().unwrap_or_else(|| "nothing".to_owned());
        keys.into_iter()
            .filter(|key| !free.contains(&key.as_str()) && kept.get(*key) != wanted.get(*key))
            .map(|key| {
                let (given, kept) = (value(wanted.get(key)), value(kept.get(key)));
                format!("{} asks for {key}={given}, and {whose} has {kept}", self.option_of(key))
            })
            .collect()
    }

    /// Returns the option that sets a key: those with names of their own count last.
    fn option_of(&self, key: &str) -> String {
        let own = self.own.iter().find(|(of, _)| *of == key).and_then(|(_, option)| option.as_ref());
        if let Some(option) = own {
            return format!("`{option}`");
        }
        if let Some(game) = self.from.game.as_ref().filter(|_| key == "game") {
            return format!("`{game}`");
        }
        match (self.from.set.iter().rev().find(|set| reaches(set, key)), &self.from.experiment) {
            (Some(set), _) => format!("`--set {set}`"),
            (None, Some(path)) => format!("`--experiment {}`", path.display()),
            (None, None) => "the experiment without options".to_owned(),
        }
    }
}

/// Returns true if a `key=value` sets this key, alone or with its whole section.
pub(crate) fn reaches(set: &str, key: &str) -> bool {
    let sections = key.match_indices('.').map(|(at, _)| &key[..at]);
    sections.chain([key]).any(|name| sets_key(set, name))
}

/// Formats the first differences, and the number of the others.
pub(crate) fn in_words(mut differences: Vec<String>) -> String {
    let more = differences.len().saturating_sub(NAMED);
    differences.truncate(NAMED);
    if more > 0 {
        differences.push(format!("and {more} more"));
    }
    differences.join("; ")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clap::Parser;
    use playbot_harness::foreign::ForeignGame;
    use playbot_train::experiment::file::parse_experiment;

    use super::*;

    #[derive(Parser)]
    struct Verb {
        #[command(flatten)]
        from: ExperimentArgs,
    }

    fn parsed(words: &[&str]) -> ExperimentArgs {
        Verb::try_parse_from([&["verb"], words].concat()).expect("an experiment").from
    }

    #[test]
    fn a_game_by_its_name_is_the_first_thing_that_is_set() {
        let from = parsed(&["maze2d", "--set", "steps=1"]);
        assert_eq!((from.sets([]).join(" "), from.names_game()), ("game=maze2d steps=1".to_owned(), true));
        let from = parsed(&["--set", "steps=1", "--experiment", "my.ron", "maze2d"]);
        assert_eq!(from.words(), " maze2d --experiment my.ron --set steps=1");
        assert!(!parsed(&["--set", "steps=1"]).names_game());
        assert!(Verb::try_parse_from(["verb", "maze2d", "antmaze"]).is_err(), "one game");
    }

    #[test]
    fn two_games_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("my.ron");
        let text = r#"(game: "maze2d", train: "a:0..3", test: "a:4..7", demos: "d", steps: 10)"#;
        std::fs::write(&path, text).expect("written");
        let file = path.to_str().expect("a path");
        let runner = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let list: [&dyn Game; 1] = [&runner];
        let games = Games::new(&list).expect("one game");
        let refused = |words: &[&str]| parsed(words).check_game(&games).expect_err("two games").to_string();
        let words = refused(&["coinrun", "--set", "game=\"maze2d\""]);
        assert_eq!(words, "`game=coinrun`: `--set` names the game `maze2d`: leave one of them out");
        let words = refused(&["coinrun", "--experiment", file]);
        assert!(words.ends_with("of `maze2d`: leave the game out, or change it with --set game=coinrun"), "{words}");
        for words in
            [&["maze2d", "--experiment", file][..], &["maze2d", "--set", "game=maze2d"], &["--experiment", file]]
        {
            parsed(words).check_game(&games).expect("one game");
        }
    }

    #[test]
    fn each_difference_has_the_option_it_is_from_and_both_values() {
        let text = r#"(game: "g", train: "a:0..3", test: "a:4..7", demos: "d", steps: 10)"#;
        let kept = parse_experiment(text, Path::new("x.ron")).expect("valid");
        let sets = ["seed=7", "skills=(epochs: 3)", "steps=20", "arenas=32"].map(str::to_owned);
        let wanted = kept.with_set(&sets).expect("valid");
        let from = ExperimentArgs { set: sets[1..3].to_vec(), ..Default::default() };
        let own = [("seed", Some("--seed 7".to_owned())), ("algorithm", None)];
        let found = Options { from: &from, own: &own }.differences(&wanted, &kept, "the run", &["steps"]);
        let [arenas, seed, epochs] = &found[..] else { panic!("{found:?}") };
        assert!(arenas.starts_with("the experiment without options asks for arenas=32, and the run has "), "{arenas}");
        assert_eq!(seed, "`--seed 7` asks for seed=7, and the run has 1");
        assert!(
            epochs.starts_with("`--set skills=(epochs: 3)` asks for skills.epochs=3, and the run has "),
            "{epochs}"
        );
        let words = in_words([&found[..], &found[..]].concat());
        assert!(words.matches("; ").count() == 4 && words.ends_with("; and 2 more"), "{words}");
    }
}
