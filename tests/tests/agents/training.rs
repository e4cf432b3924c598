//! Tests of training: the same bytes for the same seed, on any number of threads, in one go or in two.

use std::path::Path;

use playbot::prelude::*;
use playbot_games::coinrun::CoinRun;
use playbot_harness::worlds::build_world;
use playbot_learner::{DeviceKind, Rollout, SkillModel};
use playbot_tests::{
    Corridor,
    recording::record_random,
    training::{check_resuming, last_success_rate, learn_skills, run_info, train, written},
};
use playbot_train::{
    Algorithm, Experiment, TrainError, Trainer,
    demo::Demonstrations,
    experiment::file::parse_experiment,
    run_dir::{RunDir, RunError},
};

const EXPERIMENT: &str = r#"(
    game: "corridor", train: "plain:0..7", test: "plain:8..15", demos: "unused",
    steps: 2048, arenas: 8, worlds: 4,
    skills: (window: 3, epochs: 4, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 2, lr: 0.003),
    ppo: (num_steps: 32, minibatches: 4, hidden: [16, 16], lr: 0.003),
    sac: (num_steps: 8, batch: 32, buffer: 512, learning_starts: 200, hidden: [16, 16], updates_per_step: 0.1),
    score: (horizon: 3),
)"#;

fn experiment() -> Experiment {
    parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid")
}

/// Recordings of a random walker, and a skill model from them that is worth copying in half of its steps.
struct Given {
    skills: SkillModel,
    demos: Vec<Rollout>,
}

impl Given {
    fn new(folder: &Path) -> Self {
        let path = folder.join("walk.demo");
        record_random(&Corridor, "plain", 5, &path, 16..76);
        let experiment = Experiment { demos: Some(path.clone()), ..experiment() };
        let skills = learn_skills(&Corridor, &experiment, 2);
        let demos = Demonstrations::of(&Corridor, &experiment, &path).expect("readable");
        Self { skills, demos: demos.rollouts(&Corridor, 2, |_| {}).expect("they replay") }
    }

    fn trainer(&self, algorithm: Algorithm, threads: usize) -> Trainer {
        let skills = algorithm.needs_skills().then_some(&self.skills);
        let experiment = Experiment { algorithm, ..experiment() };
        let trainer = Trainer::with_demos(&Corridor, &experiment, skills, &self.demos, DeviceKind::Flex, threads);
        trainer.expect("fits")
    }
}

#[test]
fn recordings_are_trained_on_with_the_rewards_that_they_earn() {
    let folder = tempfile::tempdir().expect("a folder");
    let given = Given::new(folder.path());
    let ends: Vec<bool> = given.demos.iter().flat_map(|episode| episode.terminated.clone()).collect();
    let rewards: Vec<f32> = given.demos.iter().flat_map(|episode| episode.rewards.clone()).collect();
    assert!(ends.iter().any(|&end| end), "somebody got out");
    assert!(rewards.contains(&1.0), "somebody has found the exit");
    let unpaid = rewards.iter().zip(&ends).all(|(&reward, &end)| reward == 0.0 || (reward == 1.0 && end));
    assert!(unpaid, "only the exit pays, and it is the end");
    for episode in &given.demos {
        episode.check().expect("it fits together");
        assert!(!episode.truncated.contains(&true), "the state after a cut is unknown");
    }
    let without =
        Trainer::new(&Corridor, &Experiment { algorithm: Algorithm::Rlpd, ..experiment() }, None, DeviceKind::Flex, 1);
    assert!(matches!(without.err(), Some(TrainError::NoDemos(Algorithm::Rlpd))));
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let given = Given::new(folder.path());
    for algorithm in Algorithm::ALL.into_iter().filter(|algorithm| algorithm.is_trained()) {
        // Where there are fewer threads than Worlds, these decide together.
        let results: Vec<_> = [1, 2, 2, 4, 8]
            .into_iter()
            .enumerate()
            .map(|(index, threads)| {
                let run = folder.path().join(format!("{algorithm}-{index}"));
                train(&run, given.trainer(algorithm, threads), None);
                written(&run)
            })
            .collect();
        assert!(results[0] == results[1], "{algorithm}: one thread and two threads differ");
        assert!(results[1] == results[2], "{algorithm}: two runs with the same seed differ");
        assert!(results[2] == results[3], "{algorithm}: Worlds that decide alone and together differ");
        assert!(results[3] == results[4], "{algorithm}: four Worlds and eight, for as many threads, differ");
    }
}

/// Returns the names of this process's threads.
#[cfg(target_os = "linux")]
fn thread_names() -> Vec<String> {
    let threads = std::fs::read_dir("/proc/self/task").expect("Linux has it").flatten();
    // A thread may end meanwhile.
    let names = threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("comm")).ok());
    let mut names: Vec<_> = names.map(|name| name.trim().to_owned()).collect();
    names.sort();
    names
}

/// Trains on `threads` threads, and returns the threads that are there now and were not before. Threads that have played
/// a World are gone.
#[cfg(target_os = "linux")]
fn started_by_training(threads: usize) -> Vec<String> {
    let mut experiment = experiment();
    experiment.algorithm = Algorithm::Ppo;
    // Large enough for the passes of a few agents to be shared, if more threads were allowed.
    experiment.ppo.hidden = vec![1024, 1024];
    let mut trainer = Trainer::new(&Corridor, &experiment, None, DeviceKind::Flex, threads).expect("fits");
    let before = thread_names();
    (0..2).for_each(|_| drop(trainer.update().expect("learns")));
    let started = || {
        let mut started = thread_names();
        for name in &before {
            started.iter().position(|other| other == name).map(|place| started.remove(place));
        }
        started
    };
    // The system takes a moment to forget a thread that has ended.
    (0..1000).find(|_| {
        started().iter().all(|name| name.starts_with("worker ")) || {
            std::thread::yield_now();
            false
        }
    });
    started()
}

#[cfg(target_os = "linux")]
#[test]
fn learning_takes_no_more_threads_than_are_allowed() {
    const CHILD: &str = "PLAYBOT_TEST_LEARNING_THREADS";
    if let Some(path) = std::env::var_os(CHILD) {
        let path = Path::new(&path);
        let threads = path.file_name().and_then(|name| name.to_str()?.parse().ok()).expect("a number");
        return std::fs::write(path, started_by_training(threads).join(", ")).expect("writable");
    }
    let folder = tempfile::tempdir().expect("a folder");
    // Other tests have threads, too, so each number has a process of its own.
    for (threads, expected) in [("1", ""), ("2", "worker 0, worker 1"), ("3", "worker 0, worker 1, worker 2")] {
        let path = folder.path().join(threads);
        let child = std::process::Command::new(std::env::current_exe().expect("this test"))
            .args(["--exact", "training::learning_takes_no_more_threads_than_are_allowed"])
            .env(CHILD, &path)
            .output()
            .expect("starts");
        assert!(child.status.success(), "{}", String::from_utf8_lossy(&child.stderr));
        assert_eq!(std::fs::read_to_string(&path).expect("written"), expected, "{threads} threads are allowed");
    }
}

#[test]
fn phases_add_up_to_their_update_and_one_thread_is_alone() {
    for threads in [1, 2, 4] {
        let experiment = Experiment { algorithm: Algorithm::Ppo, ..experiment() };
        let mut trainer = Trainer::new(&Corridor, &experiment, None, DeviceKind::Flex, threads).expect("fits");
        for _ in 0..2 {
            let timing = trainer.update().expect("learns").timing;
            let scalars = timing.scalars();
            let [phases @ .., (_, alone)] = &scalars;
            assert!(phases.iter().all(|(_, seconds)| *seconds >= 0.0), "{scalars:?}");
            let sum: f64 = phases.iter().map(|(_, seconds)| seconds).sum();
            assert!((sum - timing.whole_s()).abs() < 1e-9 && timing.products_s > 0.0, "{scalars:?}");
            match threads {
                1 => assert!((alone - 1.0).abs() < 1e-9, "{alone}"),
                _ => assert!(*alone > 0.0 && *alone <= 1.0, "{alone}"),
            }
        }
    }
}

#[test]
fn a_resumed_training_goes_on_as_if_it_had_never_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let given = Given::new(folder.path());
    for algorithm in Algorithm::ALL.into_iter().filter(|algorithm| algorithm.is_trained()) {
        check_resuming(&Corridor, |threads| given.trainer(algorithm, threads), 3);
    }
}

#[test]
fn the_first_policy_of_score_is_the_decoder() {
    let folder = tempfile::tempdir().expect("a folder");
    let given = Given::new(folder.path());
    // For a policy over skills it is the prior.
    for algorithm in [Algorithm::ScorePpo, Algorithm::SpirlPpo, Algorithm::SpirlSac] {
        let mut trainer = given.trainer(algorithm, 1);
        assert_eq!(trainer.update().expect("learns").initial_kl, Some(0.0));
        assert_eq!(trainer.update().expect("learns").initial_kl, None, "it is checked once");
    }
}

#[test]
fn ppo_learns_the_corridor() {
    let mut experiment = experiment();
    experiment.algorithm = Algorithm::Ppo;
    experiment.steps = 8192;
    let trainer = Trainer::new(&Corridor, &experiment, None, DeviceKind::Flex, 2).expect("fits");
    let last = last_success_rate(trainer);
    assert!(last.expect("episodes ended") > 0.9, "success rate {last:?}; a random walker has about 0.3");
}

#[test]
fn skills_are_asked_for_and_must_fit() {
    let refuse = |experiment: &Experiment, skills: Option<&SkillModel>| {
        let made = Trainer::new(&Corridor, experiment, skills, DeviceKind::Flex, 1);
        made.err().expect("must be refused")
    };
    assert!(matches!(refuse(&experiment(), None), TrainError::NoSkills(_)));
    let mut overlapping = experiment();
    overlapping.test.first = 3;
    assert!(refuse(&overlapping, None).to_string().contains("overlap"));
}

#[test]
fn skills_and_policies_of_another_game_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let Given { skills, .. } = Given::new(folder.path());
    let coinrun = CoinRun::default();
    let mut foreign = experiment();
    foreign.train = "hard:0..7".parse().expect("a split");
    foreign.test = "hard:8..15".parse().expect("a split");
    let made = Trainer::new(&coinrun, &foreign, Some(&skills), DeviceKind::Flex, 1);
    let text = made.err().expect("must be refused").to_string();
    assert!(text.contains("2 observation values") && text.contains("`coinrun` has 563"), "{text}");

    let (mut world, agents) = build_world(&coinrun, "hard", 0, 0, 1);
    world.insert_resource(ActivePolicy { policy: skills.policy(), draw: ActionDraw::Sample });
    world.entity_mut(agents[0]).insert(Control::Policy);
    let fault = world.tick().expect_err("does not fit").to_string();
    assert!(fault.contains("made for 2 observation values") && fault.contains("gives 563"), "{fault}");
}

#[test]
fn levels_can_be_chosen_as_the_original_does() {
    let levels = playbot_games::coinrun::LevelSet { start_level: 10, num_levels: 5 };
    let queue = playbot_games::coinrun::ProcgenLevels::new(levels, 3);
    let mut expected = queue.clone();
    let mut source = LevelQueue::Custom(Box::new(queue));
    let mut unused = playbot_learner::Streams::new(0).stream("unused", 0);
    for _ in 0..20 {
        let level = source.next_level(&mut unused).expect("never ends");
        assert_eq!(level, u64::from(expected.next_level()));
        assert!((10..15).contains(&level));
    }
}

#[test]
fn an_existing_run_is_not_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run");
    RunDir::create(&path, &experiment(), &run_info(&experiment()), false).expect("fresh");
    let error = RunDir::create(&path, &experiment(), &run_info(&experiment()), false).err().expect("exists");
    let text = error.to_string();
    assert!(text.contains("--resume") && text.contains("--force"), "{text}");
    RunDir::create(&path, &experiment(), &run_info(&experiment()), true).expect("forced");
    let nothing = RunDir::open(&path).expect("readable").run;
    let resumed = nothing.resume(&Corridor, &experiment(), DeviceKind::Flex, 1).err().expect("empty");
    assert!(matches!(resumed, RunError::NoCheckpoint { .. }), "{resumed}");
}

#[test]
fn an_unwritable_folder_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, b"in the way").expect("writable");
    let path = file.join("run");
    let error = RunDir::create(&path, &experiment(), &run_info(&experiment()), false).err().expect("a file in the way");
    assert!(error.to_string().contains(&path.display().to_string()), "{error}");
}
