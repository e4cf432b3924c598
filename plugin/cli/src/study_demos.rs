//! The recordings that the runs of a study learn from.

use std::path::PathBuf;

use bevy_playbot::vision::ObservationConfig;
use playbot_lab::{game::Game, games::Games, split::LevelSplit, train::Experiment};
use playbot_learner::Dataset;

use super::{
    error::CliError,
    experiment::ExperimentArgs,
    read_demos::{check_demos, read_demos, read_rollouts},
};

/// Reads recordings, and keeps the last ones for the runs that share them.
pub struct StudyDemos<'a> {
    games: &'a Games<'a>,
    from: &'a ExperimentArgs,
    threads: usize,
    /// What was found to be readable.
    checked: Vec<RecordingsKey>,
    /// What was read last.
    last: Option<(RecordingsKey, Dataset)>,
}

/// What the contents of a dataset depend on, or of what is trained on.
#[derive(PartialEq)]
struct RecordingsKey {
    game: String,
    path: PathBuf,
    /// Levels that must not be among them.
    held_out: LevelSplit,
    observation_config: ObservationConfig,
    /// How many steps at most.
    steps: Option<u64>,
    /// Whether lost episodes are left out.
    wins: bool,
    /// Whether the game's state is wanted beside the pictures.
    with_states: bool,
    /// Whether their rewards are wanted, for which all of them are replayed.
    with_rewards: bool,
}

impl<'a> StudyDemos<'a> {
    pub fn new(games: &'a Games<'a>, from: &'a ExperimentArgs, threads: usize) -> Self {
        Self { games, from, threads, checked: Vec::new(), last: None }
    }

    /// Whether the recordings of an experiment can be read and, with `replays`, replayed; those that were looked at already are
    /// not opened again.
    ///
    /// # Errors
    ///
    /// They cannot be read, belong to another game, show held-out levels, or do not replay.
    pub fn check(&mut self, experiment: &Experiment, replays: bool) -> Result<(), CliError> {
        let key = self.key(experiment)?;
        if self.checked.contains(&key) {
            return Ok(());
        }
        let game = self.games.get(&experiment.game)?;
        match (replays, key.with_rewards) {
            (false, _) => check_demos(game, experiment, &self.from.recordings(experiment, self.games)?)?,
            (true, false) => drop(self.read(game, experiment)?),
            (true, true) => drop(read_rollouts(game, experiment, self.from, self.games, self.threads)?),
        }
        self.checked.push(key);
        Ok(())
    }

    fn key(&self, experiment: &Experiment) -> Result<RecordingsKey, CliError> {
        Ok(RecordingsKey {
            game: experiment.game.clone(),
            path: self.from.find_recordings(experiment.recordings()?, self.games),
            held_out: experiment.test.clone(),
            observation_config: experiment.observation_config(),
            steps: experiment.demo_steps,
            wins: experiment.demo_wins,
            with_states: experiment.skills.tells_states(),
            with_rewards: experiment.algorithm.trains_on_demos(),
        })
    }

    /// The recordings of an experiment.
    ///
    /// # Errors
    ///
    /// They cannot be read, belong to another game, or show held-out levels.
    pub fn read(&mut self, game: &dyn Game, experiment: &Experiment) -> Result<Dataset, CliError> {
        let key = self.key(experiment)?;
        match &self.last {
            Some((known, dataset)) if *known == key => Ok(dataset.clone()),
            _ => {
                let path = self.from.recordings(experiment, self.games)?;
                let dataset = read_demos(game, experiment, &path, self.threads)?;
                self.last = Some((key, dataset.clone()));
                Ok(dataset)
            }
        }
    }
}
