//! Training and its files, for tests that compare one run with another.

use std::path::Path;

use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_learner::{DeviceKind, Learner as _, Policy, PolicySpec, PpoConfig, PpoLearner, SkillModel};
use playbot_train::{
    Experiment, Trainer,
    checkpoint::CheckpointChoice,
    learn_skills::learn,
    recordings::read_dataset,
    run_dir::{OpenedRun, RunDir, RunInfo},
    run_observer::Unobserved,
};

/// Learns the skill model of an experiment from its recordings, without a file.
pub fn learn_skills(game: &dyn Game, experiment: &Experiment, threads: usize) -> SkillModel {
    let path = experiment.recordings().expect("recordings are named");
    let dataset = read_dataset(game, experiment, path, threads, &mut Unobserved).expect("readable");
    let learned = learn(&experiment.with_sets(game), dataset, DeviceKind::Flex, None, &mut Unobserved).expect("learns");
    learned.expect("not stopped")
}

/// Returns the metadata of a run of this experiment.
pub fn run_info(experiment: &Experiment) -> RunInfo {
    RunInfo {
        algorithm: experiment.algorithm,
        seed: experiment.seed,
        version: "test".into(),
        revision: "test".into(),
        game_version: 1,
        skills: None,
        seen: None,
        begun_from: None,
        observed: Vec::new(),
        device: DeviceKind::Flex,
    }
}

/// Trains to the end, or until so many updates are done, and saves. Existing work in the folder is resumed.
pub fn train(folder: &Path, mut trainer: Trainer, stop_after: Option<u64>) -> Trainer {
    let run = match folder.exists() {
        true => RunDir::open(folder).expect("a run").run,
        false => RunDir::create(folder, trainer.experiment(), &run_info(trainer.experiment()), false).expect("fresh"),
    };
    while !trainer.is_done() && stop_after.is_none_or(|updates| trainer.updates() < updates) {
        let report = trainer.update().expect("learns");
        run.log(&report, trainer.experiment().steps_per_update()).expect("writable");
    }
    run.save(&mut trainer).expect("writable");
    trainer
}

/// Trains to the end without saving, and returns the success rate of the last update, if episodes have ended by then.
pub fn last_success_rate(mut trainer: Trainer) -> Option<f64> {
    let mut last = None;
    while !trainer.is_done() {
        last = trainer.update().expect("learns").success_rate;
    }
    last
}

/// Returns the files of a run: its metrics, and learner and arenas of its last checkpoint.
pub fn written(folder: &Path) -> [Vec<u8>; 3] {
    let last = RunDir::open(folder).expect("a run").run.checkpoint(CheckpointChoice::Last).expect("saved");
    [folder.join("metrics.jsonl"), last.learner_file(), last.arenas_file()]
        .map(|path| std::fs::read(path).expect("written"))
}

/// Trains a game to its end, once in one go and once stopped after so many updates and resumed: both must write the
/// same bytes. `fresh` makes a trainer for a number of threads.
pub fn check_resuming(game: &dyn Game, fresh: impl Fn(usize) -> Trainer, stop_after: u64) {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, halved) = (folder.path().join("whole"), folder.path().join("halved"));
    train(&whole, fresh(2), None);
    train(&halved, fresh(1), Some(stop_after));
    let OpenedRun { run, experiment, .. } = RunDir::open(&halved).expect("readable");
    let resumed = run.resume(game, &experiment, DeviceKind::Flex, 2).expect("a checkpoint that replays");
    assert_eq!(resumed.updates(), stop_after);
    train(&halved, resumed, None);
    let is_same = written(&whole) == written(&halved);
    assert!(is_same, "{}, {}: stopping in the middle changed the result", game.name(), experiment.algorithm);
}

/// Returns an untrained policy, whose critic has values all the same.
pub fn untrained(game: &dyn Game, observation_config: &ObservationConfig, config: PpoConfig) -> Policy {
    let spec = PolicySpec { obs: observation_config.obs_kind(game), latent: 0, action_space: game.actions() };
    PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("valid").policy()
}
