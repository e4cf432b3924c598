//! Tests that the same seed gives the same bits, whatever the number of threads and the size of the batch.

use crate::corridor::config;
use crate::field::{Field, HURRY};
use crate::point;
use crate::score::model;
use crate::toy::{Driver, OBS, SPACE};
use playbot_learner::nn::{Activation, CnnKind};
use playbot_learner::rng::{Streams, normal};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, DeviceKind, ImageShape, Learner, Policy, PolicyOutput, PolicySpec,
    PpoConfig, PpoLearner, Rollout, SacConfig, SacLearner, ScoreConfig, SkillConfig, SkillTrainer,
};

fn numbers(n: usize) -> Vec<f32> {
    let mut rng = Streams::new(4).stream("numbers", 0);
    (0..n).map(|_| normal(&mut rng)).collect()
}

#[test]
fn everything_can_move_to_another_thread() {
    fn movable<T: Send>() {}
    movable::<Policy>();
    movable::<playbot_learner::Prior>();
    movable::<PpoLearner>();
    movable::<playbot_learner::SacLearner>();
    movable::<playbot_learner::SkillModel>();
    movable::<playbot_learner::SkillTrainer>();
}

#[test]
fn two_runs_are_equal() {
    let run = || {
        let mut learner = PpoLearner::with_skill(config(), ScoreConfig::default(), &model(1), 3, DeviceKind::Flex)
            .expect("good settings");
        let mut driver = Driver::new(4, 1);
        let mut last = None;
        for _ in 0..3 {
            last = Some(learner.update(&driver.rollout(&learner, 16)).expect("finite"));
        }
        (last, driver.lengths)
    };
    assert_eq!(run(), run());
}

/// Returns a policy of sizes at which matrix products are split over threads and blocks.
fn wide_policy(device: DeviceKind) -> Policy {
    let spec = PolicySpec { obs: 530.into(), latent: 8, action_space: ActionSpace::Discrete(15) };
    PpoLearner::new(PpoConfig::default(), spec, 1, device).expect("good settings").policy()
}

#[test]
fn a_row_does_not_depend_on_the_other_rows() {
    for device in DeviceKind::CPU {
        let policy = wide_policy(device);
        let n = 300;
        let (z, obs) = (numbers(n * 8), numbers(n * 530));
        let whole = policy.forward(&z, &obs, n).expect("finite");
        for size in [1, 2, 3, 16, 64, 127] {
            let rows = 5..5 + size;
            let part = policy
                .forward(&z[rows.start * 8..rows.end * 8], &obs[rows.start * 530..rows.end * 530], size)
                .expect("finite");
            assert_eq!(part.head, whole.head[rows.start * 15..rows.end * 15], "{size} rows on {device}");
            assert_eq!(part.values, whole.values[rows], "{size} rows on {device}");
        }
    }
}

#[test]
fn threads_with_clones_of_a_policy_agree() {
    let policy = wide_policy(DeviceKind::Flex);
    let (z, obs) = (numbers(64 * 8), numbers(64 * 530));
    let expected = policy.forward(&z, &obs, 64).expect("finite");
    let outputs: Vec<PolicyOutput> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4)
            .map(|_| {
                let policy = policy.clone();
                let (z, obs) = (&z, &obs);
                scope.spawn(move || policy.forward(z, obs, 64).expect("finite"))
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    assert!(outputs.iter().all(|output| *output == expected));
}

/// Checks that `digest` gives the same number with 1, 2 and 4 threads. `test` is the name of the test that calls this:
/// the pool's size is fixed for a process, so the test runs itself in others.
fn same_on_any_number_of_threads(test: &str, digest: fn() -> u64) {
    const CHILD: &str = "PLAYBOT_TEST_THREADS_CHILD";
    if let Some(path) = std::env::var_os(CHILD) {
        std::fs::write(path, digest().to_string()).expect("writable");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let results = [1, 2, 4].map(|threads| {
        let path = folder.path().join(threads.to_string());
        let status = std::process::Command::new(std::env::current_exe().expect("this test"))
            .args(["--exact", &format!("determinism::{test}")])
            .env(CHILD, &path)
            .env("RAYON_NUM_THREADS", threads.to_string())
            .stdout(std::process::Stdio::null())
            .status();
        assert!(status.expect("runs").success());
        std::fs::read_to_string(path).expect("written")
    });
    assert_eq!(results[0], results[1]);
    assert_eq!(results[0], results[2]);
}

fn mix(hash: u64, x: &f32) -> u64 {
    hash.rotate_left(7) ^ u64::from(x.to_bits())
}

#[test]
fn updates_do_not_depend_on_the_number_of_threads() {
    same_on_any_number_of_threads("updates_do_not_depend_on_the_number_of_threads", || {
        let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
        let config = PpoConfig { hidden: vec![256, 256], activation: Activation::Tanh, minibatches: 2, ..config() };
        let mut learner = PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings");
        let mut driver = Driver::new(64, 1);
        learner.update(&driver.rollout(&learner, 32)).expect("finite");
        let output = learner.policy().forward(&[], &numbers(64 * OBS), 64).expect("finite");
        output.head.iter().fold(0, mix)
    });
}

#[test]
fn skill_training_does_not_depend_on_the_number_of_threads() {
    same_on_any_number_of_threads("skill_training_does_not_depend_on_the_number_of_threads", || {
        let (obs_dim, dim, steps) = (29, 8, 220);
        let values = numbers(steps * (obs_dim + dim));
        let episode = DatasetEpisode {
            observations: values[..steps * obs_dim].to_vec().into(),
            actions: Actions::Continuous { dim, values: values[steps * obs_dim..].to_vec() },
        };
        let dataset = Dataset::new(obs_dim, ActionSpace::Continuous(dim), vec![episode]).expect("a good episode");
        // Wide enough for matrix products, gates and weights to be split.
        let config = SkillConfig { window: 4, gru_hidden: 200, gru_layers: 2, ..SkillConfig::default() };
        let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("good settings");
        (0..2).fold(0, |hash, _| {
            let metrics = trainer.train_batch().expect("finite");
            [metrics.loss, metrics.grad_norm].iter().fold(hash, mix)
        })
    });
}

#[test]
fn discrete_sac_does_not_depend_on_the_number_of_threads() {
    same_on_any_number_of_threads("discrete_sac_does_not_depend_on_the_number_of_threads", || {
        let mut driver = Driver::new(8, 1);
        sac(crate::sac::config(), crate::sac::SPEC, |learner| driver.rollout(learner, 8))
    });
}

#[test]
fn continuous_sac_does_not_depend_on_the_number_of_threads() {
    same_on_any_number_of_threads("continuous_sac_does_not_depend_on_the_number_of_threads", || {
        let mut field = Field::new(&HURRY, 8, 1);
        sac(point::sac_config(), point::SPEC, |learner| field.rollout(learner, 8))
    });
}

/// Returns a policy's output after a few gradient steps with networks wide enough to be split.
fn sac(config: SacConfig, spec: PolicySpec, mut rollout: impl FnMut(&SacLearner) -> Rollout) -> u64 {
    let config = SacConfig { hidden: vec![256, 256], batch: 128, learning_starts: 1, updates_per_step: 0.05, ..config };
    let mut learner = SacLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings");
    for _ in 0..2 {
        let played = rollout(&learner);
        learner.update(&played).expect("finite");
    }
    assert!(learner.gradient_steps() > 4);
    let output = learner.policy().forward(&[], &numbers(64 * spec.obs.numbers()), 64).expect("finite");
    output.head.iter().chain(&output.log_std).fold(0, mix)
}

#[test]
fn skill_training_on_images_does_not_depend_on_the_number_of_threads() {
    same_on_any_number_of_threads("skill_training_on_images_does_not_depend_on_the_number_of_threads", || {
        let (shape, steps) = (ImageShape { channels: 3, height: 32, width: 32 }, 44);
        let pixels: Vec<u8> = numbers(steps * shape.numbers()).iter().map(|x| (x * 60.0 + 128.0) as u8).collect();
        let actions = Actions::Discrete((0..steps as u32).map(|t| t % 5).collect());
        let episode = DatasetEpisode { observations: pixels.into(), actions };
        let dataset = Dataset::new(shape, ActionSpace::Discrete(5), vec![episode]).expect("a good episode");
        let cnn = CnnKind::Impala { channels: vec![16, 16], feature: 64 };
        let config = SkillConfig { window: 4, batch: 5, cnn, ..SkillConfig::default() };
        let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("good settings");
        (0..2).fold(0, |hash, _| {
            let metrics = trainer.train_batch().expect("finite");
            [metrics.loss, metrics.grad_norm].iter().fold(hash, mix)
        })
    });
}
