//! Runs that begin with other runs, from their folders.

use super::*;
use crate::{
    experiment::file::parse_experiment,
    imitate::Imitation,
    run_observer::RunObserver,
    train_run::{NewRun, Training, TrainingError, TrainingSetup},
};
use bevy::prelude::*;
use bevy_playbot::prelude::*;
use playbot_harness::foreign::{ForeignGame, LevelSeed};
use playbot_learner::{Actions, Dataset, DatasetEpisode, SkillTrainer};

struct Quiet;

impl RunObserver for Quiet {}

#[derive(Resource, Default)]
struct Place(i32);

/// Returns the cell of the goal.
fn side(level: &LevelSeed) -> i32 {
    if level.0.is_multiple_of(2) { 4 } else { -4 }
}

/// A walk along a line of 9 cells from the middle, to the right end in even levels and to the left one in odd levels, with
/// these observed values.
fn line(names: &'static [&'static str]) -> ForeignGame {
    let plugin = |app: &mut App| {
        app.init_resource::<Place>().add_systems(
            Update,
            |keys: Res<ButtonInput<KeyCode>>, mut place: ResMut<Place>| {
                place.0 += i32::from(keys.pressed(KeyCode::ArrowRight)) - i32::from(keys.pressed(KeyCode::ArrowLeft));
            },
        );
    };
    ForeignGame::new("line", 1, plugin)
        .keys([vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
        .level(|mut place: ResMut<Place>| place.0 = 0)
        .observe(names.iter().copied(), move |place: Res<Place>, level: Res<LevelSeed>| {
            let value = |name: &&str| match *name {
                "place" => place.0 as f32 / 4.0,
                "side" => side(&level) as f32 / 4.0,
                _ => place.0 as f32 + 0.5,
            };
            names.iter().map(value).collect::<Vec<f32>>()
        })
        .end(move |place: Res<Place>, level: Res<LevelSeed>| {
            (place.0.abs() >= 4).then_some(EpisodeEnd::Terminated { success: place.0 == side(&level) })
        })
        .demonstrator("walker", move |level: Res<LevelSeed>| u32::from(side(&level) > 0))
        .time_limit(40)
}

fn experiment(changes: &str) -> Experiment {
    let text = format!(
        r#"(game: "line", train: "default:0..9", test: "default:100..109", steps: 256, arenas: 8, worlds: 2, algorithm: "ppo",
        ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8], norm_obs: true), {changes})"#
    );
    parse_experiment(&text, Path::new("x.ron")).expect("valid")
}

fn setup() -> TrainingSetup<'static> {
    TrainingSetup::new(DeviceKind::Flex, 1)
}

fn begin(
    game: &ForeignGame,
    experiment: &Experiment,
    path: &Path,
    from: Option<BeginFrom<'_>>,
) -> Result<Training, TrainingError> {
    let new = NewRun { path, experiment, skills: None, skill_file: None, from, force: false };
    Training::begin(game, &new, &setup(), &mut Quiet)
}

/// Trains the short observation in a new folder `old`.
fn old(folder: &Path) -> PathBuf {
    let path = folder.join("old");
    let mut training = begin(&line(&["place", "side"]), &experiment(""), &path, None).expect("it fits");
    assert!(training.drive(&mut Quiet).expect("it trains"));
    path
}

#[test]
fn values_that_a_game_adds_in_the_middle_are_found_by_their_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = old(folder.path());
    let wide = line(&["extra", "place", "more", "side"]);
    let child = folder.path().join("child");
    let training =
        begin(&wide, &experiment("seed: 2"), &child, Some(BeginFrom::new(&path))).expect("it has more values");
    let report = training.started.as_ref().and_then(|started| started.report.clone()).expect("a policy");
    assert!(report.is_same_policy && report.new_inputs == 2, "{report}");
    let opened = RunDir::open(&path).expect("a run");
    let last = opened.run.checkpoint(CheckpointChoice::Last).expect("trained");
    let learner = TrainedLearner::load(Algorithm::Ppo, &last.learner_file(), DeviceKind::Flex).expect("readable");
    for (place, side) in [(0.0, 1.0), (0.25, -1.0), (-0.75, 1.0)] {
        let new = training.trainer.policy().forward(&[], &[9.0, place, -3.5, side], 1).expect("finite");
        assert_eq!(new, learner.policy().forward(&[], &[place, side], 1).expect("finite"));
    }
}

#[test]
fn ancestry_is_kept_over_generations() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, child, grandchild) = (old(folder.path()), folder.path().join("child"), folder.path().join("grandchild"));
    let game = line(&["place", "side"]);
    let mut training =
        begin(&game, &experiment("seed: 2"), &child, Some(BeginFrom { moments: true, ..BeginFrom::new(&path) }))
            .expect("it fits");
    assert!(training.drive(&mut Quiet).expect("it trains"));
    drop(training);
    begin(&game, &experiment("seed: 3"), &grandchild, Some(BeginFrom::new(&child))).expect("it fits");
    let info = RunDir::open(&grandchild).expect("a run").info;
    assert_eq!(info.observed, ["place", "side"]);
    let ancestor = info.begun_from.expect("noted");
    let chain: Vec<_> = ancestor.chain().map(|run| (run.run.clone(), run.step, run.algorithm)).collect();
    assert_eq!(chain, [(child.clone(), 256, Some(Algorithm::Ppo)), (path.clone(), 256, Some(Algorithm::Ppo))]);
    let opened = RunDir::open(&child).expect("a run");
    let file = opened.run.checkpoint(CheckpointChoice::Last).expect("trained").learner_file();
    assert_eq!(ancestor.checksum, file_checksum(&file).ok());
    let seen = info.seen.expect("known");
    assert_eq!(seen.levels, ["default:0..9"]);
}

/// Returns a skill model of made-up recordings, whose values are called `place` and `side`.
fn skills(experiment: &Experiment) -> SkillModel {
    let episode = |number: u16| DatasetEpisode {
        observations: (0..24).map(|at| f32::from((at * 5 + number) % 7) / 7.0).collect::<Vec<f32>>().into(),
        actions: Actions::Discrete((0..12).map(|at| u32::from((at + number) % 2)).collect()),
    };
    let episodes = (0..4).map(episode).collect();
    let dataset = Dataset::new(2, ActionSpace::Discrete(2), episodes).expect("good episodes");
    let mut trainer = SkillTrainer::new(experiment.skills.clone(), dataset, 1, DeviceKind::Flex).expect("windows fit");
    trainer.train_batch().expect("finite");
    trainer.into_model()
}

#[test]
fn skills_come_with_the_run_that_was_trained_on_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let with = |algorithm| {
        let skills = r#"demos: "d", score: (horizon: 3), skills: (window: 3, epochs: 2, batch: 16, hidden: [4],
            encoder_hidden: 4, gru_hidden: 4, latent: 2)"#;
        let experiment = experiment(skills);
        let ppo = playbot_learner::PpoConfig { norm_obs: false, ..experiment.ppo.clone() };
        Experiment { algorithm, ppo, ..experiment }
    };
    let (path, settings) = (folder.path().join("old"), with(Algorithm::ScorePpo));
    let (narrow, model) = (line(&["place", "side"]), skills(&settings));
    let new =
        NewRun { path: &path, experiment: &settings, skills: Some(&model), skill_file: None, from: None, force: false };
    let mut old = Training::begin(&narrow, &new, &setup(), &mut Quiet).expect("it fits");
    assert!(old.drive(&mut Quiet).expect("it trains"));

    let wide = line(&["extra", "place", "side", "more"]);
    let from = Some(BeginFrom::new(&path));
    let child = begin(&wide, &settings, &folder.path().join("child"), from).expect("it brings its skills");
    let started = child.started.as_ref().expect("it has just begun");
    let report = started.report.as_ref().expect("a policy");
    assert!(started.has_skills && report.is_same_policy && report.new_inputs == 2, "{report}");
    let (z, short, long) = ([0.3, -0.6], [0.25, -1.0], [7.0, 0.25, -1.0, -3.5]);
    let play = |training: &Training, obs: &[f32]| training.trainer.policy().forward(&z, obs, 1).expect("finite");
    assert_eq!(play(&child, &long), play(&old, &short));

    let over_skills =
        begin(&wide, &with(Algorithm::SpirlPpo), &folder.path().join("spirl"), from).expect("skills alone");
    let started = over_skills.started.expect("it has just begun");
    assert!(started.has_skills && started.report.is_none());
    let run = folder.path().join("twice");
    let new = NewRun { path: &run, experiment: &with(Algorithm::SpirlPpo), from, ..new };
    let error = Training::begin(&narrow, &new, &setup(), &mut Quiet).err().expect("nothing is left to take");
    assert!(error.to_string().contains("takes its skills only: leave --skills out"), "{error}");
    let error = begin(&narrow, &experiment(""), &run, from).err().expect("its policy reads skills").to_string();
    assert!(error.contains("whose policy reads skills") && error.contains("add --algorithm score-ppo"), "{error}");
}

#[test]
fn what_does_not_fit_is_refused_and_leaves_no_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = old(folder.path());
    let child = folder.path().join("child");
    let refused = |game: &ForeignGame, experiment: &Experiment, run: &Path, words: &str| {
        let error = begin(game, experiment, &child, Some(BeginFrom::new(run))).err().expect("it does not fit");
        assert_eq!(error.exit_code(), 3, "{error}");
        assert!(error.to_string().contains(words), "{error}");
        assert!(!child.exists(), "{words}");
    };
    let game = line(&["place", "side"]);
    let levels = |text: &str| text.parse().expect("levels");
    let held_out = Experiment { train: levels("default:20..29"), test: levels("default:5..9"), ..experiment("") };
    refused(&line(&["place"]), &experiment(""), &path, "its policy reads `side`, which the game does not observe");
    refused(
        &line(&["place", "gone"]),
        &experiment(""),
        &path,
        "its policy reads `side`, which the game does not observe",
    );
    refused(&game, &held_out, &path, "it has learned from default:0..9");
    let narrow =
        Experiment { ppo: playbot_learner::PpoConfig { hidden: vec![4], ..experiment("").ppo }, ..experiment("") };
    refused(&game, &narrow, &path, "no layer of its policy fits");
    let sac = Experiment { algorithm: Algorithm::Sac, ..experiment("") };
    refused(&game, &sac, &path, "it was trained by ppo, and the new one is by sac: add --algorithm ppo");
    let other = Experiment { game: "square".to_owned(), ..experiment("") };
    refused(&game, &other, &path, "it is of line, and the new one of square");
    let file = folder.path().join("skills.safetensors");
    std::fs::write(&file, "").expect("writable");
    refused(&game, &experiment(""), &file, "it is a file: name the folder of a run");
    refused(&game, &experiment(""), &folder.path().join("nothing"), "nothing");
}

#[test]
fn an_imitated_policy_is_trained_further_with_a_critic_of_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, child) = (folder.path().join("asked"), folder.path().join("child"));
    let game = line(&["place", "side"]);
    let settings = experiment("imitation: (dagger: true, rounds: 2, steps: 64, lr: 0.01)");
    let new = NewRun { path: &path, experiment: &settings, skills: None, skill_file: None, from: None, force: false };
    let mut imitation = Imitation::begin(&game, &new, &setup(), &mut Quiet).expect("it can be asked");
    assert!(imitation.drive(&mut Quiet, &mut |_, _| {}).expect("it learns"));
    let training = begin(&game, &experiment(""), &child, Some(BeginFrom::new(&path))).expect("it fits");
    let report = training.started.and_then(|started| started.report).expect("a policy");
    assert!(report.is_same_policy, "{report}");
    assert!(report.anew.iter().all(|(layer, _)| layer.starts_with("critic.")) && report.anew.len() == 3, "{report}");
}

#[test]
fn what_a_run_takes_depends_on_both_algorithms() {
    use Algorithm::{Imitation, Ppo, Sac, ScorePpo, ScoreSac, SpirlPpo, SpirlSac};
    let all = Ok(Parts { policy: true, critic: true });
    let skills = Ok(Parts { policy: false, critic: false });
    for algorithm in [Ppo, ScorePpo, SpirlPpo] {
        assert_eq!(parts(algorithm, algorithm), all, "{algorithm}");
    }
    assert_eq!(parts(Imitation, Ppo), Ok(Parts { policy: true, critic: false }));
    for (from, to) in [(ScorePpo, ScoreSac), (ScoreSac, ScorePpo), (ScorePpo, SpirlPpo), (SpirlSac, ScorePpo)] {
        assert_eq!(parts(from, to), skills, "{from} to {to}");
    }
    for (from, to, words) in [
        (Sac, Sac, "go on with it by --resume"),
        (Ppo, ScorePpo, "which has no skills"),
        (Imitation, ScorePpo, "name them with --skills"),
        (ScorePpo, Ppo, "add --algorithm score-ppo"),
        (Ppo, Sac, "it was trained by ppo, and the new one is by sac: add --algorithm ppo"),
    ] {
        let why = parts(from, to).expect_err("they do not fit");
        assert!(why.contains(words), "{from} to {to}: {why}");
    }
}
