//! Finding and reading experiments, from a path or from those that come with the program, with what the command line
//! changes in them.

use std::{
    fmt::Display,
    path::{Path, PathBuf},
};

use playbot_lab::{
    experiment_text::ExperimentText,
    games::Games,
    train::{
        Experiment,
        config::ExperimentError,
        config_file::{
            ConfigError, locate, parse_experiment, parse_experiment_with, read_experiment_text, read_experiment_with,
        },
        default_experiment::{default_experiment, experiment_of},
    },
};

/// Which experiment, and what to change in it.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct ExperimentArgs {
    /// Experiment file; if none is named, that of the game that `--set game=` names, or else of the program's first game (for
    /// `eval --run` the run's own).
    #[arg(long, value_name = "FILE")]
    pub experiment: Option<PathBuf>,
    /// Change a value of the experiment, such as ppo.lr=0.0003; may be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl ExperimentArgs {
    /// Reads the experiment, changes what `--set` and then what the options with names of their own say, and checks it.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] with file, line and column, or with the `key=value` that does not fit.
    pub fn load(
        &self,
        games: &Games,
        options: impl IntoIterator<Item = Option<String>>,
    ) -> Result<Experiment, ConfigError> {
        let sets = self.sets(options);
        match &self.experiment {
            Some(path) => read_experiment_with(path, &sets),
            None => {
                let ExperimentText { origin, text } = unnamed(games, &sets);
                parse_experiment_with(&text, Path::new(&*origin), &sets)
            }
        }
    }

    /// What went wrong when an experiment that was [loaded](Self::load) met its game, with file, line and column of the key to
    /// blame, or the `key=value` that is.
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

    /// Whether somebody said which game: in an experiment file, or with `--set`.
    pub fn names_game(&self) -> bool {
        self.experiment.is_some() || self.set.iter().any(|set| sets_key(set, "game"))
    }

    /// Where the recordings of an experiment are, see [`find_recordings`](Self::find_recordings). Says so if it is not where
    /// the experiment says.
    ///
    /// # Errors
    ///
    /// The experiment names none.
    pub fn recordings(&self, experiment: &Experiment, games: &Games) -> Result<PathBuf, ExperimentError> {
        let path = experiment.recordings()?;
        let found = self.find_recordings(path, games);
        if found != path {
            tell!("recordings are taken from {}, since there are none at {} here", found.display(), path.display());
        }
        Ok(found)
    }

    /// Where recordings are that an experiment names: as it says, below this folder. Only those of the experiment that
    /// comes with the program are looked for beside it, too, if they are not here, so that `cargo run` works from any folder.
    pub fn find_recordings(&self, path: &Path, games: &Games) -> PathBuf {
        let beside = sources().join(path);
        let is_usual = self.experiment.is_none() && !self.set.iter().any(|set| sets_key(set, "demos"));
        if is_usual && !path.exists() && beside.exists() && is_shipped(path, games) { beside } else { path.into() }
    }

    /// These as they are written behind a verb, with a blank in front of each.
    pub fn words(&self) -> String {
        let experiment =
            self.experiment.iter().map(|path| format!(" --experiment {}", quoted(&path.to_string_lossy())));
        let set = self.set.iter().map(|set| format!(" --set {}", quoted(set)));
        experiment.chain(set).collect()
    }

    /// These, under what is already known of the experiment, as `key=value`.
    pub fn over(&self, known: impl IntoIterator<Item = String>) -> Self {
        Self { experiment: self.experiment.clone(), set: known.into_iter().chain(self.set.iter().cloned()).collect() }
    }

    /// What `--set` and then what the options with names of their own say.
    pub fn sets(&self, options: impl IntoIterator<Item = Option<String>>) -> Vec<String> {
        self.set.iter().cloned().chain(options.into_iter().flatten()).collect()
    }
}

/// The experiment where no file is named: that of the game that `sets` name, since levels and settings of another one would not
/// fit it. A game that does not exist is refused when it is looked for.
fn unnamed(games: &Games, sets: &[String]) -> ExperimentText {
    let named = sets.iter().rev().find(|set| sets_key(set, "game")).and_then(|set| set.split_once('='));
    let game = named.and_then(|(_, name)| games.get(name.trim().trim_matches('"')).ok());
    game.map_or_else(|| default_experiment(games), experiment_of)
}

/// Whether these are the recordings of an experiment that lies in the sources, as nobody has changed it.
fn is_shipped(recordings: &Path, games: &Games) -> bool {
    let ExperimentText { origin, text } = default_experiment(games);
    let is_there = std::fs::read_to_string(sources().join(&*origin)).is_ok_and(|found| found == *text);
    is_there
        && parse_experiment(&text, Path::new(&*origin)).is_ok_and(|usual| usual.demos.as_deref() == Some(recordings))
}

/// Whether a `key=value` sets exactly this key.
pub fn sets_key(set: &str, key: &str) -> bool {
    set.split_once('=').is_some_and(|(name, _)| name.trim() == key)
}

/// A word for the shell.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:".contains(c);
    if word.chars().all(is_plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

/// An option with a name of its own, as `key=value`.
pub fn option<T: Display>(key: &str, value: &Option<T>) -> Option<String> {
    value.as_ref().map(|value| format!("{key}={value}"))
}

/// Where this library's sources were when the program was built. Those of the program lie there only if it was built with
/// them: a game elsewhere has other sources.
fn sources() -> &'static Path {
    let this = Path::new(env!("CARGO_MANIFEST_DIR"));
    this.ancestors().nth(2).unwrap_or(this)
}
