//! Reading recordings with a progress bar: what skills are learned from, and what is trained on.

use std::path::Path;

use playbot_lab::{
    demo::dataset::Demonstrations, game::Game, games::Games, level_files::is_level_files, train::Experiment,
};
use playbot_learner::{Dataset, Rollout, SeenLevels};

use super::{
    error::CliError, experiment::ExperimentArgs, interrupt::NothingToSave, missing_demos, number::counted, progress,
};

/// Reads recordings, replaying them through the sensor where they keep no observations. Says first how much memory
/// pictures will take. Ctrl-C ends the program: nothing is left of replays.
///
/// # Errors
///
/// The experiment does not go with the game's actions or observations, a recording cannot be read, belongs to another game, shows a
/// held-out level or does not replay, or the pictures would need more memory than is free.
pub fn read_demos(game: &dyn Game, experiment: &Experiment, path: &Path, threads: usize) -> Result<Dataset, CliError> {
    experiment.check_agent(game)?;
    let _replaying = NothingToSave::listen();
    let demos = demonstrations(game, experiment, path)?;
    let observation_config = experiment.observation_config();
    let (steps, gib) = (demos.steps(), |bytes: u64| bytes as f64 / f64::from(1 << 30));
    match (demos.bytes(game), demos.picture_bytes()) {
        (0, _) => tell!(),
        (bytes, pictures) if bytes == pictures => tell!(": {observation_config} take {:.2} GiB", gib(bytes)),
        (bytes, _) => tell!(": {observation_config} and the states that they show take {:.2} GiB", gib(bytes)),
    }
    let bar = progress::bar("replay recordings", steps, "steps");
    let dataset = demos.dataset(game, threads, |steps| bar.inc(steps));
    bar.finish_and_clear();
    Ok(dataset?)
}

/// Recordings that are trained on.
#[derive(Default)]
pub struct Recorded {
    /// Their episodes; none for what trains on none.
    pub rollouts: Vec<Rollout>,
    /// The levels that they show.
    pub seen: Option<SeenLevels>,
}

/// The recordings of an experiment with their rewards, if its algorithm trains on them: all of them are replayed.
///
/// # Errors
///
/// The experiment does not go together, or a recording cannot be read, belongs to another game, shows a held-out level or
/// does not replay.
pub fn read_rollouts(
    game: &dyn Game,
    experiment: &Experiment,
    from: &ExperimentArgs,
    games: &Games,
    threads: usize,
) -> Result<Recorded, CliError> {
    if !experiment.algorithm.trains_on_demos() {
        return Ok(Recorded::default());
    }
    experiment.check()?;
    let _replaying = NothingToSave::listen();
    let path = from.recordings(experiment, games)?;
    let demos = demonstrations(game, experiment, &path)?;
    tell!();
    tell_other_modes(game, &demos, &experiment.train.mode);
    let seen = Some(demos.seen_levels(game));
    let bar = progress::bar("replay recordings", demos.steps(), "steps");
    let rollouts = demos.rollouts(game, threads, |steps| bar.inc(steps));
    bar.finish_and_clear();
    let rollouts = rollouts?;
    if !rollouts.is_empty() && !rollouts.iter().any(Rollout::is_rewarded) {
        let (algorithm, path) = (experiment.algorithm, path.display());
        return Err(CliError::Usage(format!(
            "{path}: nothing in these recordings is ever rewarded, and {algorithm} learns from their rewards: name recordings that \
             reach the goal, or learn skills from these, with another algorithm"
        )));
    }
    Ok(Recorded { rollouts, seen })
}

/// Says if recordings are of another task than what is trained: they earn what theirs pays. Modes whose levels may be the same, and
/// levels that are files, are of one task.
fn tell_other_modes(game: &dyn Game, demos: &Demonstrations, trained: &str) {
    let is_other = |mode: &&str| !is_level_files(mode) && game.family(mode) != game.family(trained);
    let others: Vec<_> = demos.modes().into_iter().filter(is_other).collect();
    if !others.is_empty() && !is_level_files(trained) {
        tell!(
            "some recordings are of {}, and {trained} is trained: they earn what their own mode pays, which may be for something else",
            others.join(", ")
        );
    }
}

/// Whether the recordings of an experiment can be read, are of its game, and show no held-out level. Nothing is replayed.
///
/// # Errors
///
/// As [`read_demos`], but for what only a replay finds.
pub fn check_demos(game: &dyn Game, experiment: &Experiment, path: &Path) -> Result<(), CliError> {
    opened(game, experiment, path).map(drop)
}

fn opened(game: &dyn Game, experiment: &Experiment, path: &Path) -> Result<Demonstrations, CliError> {
    Demonstrations::of(game, experiment, path).map_err(|error| missing_demos::explain(error, game, experiment, path))
}

/// Opens recordings and begins to say what there is in them.
fn demonstrations(game: &dyn Game, experiment: &Experiment, path: &Path) -> Result<Demonstrations, CliError> {
    let demos = opened(game, experiment, path)?;
    let (steps, episodes) = (demos.steps(), demos.episodes() as u64);
    begin_to_tell!("{} in {} from {}", counted(steps, "step"), counted(episodes, "episode"), path.display());
    if experiment.demo_steps.is_some_and(|wanted| wanted < steps) {
        begin_to_tell!(" (more than was asked for: episodes are kept whole)");
    }
    Ok(demos)
}
