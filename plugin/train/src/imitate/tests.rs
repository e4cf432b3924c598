//! Imitations in their folders: determinism, resumption, and what cannot be imitated.

use super::*;
use crate::experiment::file::parse_experiment;
use bevy::prelude::*;
use bevy_playbot::prelude::*;
use playbot_harness::foreign::{ForeignGame, LevelSeed};
use playbot_learner::DeviceKind;
use std::path::Path;

/// Stops after so many rounds.
struct Rounds(u64);

impl RunObserver for Rounds {
    fn stopped(&self) -> bool {
        self.0 == 0
    }

    fn observe(&mut self, event: RunEvent<'_>) {
        if let RunEvent::Saved { .. } = event {
            self.0 -= 1;
        }
    }
}

const ALL: Rounds = Rounds(u64::MAX);

#[derive(Resource, Default)]
struct Place(i32);

/// A walk along a line of 13 cells from the middle, to the end on the side of the level's number.
fn line() -> ForeignGame {
    let plugin = |app: &mut App| {
        app.init_resource::<Place>().add_systems(
            Update,
            |keys: Res<ButtonInput<KeyCode>>, mut place: ResMut<Place>| {
                place.0 += i32::from(keys.pressed(KeyCode::ArrowRight)) - i32::from(keys.pressed(KeyCode::ArrowLeft));
            },
        );
    };
    ForeignGame::new("line", 1, plugin)
        .keys([vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight], vec![]])
        .level(|mut place: ResMut<Place>| place.0 = 0)
        .observe(["place", "side"], |place: Res<Place>, level: Res<LevelSeed>| {
            [place.0 as f32 / 6.0, if level.0.is_multiple_of(2) { 1.0 } else { -1.0 }]
        })
        .end(|place: Res<Place>, level: Res<LevelSeed>| {
            let is_right = place.0 > 0;
            (place.0.abs() >= 6).then_some(EpisodeEnd::Terminated { success: is_right == level.0.is_multiple_of(2) })
        })
        .time_limit(60)
}

fn asked() -> ForeignGame {
    line().demonstrator("walker", |level: Res<LevelSeed>| u32::from(level.0.is_multiple_of(2)))
}

fn experiment(changes: &str) -> Experiment {
    let text = format!(
        r#"(game: "line", train: "default:0..19", test: "default:100..109", steps: 1, arenas: 6, worlds: 3,
        ppo: (hidden: [8], norm_obs: true),
        imitation: (dagger: true, rounds: 4, steps: 60, ticks: 10, lr: 0.01, batch: 16, patience: 9, {changes}))"#
    );
    parse_experiment(&text, Path::new("x.ron")).expect("valid")
}

fn begin<'a>(
    game: &'a ForeignGame,
    experiment: &Experiment,
    path: &Path,
    threads: usize,
) -> Result<Imitation<'a>, ImitateError> {
    let new = NewRun { path, experiment, skills: None, skill_file: None, from: None, force: false };
    Imitation::begin(game, &new, &TrainingSetup::new(DeviceKind::Flex, threads), &mut Rounds(0))
}

/// Returns the files of a run that hold no time, by name.
fn written(run: &Path) -> Vec<(String, Vec<u8>)> {
    let last = RunDir::open(run).expect("a run").run.checkpoint(CheckpointChoice::Last).expect("saved").path;
    let mut files: Vec<PathBuf> = ["experiment.ron", "metrics.jsonl"].map(|name| run.join(name)).into();
    for folder in [run.join("labels"), last] {
        files.extend(fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path()));
    }
    files.sort();
    let name = |file: &Path| file.strip_prefix(run).expect("inside").display().to_string();
    files.iter().map(|file| (name(file), fs::read(file).expect("readable"))).collect()
}

#[test]
fn the_same_bytes_come_from_one_thread_and_two_in_one_go_and_in_two() {
    let folder = tempfile::tempdir().expect("a folder");
    let game = asked();
    let whole = |name: &str, threads| {
        let path = folder.path().join(name);
        let mut imitation = begin(&game, &experiment(""), &path, threads).expect("it can be asked");
        assert!(imitation.drive(&mut ALL.again(), &mut |_, _| {}).expect("it learns"));
        written(&path)
    };
    let (one, two) = (whole("one", 1), whole("two", 2));
    assert!(one.iter().filter(|(name, _)| name.starts_with("labels")).count() == 4, "a file for each round");
    assert!(one == two, "one thread and two differ");
    let path = folder.path().join("parts");
    let mut imitation = begin(&game, &experiment(""), &path, 1).expect("it can be asked");
    assert!(!imitation.drive(&mut Rounds(2), &mut |_, _| {}).expect("it learns"), "it is stopped");
    drop(imitation);
    let opened = RunDir::open_to_write(&path).expect("a run");
    let setup = TrainingSetup::new(DeviceKind::Flex, 2);
    let mut imitation = Imitation::resume(&game, opened, &setup).expect("it goes on");
    assert_eq!((imitation.progress().rounds, imitation.steps().len()), (2, 120));
    assert!(imitation.drive(&mut ALL.again(), &mut |_, _| {}).expect("it learns"));
    assert!(written(&path) == one, "stopped and resumed it differs");
}

impl Rounds {
    fn again(&self) -> Self {
        Self(self.0)
    }
}

#[test]
fn a_policy_learns_from_states_that_it_has_led_to_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let game = asked();
    let states = |beta: f64| {
        let path = folder.path().join(format!("beta-{beta}"));
        let mut imitation = begin(&game, &experiment(&format!("beta: {beta}")), &path, 1).expect("it can be asked");
        imitation.drive(&mut ALL.again(), &mut |_, _| {}).expect("it learns");
        let last = LabelledSteps::load(&imitation.labels(1), &imitation.learner.spec()).expect("readable");
        let first = LabelledSteps::load(&imitation.labels(0), &imitation.learner.spec()).expect("readable");
        assert_eq!(imitation.steps().len(), 240);
        let best = imitation.progress().best.expect("measured");
        (first, last, best)
    };
    let ((alone, again, _), (first, visited, best)) = (states(1.0), states(0.0));
    assert_eq!(alone, first, "in the first round the demonstrator plays");
    // Never on the wrong side of the middle, if it plays alone.
    let strays = |steps: &LabelledSteps| {
        let playbot_learner::Observations::Vector(values) = &steps.obs else { panic!("vectors") };
        values.chunks_exact(2).filter(|state| state[0] * state[1] < 0.0).count()
    };
    assert_eq!((strays(&alone), strays(&again)), (0, 0));
    assert!(strays(&visited) > 0, "the policy strays");
    // The demonstrator answers for each of them, by the side of the level.
    let playbot_learner::Observations::Vector(values) = &visited.obs else { panic!("vectors") };
    let sides = values.chunks_exact(2).map(|state| u32::from(state[1] > 0.0)).collect();
    assert_eq!(visited.actions, playbot_learner::Actions::Discrete(sides));
    assert!(best.success > 0.9, "{best:?}");
}

#[test]
fn it_ends_when_no_round_is_better_and_keeps_the_best_policy() {
    let folder = tempfile::tempdir().expect("a folder");
    let (game, path) = (asked(), folder.path().join("run"));
    let settings = Experiment {
        imitation: playbot_learner::ImitationConfig { patience: 1, rounds: 40, ..experiment("").imitation },
        ..experiment("")
    };
    let mut imitation = begin(&game, &settings, &path, 1).expect("it can be asked");
    let mut rounds = Vec::new();
    let is_done = imitation
        .drive(&mut ALL.again(), &mut |progress, report| rounds.push((progress.best, report.success_rate)))
        .expect("it learns");
    assert!(is_done && rounds.len() < 40, "{rounds:?}");
    let best = imitation.progress().best.expect("measured");
    assert_eq!(rounds[best.round as usize - 1].1, Some(best.success));
    assert!(rounds.iter().all(|(_, success)| success.expect("measured") <= best.success));
    let opened = RunDir::open(&path).expect("a run");
    assert_eq!(opened.experiment.steps, imitation.progress().steps, "the run is finished");
    let last = opened.run.checkpoint(CheckpointChoice::Last).expect("saved");
    let load = |name: &str| PpoLearner::load(&last.path.join(name), DeviceKind::Flex).expect("readable").updates();
    assert_eq!((load("learner.safetensors"), load(PRESENT)), (best.round, imitation.progress().rounds));
}

#[test]
fn who_cannot_be_asked_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run");
    let refused = |game: &ForeignGame, words: &str| {
        let error = begin(game, &experiment(""), &path, 1).err().expect("it cannot be asked");
        assert_eq!(error.exit_code(), 3, "{error}");
        assert!(error.to_string().contains(words), "{error}");
        assert!(!path.exists(), "{words}");
    };
    refused(&line(), "`line` has no demonstrator to ask");
    refused(
        &asked().demonstrator_cannot_be_asked("it follows a fixed plan"),
        "`walker` of `line` cannot be asked: it follows a fixed plan; imitate its recordings",
    );
    // Without --dagger recordings are needed.
    let plain = Experiment {
        imitation: playbot_learner::ImitationConfig { dagger: false, ..experiment("").imitation },
        ..experiment("")
    };
    let error = begin(&line(), &plain, &path, 1).err().expect("nothing to imitate").to_string();
    assert!(error.contains("`demos` is missing"), "{error}");
}

#[test]
fn the_last_training_levels_say_which_round_is_the_best() {
    let levels = |train: &str, settings: &str| {
        let text = format!(r#"(game: "g", train: "a:{train}", test: "a:900..999", steps: 1, imitation: ({settings}))"#);
        let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
        let ImitationLevels { labelled, held_out } = ImitationLevels::of(&experiment);
        (labelled.to_string(), held_out.map(|levels| levels.to_string()).unwrap_or_default())
    };
    let pair = |labelled: &str, held_out: &str| (labelled.to_owned(), held_out.to_owned());
    assert_eq!(levels("0..99", ""), pair("a:0..79", "a:80..99"));
    assert_eq!(levels("100..499", ""), pair("a:100..419", "a:420..451"), "at most 32 are played");
    assert_eq!(levels("0..99", "held_out: 0.0"), pair("a:0..99", ""));
    assert_eq!(levels("0..0", "held_out: 1.0"), pair("a:0..0", ""), "there is only one");
    assert_eq!(levels("0..1", "held_out: 1.0"), pair("a:0..0", "a:1..1"));
}

#[test]
fn as_many_arenas_play_as_see_whole_episodes() {
    let of = |arenas, ticks| {
        let imitation = playbot_learner::ImitationConfig { ticks, ..experiment("").imitation };
        let experiment = Experiment { arenas, imitation, ..experiment("") };
        (arenas_of(&experiment), round_steps(&experiment))
    };
    assert_eq!(of(6, 10), (6, 60));
    assert_eq!(of(3, 10), (3, 60), "each plays longer");
    assert_eq!(of(12, 12), (3, 60), "three Worlds share them");
    assert_eq!(of(12, 25), (2, 60), "there are more Worlds than arenas");
    assert_eq!(of(12, 1000), (1, 60));
}

#[test]
fn success_counts_before_return() {
    let round = |success, episodic_return| BestRound { round: 1, success, episodic_return };
    assert!(round(0.5, 0.0).is_better_than(&round(0.4, 9.0)));
    assert!(round(0.5, 2.0).is_better_than(&round(0.5, 1.0)));
    assert!(!round(0.5, 2.0).is_better_than(&round(0.5, 2.0)), "the first of equal ones stays");
}
