//! Tests of the pipeline as functions: each step uses the result of the one before, and explains its failures.

#![allow(clippy::result_large_err, reason = "errors are looked at here, not handed on")]

use std::path::Path;

use bevy::prelude::*;
use bevy_playbot::demo::file::{DemoFault, DemoReader, DemoWriter};
use playbot::prelude::*;
use playbot_harness::{demo::demonstration::DemonstrationPlan, eval::Player, game::BotTools};
use playbot_learner::{DeviceKind, PolicyFile, SeenLevels};
use playbot_tests::{Corridor, as_corridor};
use playbot_train::{
    Algorithm, Experiment, UpdateReport,
    experiment::file::parse_experiment,
    pipeline,
    pipeline::PipelineError,
    recordings::RecordingsError,
    run_observer::{AfterUpdate, RunEvent, RunObserver, Unobserved},
    train_run::TrainingSetup,
};

const EXPERIMENT: &str = r#"(
    game: "corridor", train: "plain:0..7", test: "plain:8..15",
    steps: 512, arenas: 4, worlds: 2,
    skills: (window: 2, epochs: 4, batch: 8, hidden: [8, 8], encoder_hidden: 8, gru_hidden: 8, latent: 2, lr: 0.003),
    ppo: (num_steps: 32, minibatches: 2, hidden: [8, 8], lr: 0.003),
    sac: (num_steps: 8, batch: 16, learning_starts: 64, hidden: [8, 8], updates_per_step: 0.1),
    rlpd: (critics: 3),
    score: (horizon: 2),
)"#;

/// The corridor with a demonstrator that walks to the exit.
struct Shown;

impl Game for Shown {
    as_corridor!();

    fn tools(&self) -> GameTools<'_> {
        GameTools { bots: self, ..GameTools::default() }
    }
}

impl BotTools for Shown {
    fn demonstrator(&self) -> Option<&'static str> {
        Some("right")
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, _noise: f64) {
        world.entity_mut(agent).insert(BlindBot::Constant(ActionValue::Discrete(1)));
    }
}

fn levels(text: &str) -> LevelSplit {
    text.parse().expect("a split")
}

fn experiment(demos: &Path) -> Experiment {
    let experiment = parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid");
    Experiment { demos: Some(demos.to_owned()), ..experiment }
}

fn setup() -> TrainingSetup<'static> {
    TrainingSetup::new(DeviceKind::Flex, 2)
}

/// Returns the seen levels in a policy file.
fn seen(file: &PolicyFile) -> &[String] {
    &file.metadata.seen.as_ref().expect("noted").levels
}

#[test]
fn the_whole_road_leads_from_a_demonstrator_to_a_policy_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let demos = folder.path().join("right.demo");
    let episodes = pipeline::record(&Shown, &levels("plain:16..35"), 0.1, &demos).expect("recorded");
    let reader = DemoReader::open(&demos).expect("a recording");
    assert_eq!((episodes, reader.header().demonstrator.as_str(), reader.header().action_noise), (20, "right", 0.1));
    let recorded: Vec<u64> = reader.map(|episode| episode.expect("whole").level_seed).collect();
    assert_eq!(recorded, (16..=35).collect::<Vec<u64>>());

    let experiment = experiment(&demos);
    let file = folder.path().join("skills.safetensors");
    let skills = pipeline::learn_skills(&Shown, &experiment, &file, &setup(), &mut Unobserved).expect("learned");
    let mut steps = Vec::new();
    let mut observer = AfterUpdate(|report: &UpdateReport| steps.push(report.step));
    let (run, with_file) = (folder.path().join("run"), Some((file.as_path(), &skills)));
    let trainer = pipeline::train(&Shown, &experiment, with_file, &run, &setup(), &mut observer);
    let trainer = trainer.expect("trained");
    assert_eq!((trainer.is_done(), steps), (true, vec![128, 256, 384, 512]), "one report for each update");

    let file = pipeline::policy(&Shown, &trainer);
    assert_eq!((file.metadata.game.as_str(), file.metadata.algorithm.as_str()), ("corridor", "score-ppo"));
    assert!(file.metadata.training.starts_with("512 steps on plain:0..7"), "{}", file.metadata.training);
    assert!(file.skills.is_some(), "SCORE acts with skills");
    assert_eq!(seen(&file), ["plain:0..7", "plain:16..35"], "what it has played, and what its skills were shown");
    let path = folder.path().join("corridor.policy");
    playbot_train::policy_export::export_policy(&Shown, &file, &experiment.train, 1, &path).expect("written");
    let shipped = PolicyFile::load(&path, DeviceKind::Flex).expect("it answers as it did");

    let measure = |file: &PolicyFile| {
        let player = Player::of_file(file, ActionDraw::Sample);
        pipeline::evaluate(&Shown, &experiment, "learned", &player, file.metadata.seen.as_ref(), 2).expect("measured")
    };
    let measured = measure(&file);
    assert_eq!((measured.method.as_str(), measured.split.as_str()), ("learned", "plain:8..15"));
    assert_eq!(measured.episodes, 8 * u64::from(experiment.eval.episodes_per_level));
    assert_eq!(measure(&shipped), measured, "what is shipped plays as what was trained");
}

#[test]
fn what_chooses_skills_is_shipped_with_what_it_has_learned_of_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let demos = folder.path().join("right.demo");
    pipeline::record(&Shown, &levels("plain:16..35"), 0.1, &demos).expect("recorded");
    for algorithm in [Algorithm::SpirlPpo, Algorithm::Rlpd] {
        let experiment = Experiment { algorithm, ..experiment(&demos) };
        let at = folder.path().join("skills.safetensors");
        let learn = || pipeline::learn_skills(&Shown, &experiment, &at, &setup(), &mut Unobserved).expect("learned");
        let skills = algorithm.needs_skills().then(learn);
        let (run, with_file) =
            (folder.path().join(format!("run-{algorithm}")), skills.as_ref().map(|skills| (at.as_path(), skills)));
        let trainer = pipeline::train(&Shown, &experiment, with_file, &run, &setup(), &mut Unobserved);
        let file = pipeline::policy(&Shown, &trainer.expect("trained"));
        assert_eq!((file.metadata.algorithm.as_str(), file.skills.is_some()), (algorithm.name(), skills.is_some()));
        assert_eq!(seen(&file), ["plain:0..7", "plain:16..35"], "{algorithm}");
        let path = folder.path().join(algorithm.name());
        playbot_train::policy_export::export_policy(&Shown, &file, &experiment.train, 1, &path).expect("written");
        let shipped = PolicyFile::load(&path, DeviceKind::Flex).expect("it answers as it did");
        let measure = |file: &PolicyFile| {
            let player = Player::of_file(file, ActionDraw::Sample);
            pipeline::evaluate(&Shown, &experiment, "learned", &player, file.metadata.seen.as_ref(), 2)
                .expect("measured")
        };
        assert_eq!(measure(&shipped), measure(&file), "{algorithm}: what is shipped plays as what was trained");
    }
}

#[test]
fn held_out_levels_of_a_seen_layout_are_left_out_of_a_measurement() {
    let game = ForeignGame::new("rooms", 1, |_: &mut App| {})
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["nothing"], || [0.0])
        .time_limit(3)
        .layout(|_, level| level % 10);
    let text = r#"(game: "rooms", train: "default:0..3", test: "default:10..20", steps: 1024, algorithm: "ppo")"#;
    let mut experiment = parse_experiment(text, "rooms.ron".as_ref()).expect("valid");
    let seen = |levels: &str| SeenLevels { game: "rooms".into(), levels: vec![levels.into()], ..SeenLevels::default() };
    let measure = |experiment: &Experiment, seen: Option<SeenLevels>| {
        let player = Player::Blind(BlindBot::Uniform);
        let measured = pipeline::evaluate(&game, experiment, "random", &player, seen.as_ref(), 1).expect("measured");
        (measured.levels, measured.left_out, measured.seen, measured.layouts)
    };
    // 10 and 20 have the layout of 0, and 11 to 13 those of 1 to 3.
    assert_eq!(measure(&experiment, Some(seen("default:0..3"))), (6, 5, 0, Some(6)));
    assert_eq!(measure(&experiment, None), (11, 0, 0, Some(10)));
    assert_eq!(measure(&experiment, Some(seen("default:0..9"))), (11, 0, 11, Some(10)), "there are no others");
    experiment.eval.include_seen = true;
    assert_eq!(measure(&experiment, Some(seen("default:0..3"))), (11, 0, 5, Some(10)));
}

#[test]
fn a_number_of_steps_is_recorded_over_the_levels_again_and_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("six.demo");
    let (mode, levels) = ("plain".to_owned(), vec![0, 1]);
    let plan = DemonstrationPlan {
        mode,
        levels,
        noise: 0.0,
        seed: 1,
        steps: Some(6),
        keep_observations: true,
        randomise: Default::default(),
    };
    let writer = DemoWriter::create(&path, plan.header(&Shown)).expect("a fresh file");
    let (mut world, _) = plan.build_world(&Shown, writer);
    while world.resource::<Recorder>().steps() < 6 {
        world.tick().expect("sound");
    }
    let reader = DemoReader::open(&path).expect("a recording");
    let header = reader.header();
    assert_eq!(header.demonstrator, "right");
    assert_eq!(header.observation_names, Corridor.observation().names);
    let recorded: Vec<_> = reader.map(|episode| episode.expect("whole")).collect();
    let recorded: Vec<_> = recorded.iter().map(|episode| (episode.level_seed, episode.len())).collect();
    assert_eq!(recorded, [(0, 2), (1, 3), (0, 1)], "level 0 starts two cells from the exit, level 1 three");
}

#[test]
fn without_skills_plain_ppo_is_trained() {
    let folder = tempfile::tempdir().expect("a folder");
    let experiment = Experiment { algorithm: Algorithm::Ppo, ..experiment(folder.path()) };
    let run = folder.path().join("run");
    let trainer = pipeline::train(&Corridor, &experiment, None, &run, &setup(), &mut Unobserved).expect("trained");
    let file = pipeline::policy(&Corridor, &trainer);
    assert!(file.skills.is_none());
    assert_eq!(seen(&file), ["plain:0..7"]);
}

#[test]
fn each_step_says_what_it_cannot_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.demo");
    let record = |game: &dyn Game, split: &str| pipeline::record(game, &levels(split), 0.0, &path);
    let error = record(&Corridor, "plain:0..1").expect_err("the corridor has no demonstrator");
    assert!(matches!(error, PipelineError::NoDemonstrator("corridor")), "{error}");
    let error = record(&Shown, "plian:0..1").expect_err("no such mode");
    assert!(matches!(error, PipelineError::Mode(_)) && error.to_string().contains("plain"), "{error}");
    assert!(!path.exists(), "no empty recording is left");
    record(&Shown, "plain:8..9").expect("recorded");
    let error = record(&Shown, "plain:0..1").expect_err("it exists");
    assert!(matches!(&error, PipelineError::Demo(error) if matches!(error.fault, DemoFault::Exists)), "{error}");

    let file = folder.path().join("skills.safetensors");
    let learn = |experiment: &Experiment| {
        pipeline::learn_skills(&Shown, experiment, &file, &setup(), &mut Unobserved).map(|_| ())
    };
    let error = learn(&experiment(&path)).expect_err("these levels are held out");
    let is_verify = matches!(&error, PipelineError::Recordings(error) if matches!(**error, RecordingsError::Verify(_)));
    assert!(is_verify && error.to_string().contains("plain:8..15"), "{error}");
    let error = learn(&Experiment { demos: None, ..experiment(&path) }).expect_err("no recordings are named");
    assert!(matches!(error, PipelineError::Experiment(_)), "{error}");

    let elsewhere = Experiment { test: levels("plian:8..15"), ..experiment(&path) };
    let player = Player::Blind(BlindBot::Uniform);
    let error = pipeline::evaluate(&Shown, &elsewhere, "random", &player, None, 1).expect_err("no such mode");
    assert!(matches!(error, PipelineError::Experiment(_)) && error.to_string().contains("plain"), "{error}");
}

/// Stops the work after a number of batches of skills or updates of training.
struct StopAfter(u32);

impl RunObserver for StopAfter {
    fn stopped(&self) -> bool {
        self.0 == 0
    }

    fn observe(&mut self, event: RunEvent<'_>) {
        if matches!(event, RunEvent::SkillBatch | RunEvent::Updated { .. }) {
            self.0 = self.0.saturating_sub(1);
        }
    }
}

#[test]
fn stopped_steps_are_resumed_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let demos = folder.path().join("right.demo");
    pipeline::record(&Shown, &levels("plain:16..35"), 0.1, &demos).expect("recorded");
    let experiment = experiment(&demos);
    let learn = |name: &str, observer: &mut dyn RunObserver| {
        pipeline::learn_skills(&Shown, &experiment, &folder.path().join(name), &setup(), observer)
    };
    let skills = learn("whole.safetensors", &mut Unobserved).expect("learned");
    let error = learn("again.safetensors", &mut StopAfter(3)).expect_err("stopped");
    assert!(matches!(error, PipelineError::Stopped(_)), "{error}");
    learn("again.safetensors", &mut Unobserved).expect("resumed");
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("written");
    assert!(read("whole.safetensors") == read("again.safetensors"), "the same model");

    let train = |name: &str, experiment: &Experiment, observer: &mut dyn RunObserver| {
        let (run, file) = (folder.path().join(name), folder.path().join("whole.safetensors"));
        pipeline::train(&Shown, experiment, Some((&file, &skills)), &run, &setup(), observer)
    };
    train("whole", &experiment, &mut Unobserved).expect("trained");
    let error = train("again", &experiment, &mut StopAfter(2)).err().expect("stopped");
    assert!(matches!(error, PipelineError::Stopped(_)), "{error}");
    assert_eq!(train("again", &experiment, &mut Unobserved).expect("resumed").steps(), 512);
    assert!(read("whole/metrics.jsonl") == read("again/metrics.jsonl"), "the same metrics");
    let other = Experiment { seed: 7, ..experiment.clone() };
    let error = train("again", &other, &mut Unobserved).err().expect("another seed").to_string();
    assert!(error.contains("seed=7 instead of 1"), "{error}");
}
