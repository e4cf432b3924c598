//! Reading of an experiment's recordings, for skills and for training.

use crate::{
    demo::Demonstrations,
    experiment::{Algorithm, Experiment, ExperimentError},
    run_observer::{CountedWork, RecordingsSummary, RunEvent, RunObserver},
};
use bevy_playbot::demo::file::DemoFault;
use playbot_harness::{brief::shell_word, demo::VerifyError, game::Game, level_files::is_level_files};
use playbot_learner::{Dataset, HasExitCode, Rollout, SeenLevels};
use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Failure to read the recordings of an experiment.
#[derive(Debug, Error)]
pub enum RecordingsError {
    /// The experiment does not fit its game.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// There are no recordings.
    #[error("{source}; {advice}")]
    Missing {
        /// The error of the path.
        source: Box<VerifyError>,
        /// The command that makes recordings.
        advice: String,
    },
    /// Recordings that cannot be learned from.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// No recording has a reward.
    #[error(
        "{}: nothing in these recordings is ever rewarded, and {algorithm} learns from their rewards: name recordings that \
         reach the goal, or learn skills from these, with another algorithm", path.display()
    )]
    Unrewarded {
        /// Path of the recordings.
        path: PathBuf,
        /// The algorithm.
        algorithm: Algorithm,
    },
}

impl HasExitCode for RecordingsError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Verify(error) => error.exit_code(),
            Self::Experiment(_) | Self::Missing { .. } | Self::Unrewarded { .. } => 3,
        }
    }
}

/// Recordings to train on.
#[derive(Debug, Default)]
pub struct Recorded {
    /// Their episodes; empty for algorithms that do not train on them.
    pub rollouts: Vec<Rollout>,
    /// The levels that they show.
    pub seen: Option<SeenLevels>,
}

/// Reads recordings for the skill model, and replays those without observations through the sensor.
///
/// # Errors
///
/// The experiment does not go with the game's actions or observations. Or a recording cannot be read, belongs to
/// another game, shows a held-out level or does not replay. Or the pictures would need more memory than is free.
pub fn read_dataset(
    game: &dyn Game,
    experiment: &Experiment,
    path: &Path,
    threads: usize,
    observer: &mut dyn RunObserver,
) -> Result<Dataset, RecordingsError> {
    experiment.check_agent(game)?;
    observer.observe(RunEvent::ReadingRecordings);
    let demos = open(game, experiment, path)?;
    let (bytes, picture_bytes) = (demos.bytes(game), demos.picture_bytes());
    let summary = summary(&demos, experiment, path);
    observer.observe(RunEvent::RecordingsOpened(RecordingsSummary { bytes, picture_bytes, ..summary }));
    let counter = observer.counter(CountedWork::Replay { steps: summary.steps });
    let dataset = demos.dataset(game, threads, counter)?;
    observer.observe(RunEvent::RecordingsRead);
    if dataset.unmasked() > 0 {
        observer.observe(RunEvent::MasksUnknown { episodes: dataset.unmasked(), of: dataset.episodes() });
    }
    Ok(dataset)
}

/// Returns the path where the recordings of an experiment are. `locate` gives it from the path that the experiment
/// names.
///
/// # Errors
///
/// The experiment names no recordings.
pub fn find_recordings(
    experiment: &Experiment,
    locate: &dyn Fn(&Path) -> PathBuf,
    observer: &mut dyn RunObserver,
) -> Result<PathBuf, ExperimentError> {
    let named = experiment.recordings()?;
    let found = locate(named);
    if found != named {
        observer.observe(RunEvent::RecordingsElsewhere { named, found: &found });
    }
    Ok(found)
}

/// Reads recordings with their rewards, if the experiment's algorithm trains on them. All of them are replayed.
/// `locate` gives their path from the one that the experiment names.
///
/// # Errors
///
/// The experiment does not go together, or a recording cannot be read, belongs to another game, shows a held-out level
/// or does not replay.
pub fn read_rollouts(
    game: &dyn Game,
    experiment: &Experiment,
    locate: &dyn Fn(&Path) -> PathBuf,
    threads: usize,
    observer: &mut dyn RunObserver,
) -> Result<Recorded, RecordingsError> {
    if !experiment.algorithm.trains_on_demos() {
        return Ok(Recorded::default());
    }
    experiment.check()?;
    observer.observe(RunEvent::ReadingRecordings);
    let path = find_recordings(experiment, locate, observer)?;
    let demos = open(game, experiment, &path)?;
    let summary = summary(&demos, experiment, &path);
    observer.observe(RunEvent::RecordingsOpened(summary));
    note_other_modes(game, &demos, &experiment.train.mode, observer);
    let seen = Some(demos.seen_levels(game));
    let counter = observer.counter(CountedWork::Replay { steps: summary.steps });
    let rollouts = demos.rollouts(game, threads, counter)?;
    observer.observe(RunEvent::RecordingsRead);
    if !rollouts.is_empty() && !rollouts.iter().any(Rollout::is_rewarded) {
        return Err(RecordingsError::Unrewarded { path, algorithm: experiment.algorithm });
    }
    Ok(Recorded { rollouts, seen })
}

/// Checks that the recordings of an experiment can be read, are of its game, and show no held-out level. Returns the
/// levels that they show. Nothing is replayed.
///
/// # Errors
///
/// As [`read_dataset`], but for the errors of replays.
pub fn check_recordings(game: &dyn Game, experiment: &Experiment, path: &Path) -> Result<SeenLevels, RecordingsError> {
    open(game, experiment, path).map(|demos| demos.seen_levels(game))
}

fn open(game: &dyn Game, experiment: &Experiment, path: &Path) -> Result<Demonstrations, RecordingsError> {
    Demonstrations::of(game, experiment, path).map_err(|error| match is_missing(&error) {
        true => RecordingsError::Missing { advice: advice(game, experiment, path), source: error.into() },
        false => error.into(),
    })
}

/// Returns the summary of recordings without their memory.
fn summary<'a>(demos: &Demonstrations, experiment: &Experiment, path: &'a Path) -> RecordingsSummary<'a> {
    let steps = demos.steps();
    RecordingsSummary {
        path,
        steps,
        episodes: demos.episodes() as u64,
        exceeds_request: experiment.demo_steps.is_some_and(|wanted| wanted < steps),
        observation: experiment.observation_config(),
        bytes: 0,
        picture_bytes: 0,
    }
}

/// Reports recordings of another task than the training, since their rewards are those of their own task. Modes whose
/// levels may be the same, and levels that are files, are of one task.
fn note_other_modes(game: &dyn Game, demos: &Demonstrations, trained: &str, observer: &mut dyn RunObserver) {
    let family = |mode: &str| game.tools().levels.family(mode);
    let is_other = |mode: &&str| !is_level_files(mode) && family(mode) != family(trained);
    let recorded: Vec<_> = demos.modes().into_iter().filter(is_other).collect();
    if !recorded.is_empty() && !is_level_files(trained) {
        observer.observe(RunEvent::OtherModes { recorded: &recorded, trained });
    }
}

fn is_missing(error: &VerifyError) -> bool {
    let VerifyError::File(error) = error else { return false };
    match &error.fault {
        DemoFault::NoDemos => true,
        DemoFault::Io { source, .. } => source.kind() == ErrorKind::NotFound,
        _ => false,
    }
}

/// Returns the command that records training levels, which the experiment keeps apart from the held-out ones.
fn advice(game: &dyn Game, experiment: &Experiment, path: &Path) -> String {
    let (name, levels) = (game.name(), shell_word(&experiment.train.to_string()));
    let file = |name: &str| {
        let is_file = path.extension().is_some_and(|ending| ending == "demo");
        let file = if is_file { path.to_owned() } else { path.join(name) };
        shell_word(&file.display().to_string())
    };
    let rule = format!(
        "; those are the training levels, and any others will do as well, but never the held-out ones, {}. The \
         first lines of an experiment file, or of one that it is built on, may say how its own recordings are made",
        experiment.test
    );
    if game.tools().bots.demonstrator().is_some() {
        let file = file("bot.demo");
        format!(
            "record the game's demonstrator with `playbot record {name} --levels {levels} --steps 200000 --out {file}`{rule}"
        )
    } else if game.tools().input.records_people() {
        let file = file("mine.demo");
        format!("play and record it yourself with `playbot play {name} --levels {levels} --record {file}`{rule}")
    } else {
        "train a policy without them, with `playbot train --algorithm ppo --run runs/first`".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::{App, KeyCode};

    use super::*;
    use crate::experiment::{experiment_of, file::parse_experiment};
    use playbot_harness::foreign::ForeignGame;

    /// Returns the message about missing recordings of a game.
    fn message(game: &dyn Game, path: &Path) -> String {
        let experiment = parse_experiment(&experiment_of(game).text, Path::new("x.ron")).expect("that of the game");
        check_recordings(game, &experiment, path).expect_err("there are no recordings").to_string()
    }

    #[test]
    fn the_command_is_named_that_makes_the_missing_recordings() {
        let folder = tempfile::tempdir().expect("a folder");
        let (empty, file) = (folder.path(), folder.path().join("a.demo"));
        let bare = ForeignGame::new("runner", 1, |_: &mut App| {});
        let played = bare.clone().keys([vec![], vec![KeyCode::Space]]);
        let shown = played.clone().demonstrator("walker", || 0_u32);

        let words = message(&shown, empty);
        let command = "`playbot record runner --levels default:0..63 --steps 200000 --out ";
        assert!(words.contains(command) && words.contains("bot.demo`"), "{words}");
        assert!(words.contains("training levels") && words.contains("held-out ones, default:64..127"), "{words}");
        let words = message(&shown, &file);
        assert!(words.contains("cannot find recordings") && words.contains("a.demo`"), "{words}");
        assert!(!words.contains("bot.demo"), "{words}");
        let words = message(&played, &empty.join("none"));
        let command = "`playbot play runner --levels default:0..63 --record ";
        assert!(words.contains(command) && words.contains("mine.demo`"), "{words}");
        let words = message(&bare, empty);
        assert!(words.contains("`playbot train --algorithm ppo "), "{words}");
    }

    #[test]
    fn recordings_that_are_damaged_are_not_to_be_made_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.demo");
        std::fs::write(&path, "no recording").expect("writable");
        let game = ForeignGame::new("runner", 1, |_: &mut App| {}).demonstrator("walker", || 0_u32);
        let words = message(&game, &path);
        assert!(!words.contains("playbot record"), "{words}");
    }
}
