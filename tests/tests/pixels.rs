//! Learning from pictures, from recordings to policy files.

use std::path::Path;

use bevy_playbot::policy_file::check_policy;
use bevy_playbot::{
    bot::BlindBot,
    demo::{
        file::{DemoHeader, DemoWriter},
        recorder::demo_actions,
    },
    policy_file::{PolicyMisfit, policy_observation},
    vision::{ImageOptions, ObservationConfig, ObservationKind, VisionError},
};
use playbot_lab::prelude::*;
use playbot_lab::{
    demo::dataset::Demonstrations,
    eval::{EpisodeResult, EvalPlan, Player, evaluate},
    policy_export::{export_policy, policy_file},
    train::{
        Algorithm, Experiment, Learner, Trainer,
        checkpoint::Which,
        collect::Collector,
        config_file::parse_experiment,
        run_dir::{RunDir, RunInfo},
        trainer::TrainError,
    },
    worlds::{build_observing_world, build_world},
};
use playbot_learner::{
    DeviceKind, ObsKind, Observations, Policy, PolicyFile, PolicySpec, PpoLearner, SkillModel, SkillTrainer,
};
use playbot_tests::{Corridor, PaintedCorridor};

const EXPERIMENT: &str = r#"(
    game: "corridor", train: "plain:0..7", test: "plain:8..15", demos: "unused",
    observation: Raster, image: (width: 16, height: 16, stack: 4, grayscale: true),
    steps: 1536, arenas: 8, worlds: 2,
    skills: (window: 3, epochs: 3, batch: 16, hidden: [16], gru_hidden: 8, latent: 2, lr: 0.003,
        cnn: Impala(channels: [4], feature: 16)),
    ppo: (num_steps: 32, minibatches: 4, hidden: [16], lr: 0.003, cnn: Impala(channels: [4], feature: 16)),
    score: (horizon: 3),
)"#;

fn experiment() -> Experiment {
    parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid")
}

/// Recordings of a random walker, on levels that are not held out, with one episode that is there twice.
fn record(folder: &Path) {
    let header = DemoHeader::new("corridor", 3, "plain", 10.0, demo_actions(&ActionSpace::Discrete(3)));
    for (name, seed) in [("a.demo", 5), ("b.demo", 6), ("c.demo", 6)] {
        let (mut world, agents) = build_world(&Corridor, "plain", seed, 0, 1);
        world.insert_resource(Recorder::new(DemoWriter::create(folder.join(name), header.clone()).expect("fresh")));
        let levels: Vec<u64> = (20..44).collect();
        let queue = LevelQueue::list(levels);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, Recording::default(), queue));
        while world.get::<Control>(agents[0]).is_some_and(|control| control.is_active()) {
            world.tick().expect("sound");
        }
    }
}

fn demonstrations(folder: &Path, sight: &ObservationConfig) -> Demonstrations {
    let test = experiment().test;
    Demonstrations::read(&PaintedCorridor, sight, folder, Some(&test)).expect("readable")
}

/// A skill model that has seen the recordings of `folder`.
fn skills(folder: &Path) -> SkillModel {
    let (config, sight) = (experiment().skills, experiment().sight());
    let dataset = demonstrations(folder, &sight).dataset(&PaintedCorridor, 2, |_| {}).expect("replays");
    let epochs = config.epochs;
    let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("valid");
    for _ in 0..epochs {
        trainer.train_epoch(&mut |_| std::ops::ControlFlow::Continue(())).expect("learns");
    }
    let path = folder.join("skills.safetensors");
    trainer.into_model().with_picture(sight.card()).save(&path).expect("writable");
    SkillModel::load(&path, DeviceKind::Flex).expect("as written")
}

fn trainer(algorithm: Algorithm, skills: &SkillModel, threads: usize) -> Trainer {
    let skills = algorithm.needs_skills().then_some(skills);
    let experiment = Experiment { algorithm, ..experiment() };
    Trainer::new(&PaintedCorridor, &experiment, skills, DeviceKind::Flex, threads).expect("fits")
}

/// Trains in `folder` to the end or until so many updates are done, and saves.
fn train(folder: &Path, mut trainer: Trainer, stop_after: Option<u64>) -> Trainer {
    let Experiment { algorithm, seed, .. } = *trainer.experiment();
    let (version, revision) = ("test".to_owned(), "test".to_owned());
    let device = DeviceKind::Flex;
    let info = RunInfo { algorithm, seed, version, revision, game_version: 3, skills: None, device };
    let run = match folder.exists() {
        true => RunDir::open(folder).expect("a run").0,
        false => RunDir::create(folder, trainer.experiment(), &info, false).expect("writable"),
    };
    while !trainer.is_done() && stop_after.is_none_or(|updates| trainer.updates() < updates) {
        let report = trainer.update().expect("learns");
        run.log(&report, trainer.experiment().steps_per_update()).expect("writable");
    }
    run.save(&mut trainer).expect("writable");
    trainer
}

fn bytes(folder: &Path) -> Vec<Vec<u8>> {
    let last = RunDir::open(folder).expect("a run").0.checkpoint(Which::Last).expect("saved");
    [folder.join("metrics.jsonl"), last.learner_file(), last.arenas_file()]
        .into_iter()
        .map(|path| std::fs::read(path).expect("written"))
        .collect()
}

fn measure(policy: &Policy, prior: Option<SkillPrior>, threads: usize) -> Vec<EpisodeResult> {
    let (split, sight) = ("plain:8..15".parse().expect("a split"), experiment().sight());
    let plan = EvalPlan { split, sight, episodes_per_level: 3, seed: 7, arenas: 4, worlds: 2, threads };
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

    let (run, experiment, info) = RunDir::open(&run).expect("a run");
    let saved = run.checkpoint(Which::Last).expect("saved").learner_file();
    let learner = Learner::load(info.algorithm, &saved, DeviceKind::Flex).expect("as written");
    let (path, about) = (folder.path().join("eyes.policy"), [(); 3].map(|()| "test".to_owned()).into());
    let file = policy_file(&PaintedCorridor, &experiment.sight(), learner.policy(), learner.skills(), about);
    export_policy(&PaintedCorridor, &file, &experiment.train, 1, &path).expect("writable");
    let read = PolicyFile::load(&path, DeviceKind::Flex).expect("as written");
    check_policy(&PaintedCorridor.card(), &read).expect("fits");
    assert_eq!(policy_observation(&read), Ok(experiment.sight()));
    let prior = read.skills.as_ref().map(SkillPrior::from);
    assert_eq!(measure(&read.policy, prior, 2), results, "the file plays another game");

    let error = check_policy(&Corridor.card(), &read).expect_err("cannot be drawn");
    assert!(matches!(error, PolicyMisfit::Vision { error: VisionError::NoPicture { .. }, .. }), "{error}");
}

#[test]
fn pictures_show_enough_to_learn_the_corridor() {
    let mut experiment = experiment();
    experiment.algorithm = Algorithm::Ppo;
    experiment.image.stack = 1;
    experiment.steps = 8192;
    let mut trainer = Trainer::new(&PaintedCorridor, &experiment, None, DeviceKind::Flex, 2).expect("fits");
    let mut last = None;
    while !trainer.is_done() {
        last = trainer.update().expect("learns").success_rate;
    }
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
        assert!(bytes(&one) == bytes(&two), "{algorithm}: one thread and two threads differ");
        train(&halved, trainer(algorithm, &skills, 2), Some(3));
        let (run, experiment, _) = RunDir::open(&halved).expect("readable");
        let resumed = run.resume(&PaintedCorridor, &experiment, DeviceKind::Flex, 2).expect("a checkpoint");
        train(&halved, resumed, None);
        assert!(bytes(&one) == bytes(&halved), "{algorithm}: stopping in the middle changed the result");
    }
}

/// An untrained policy of pictures.
fn untrained(sight: &ObservationConfig) -> Policy {
    let config = experiment().ppo;
    let spec = PolicySpec { obs: sight.image.obs_kind(), latent: 0, action_space: PaintedCorridor.actions() };
    PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("valid").policy()
}

#[test]
fn what_an_agent_sees_does_not_depend_on_who_is_beside_it() {
    let (sight, levels) = (experiment().sight(), experiment().train);
    let policy = untrained(&sight);
    let play = |first, count| {
        let mut collector = Collector::new(&PaintedCorridor, &levels, &sight, 1, first, count, None).expect("fits");
        // The state after the first rollout is looked at twice.
        let parts = [19, 45].map(|steps| collector.collect(&policy, 0, steps).expect("sound").0);
        let rows = parts.map(|part| {
            let width = part.obs_kind.numbers();
            move |agent: usize| {
                let row = |t: usize| part.obs.row(t * part.envs + agent, width);
                let mut rows = Observations::empty(&part.obs_kind);
                (0..part.steps).for_each(|t| rows.push(row(t)).expect("one kind"));
                (rows, part.truncated.iter().any(|cut| *cut))
            }
        });
        move |agent: usize| rows.each_ref().map(|of| of(agent))
    };
    let together = play(0, 4);
    for agent in 0..4 {
        let (alone, beside) = (play(agent, 1)(0), together(agent as usize));
        for (alone, beside) in alone.iter().zip(&beside) {
            assert!(alone.0 == beside.0, "agent {agent} sees something else alone");
        }
        assert!(beside.iter().any(|(_, cut)| *cut), "time has to run out for somebody, or nothing is tested");
    }
}

#[test]
fn recordings_show_the_same_pictures_whoever_replays_them() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let sight = experiment().sight();
    let read = || demonstrations(folder.path(), &sight);
    assert_eq!((read().episodes(), read().picture_bytes()), (72, read().steps() * 16 * 16 * 4));
    let steps = std::sync::atomic::AtomicU64::new(0);
    let count = |n| {
        steps.fetch_add(n, std::sync::atomic::Ordering::Relaxed);
    };
    let one = read().dataset(&PaintedCorridor, 1, count).expect("replays");
    assert_eq!(one.observation(), sight.image.obs_kind());
    assert_eq!(steps.load(std::sync::atomic::Ordering::Relaxed), one.steps() as u64, "progress ends at the end");
    assert!(one == read().dataset(&PaintedCorridor, 3, |_| {}).expect("replays"), "threads");
    // The recordings b and c are the same game.
    let part = |name: &str| {
        let demos = demonstrations(&folder.path().join(name), &sight);
        demos.dataset(&PaintedCorridor, 1, |_| {}).expect("replays")
    };
    assert!(part("b.demo") == part("c.demo") && part("a.demo") != part("b.demo"));
}

#[test]
fn a_part_of_the_recordings_is_spread_over_all_of_them() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let read = || demonstrations(folder.path(), &experiment().sight());
    let all = read().steps();
    let half = read().at_most(all / 2);
    assert!(half.steps() <= all / 2 && half.steps() > all / 3, "{} of {all}", half.steps());
    assert_eq!(read().at_most(1).episodes(), 1, "at least one");
    assert_eq!(read().at_most(all).episodes(), 72);
}

#[test]
fn pictures_without_end_are_refused_before_anything_is_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let image = ImageOptions { width: 1024, height: 1024, stack: 16, ..ImageOptions::default() };
    let sight = ObservationConfig { kind: ObservationKind::Raster, image };
    let demos = demonstrations(folder.path(), &sight);
    let error = demos.dataset(&PaintedCorridor, 1, |_| {}).expect_err("too large").to_string();
    for words in ["GiB", "`demo_steps`", "1024×1024 colour pictures of the raster, 16 in a stack"] {
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn eyes_that_do_not_fit_are_refused_with_a_way_out() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let skills = skills(folder.path());
    let refuse = |change: fn(&mut Experiment), game: &dyn Game| {
        let mut experiment = experiment();
        change(&mut experiment);
        let made = Trainer::new(game, &experiment, Some(&skills), DeviceKind::Flex, 1);
        made.err().expect("must be refused")
    };
    for (change, words) in [
        ((|e| e.observation = ObservationKind::Vector) as fn(&mut Experiment), "say vectors"),
        (|e| e.observation = ObservationKind::Camera, "pictures of the camera"),
        (|e| (e.image.stack, e.image.grayscale) = (2, false), "16×16 colour pictures of the raster, 2 in a stack"),
        (|e| e.image.paint_velocity = true, "with painted velocity"),
    ] {
        let error = refuse(change, &PaintedCorridor);
        assert!(matches!(error, TrainError::SkillObservation { .. }), "{error}");
        let text = error.to_string();
        assert!(text.contains(words) && text.contains("playbot learn-skills"), "{text}");
    }
    let error = refuse(|_| {}, &Corridor);
    assert!(matches!(error, TrainError::Vision(VisionError::NoPicture { game: "corridor" })), "{error}");
    let error = refuse(|e| e.image.width = 0, &PaintedCorridor).to_string();
    assert!(error.contains("width is 0"), "{error}");
}

#[test]
fn a_policy_says_which_eyes_it_needs() {
    let sight = experiment().sight();
    let vectors = PolicySpec { obs: ObsKind::Vector(2), latent: 0, action_space: PaintedCorridor.actions() };
    let vectors = PpoLearner::new(experiment().ppo, vectors, 1, DeviceKind::Flex).expect("valid").policy();
    let colour = ObservationConfig { image: ImageOptions { grayscale: false, ..sight.image }, ..sight };
    for (policy, sight, words) in [
        (
            untrained(&sight),
            ObservationConfig::default(),
            ["images of 4 channels", "gives 2 observation values", "a sensor that makes"],
        ),
        (vectors, sight, ["made for 2 observation values", "gives images of 4 channels", "`VectorSensor`"]),
        (untrained(&colour), sight, ["images of 12 channels", "gives images of 4 channels", "`ImageOptions`"]),
    ] {
        let (mut world, agents) = build_observing_world(&PaintedCorridor, "plain", &sight, 0, 0, 1).expect("drawable");
        world.insert_resource(ActivePolicy { policy, draw: ActionDraw::Sample });
        world.entity_mut(agents[0]).insert(Control::Policy);
        let fault = world.tick().expect_err("does not fit").to_string();
        assert!(words.iter().all(|words| fault.contains(words)), "{fault}");
    }
}
