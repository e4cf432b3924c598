//! Tests of runs, their files and their results.

use bevy_playbot::{
    engine::policy_observation,
    policy_file::{PolicyMisfit, check_policy},
};
use playbot::prelude::*;
use playbot_harness::eval::{EpisodeResult, EvalPlan, Player, evaluate};
use playbot_learner::{DeviceKind, Policy, PolicyFile, SkillModel};
use playbot_tests::{
    Corridor, PaintedCorridor,
    measuring::plan,
    training::{last_success_rate, train, written},
};
use playbot_train::{
    Algorithm, Experiment, TrainedLearner, Trainer,
    checkpoint::CheckpointChoice,
    policy_export::{Provenance, export_policy, policy_file},
    run_dir::{OpenedRun, RunDir},
};

use super::corridor::{experiment, record, skills};

fn trainer(algorithm: Algorithm, skills: &SkillModel, threads: usize) -> Trainer {
    let skills = algorithm.needs_skills().then_some(skills);
    let experiment = Experiment { algorithm, ..experiment() };
    Trainer::new(&PaintedCorridor, &experiment, skills, DeviceKind::Flex, threads).expect("fits")
}

fn measure(policy: &Policy, prior: Option<SkillPrior>, threads: usize) -> Vec<EpisodeResult> {
    let observation_config = experiment().observation_config();
    let plan = EvalPlan { observation_config, episodes_per_level: 3, seed: 7, threads, ..plan("plain:8..15") };
    let player = Player::Policy { policy: policy.clone(), prior, draw: ActionDraw::Sample };
    evaluate(&PaintedCorridor, &player, &plan, |_| {}).expect("fits")
}

#[test]
fn what_is_learned_from_pictures_survives_its_files() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let skills = skills(folder.path());
    let mut trainer = trainer(Algorithm::ScorePpo, &skills, 2);
    assert_eq!(trainer.update().expect("learns").initial_kl, Some(0.0), "the first policy is the decoder");
    let run = folder.path().join("run");
    let trainer = train(&run, trainer, None);
    let results = measure(&trainer.policy(), trainer.skill_prior(), 2);
    assert_eq!(results.len(), 24);
    assert_eq!(results, measure(&trainer.policy(), trainer.skill_prior(), 1), "threads");

    let OpenedRun { run, experiment, info } = RunDir::open(&run).expect("a run");
    let saved = run.checkpoint(CheckpointChoice::Last).expect("saved").learner_file();
    let learner = TrainedLearner::load(info.algorithm, &saved, DeviceKind::Flex).expect("as written");
    let (path, about) = (folder.path().join("pixels.policy"), Provenance::default());
    let file =
        policy_file(&PaintedCorridor, &experiment.observation_config(), learner.policy(), learner.skills(), about);
    export_policy(&PaintedCorridor, &file, &experiment.train, 1, &path).expect("writable");
    let read = PolicyFile::load(&path, DeviceKind::Flex).expect("as written");
    check_policy(&PaintedCorridor.metadata(), &read).expect("fits");
    assert_eq!(policy_observation(&read), Ok(experiment.observation_config()));
    let prior = read.skills.as_ref().map(SkillPrior::from);
    assert_eq!(measure(&read.policy, prior, 2), results, "the file plays another game");

    let error = check_policy(&Corridor.metadata(), &read).expect_err("cannot be drawn");
    assert!(matches!(error, PolicyMisfit::NoPicture { .. }), "{error}");
}

#[test]
fn pictures_show_enough_to_learn_the_corridor() {
    let mut experiment = experiment();
    experiment.algorithm = Algorithm::Ppo;
    experiment.image.stack = 1;
    experiment.steps = 8192;
    let trainer = Trainer::new(&PaintedCorridor, &experiment, None, DeviceKind::Flex, 2).expect("fits");
    let last = last_success_rate(trainer);
    assert!(last.expect("episodes ended") > 0.9, "success rate {last:?}; a random walker has about 0.3");
}

#[test]
fn stopping_and_threads_change_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let skills = skills(folder.path());
    for algorithm in [Algorithm::ScorePpo, Algorithm::Ppo] {
        let run = |name: &str| folder.path().join(format!("{algorithm}-{name}"));
        let (one, two, halved) = (run("1"), run("2"), run("halved"));
        train(&one, trainer(algorithm, &skills, 1), None);
        train(&two, trainer(algorithm, &skills, 2), None);
        assert!(written(&one) == written(&two), "{algorithm}: one thread and two threads differ");
        train(&halved, trainer(algorithm, &skills, 2), Some(3));
        let OpenedRun { run, experiment, .. } = RunDir::open(&halved).expect("readable");
        let resumed = run.resume(&PaintedCorridor, &experiment, DeviceKind::Flex, 2).expect("a checkpoint");
        train(&halved, resumed, None);
        assert!(written(&one) == written(&halved), "{algorithm}: stopping in the middle changed the result");
    }
}
