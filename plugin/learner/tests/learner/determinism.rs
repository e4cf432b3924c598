//! Tests that the same seed gives the same bits, whatever the number of threads, the size of the batch, and the processor.

use crate::corridor::config;
use crate::field::{self, Field, HURRY};
use crate::image_task;
use crate::point;
use crate::score::model;
use crate::tick::Tick;
use crate::toy::{Driver, OBS, SPACE};
use playbot_learner::nn::{Activation, CnnKind};
use playbot_learner::rng::{Streams, normal};
use playbot_learner::{
    ActionSpace, Actions, Curiosity, Dataset, DatasetEpisode, DeviceKind, ImageShape, Instructions, Learner, Policy,
    PolicyOutput, PolicySpec, PpoConfig, PpoLearner, Rollout, SacConfig, SacLearner, ScoreConfig, SkillConfig,
    SkillTrainer, UpdateMetrics, limit_by_environment,
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

/// Processes in which `digest` is computed: threads, vector instructions, and what glibc is told of the processor, whose
/// functions round otherwise without fused multiply-adds.
const PROCESSES: [(usize, Instructions, &str); 4] = [
    (1, Instructions::Widest, ""),
    (2, Instructions::Widest, "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX2_Usable,-FMA_Usable"),
    (2, Instructions::Avx2, ""),
    (4, Instructions::Portable, ""),
];

/// Checks that `digest` gives the number `want` on any number of threads, with any vector instructions, and so on every
/// machine. `test` is the name of the test that calls this: the pool's size is fixed for a process, so the test runs itself
/// in others.
fn same_everywhere(test: &str, want: u64, digest: fn() -> u64) {
    const CHILD: &str = "PLAYBOT_TEST_THREADS_CHILD";
    if let Some(path) = std::env::var_os(CHILD) {
        limit_by_environment().expect("a name");
        std::fs::write(path, digest().to_string()).expect("writable");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let found = PROCESSES.map(|(threads, instructions, tunables)| {
        let path = folder.path().join("digest");
        let status = std::process::Command::new(std::env::current_exe().expect("this test"))
            .args(["--exact", &format!("determinism::{test}")])
            .env(CHILD, &path)
            .env("PLAYBOT_INSTRUCTIONS", instructions.name())
            .env("RAYON_NUM_THREADS", threads.to_string())
            .env("GLIBC_TUNABLES", tunables)
            .stdout(std::process::Stdio::null())
            .status();
        assert!(status.expect("runs").success());
        let digest = std::fs::read_to_string(path).expect("written");
        digest.parse::<u64>().expect("a number")
    });
    assert_eq!(found, [want; PROCESSES.len()], "{found:#x?}, expected {want:#x} of each of {PROCESSES:?}");
}

fn mix(hash: u64, x: &f32) -> u64 {
    hash.rotate_left(7) ^ u64::from(x.to_bits())
}

#[test]
fn updates_have_the_same_bits_everywhere() {
    same_everywhere("updates_have_the_same_bits_everywhere", 0x842d_c65f_870d_574d, || {
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
fn skill_training_has_the_same_bits_everywhere() {
    same_everywhere("skill_training_has_the_same_bits_everywhere", 0x0008_56d0_159f_44ea, || {
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
fn discrete_sac_has_the_same_bits_everywhere() {
    same_everywhere("discrete_sac_has_the_same_bits_everywhere", 0x2cfa_04ef_ec8c_20a4, || {
        let mut driver = Driver::new(8, 1);
        sac(crate::sac::config(), crate::sac::SPEC, |learner| driver.rollout(learner, 8))
    });
}

#[test]
fn continuous_sac_has_the_same_bits_everywhere() {
    same_everywhere("continuous_sac_has_the_same_bits_everywhere", 0xdaaa_438c_0147_20e3, || {
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
fn skill_training_on_images_has_the_same_bits_everywhere() {
    same_everywhere("skill_training_on_images_has_the_same_bits_everywhere", 0x0008_09e9_2ffc_7a6b, || {
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

#[test]
fn score_has_the_same_bits_everywhere() {
    same_everywhere("score_has_the_same_bits_everywhere", 0xe330_8ec6_e2d5_7d49, || {
        let learner = PpoLearner::with_skill(config(), ScoreConfig::default(), &model(1), 3, DeviceKind::Flex);
        let (mut learner, mut driver) = (learner.expect("good settings"), Driver::new(16, 1));
        let updates = (0..3).map(|_| learner.update(&driver.rollout(&learner, 32)).expect("finite"));
        updates.fold(0, |hash, of_update| [of_update.policy_loss, of_update.approx_kl].iter().fold(hash, mix))
    });
}

#[test]
fn ppo_of_continuous_actions_has_the_same_bits_everywhere() {
    same_everywhere("ppo_of_continuous_actions_has_the_same_bits_everywhere", 0x8a59_6a2b_ec50_d9ac, || {
        let config = PpoConfig { hidden: vec![64, 64], activation: Activation::Tanh, ..config() };
        let mut learner = PpoLearner::new(config, point::SPEC, 1, DeviceKind::Flex).expect("good settings");
        let mut field = Field::new(&HURRY, 64, 1);
        for _ in 0..2 {
            let played = field.rollout(&learner, 32);
            learner.update(&played).expect("finite");
        }
        let output = learner.policy().forward(&[], &numbers(64 * field::OBS), 64).expect("finite");
        output.head.iter().chain(&output.log_std).chain(&output.values).fold(0, mix)
    });
}

#[test]
fn ppo_of_images_has_the_same_bits_everywhere() {
    same_everywhere("ppo_of_images_has_the_same_bits_everywhere", 0x4e4a_4e6e_4cb9_0211, || {
        let impala = CnnKind::Impala { channels: vec![16, 32, 32], feature: 64 };
        [impala, CnnKind::Nature { feature: 64 }].into_iter().fold(0, |hash, cnn| {
            let config = PpoConfig { cnn, epochs: 1, ..image_task::config() };
            let spec = PolicySpec { obs: SCREEN.into(), latent: 0, action_space: ActionSpace::Discrete(4) };
            let mut learner = PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings");
            let played = pictures(&learner);
            for _ in 0..2 {
                learner.update(&played).expect("finite");
            }
            let output = learner.policy().forward(&[], &pixels(16), 16).expect("finite");
            output.head.iter().chain(&output.values).fold(hash, mix)
        })
    });
}

#[test]
fn curiosity_has_the_same_bits_everywhere() {
    same_everywhere("curiosity_has_the_same_bits_everywhere", 0xe997_85d9_cb74_101f, || {
        let curiosity = Curiosity::rnd();
        let config_of_vectors = PpoConfig { curiosity: curiosity.clone(), ..config() };
        let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
        let mut learner = PpoLearner::new(config_of_vectors, spec, 1, DeviceKind::Flex).expect("good settings");
        let mut driver = Driver::new(64, 1);
        let mut hash = 0;
        let mut seen = |of_update: UpdateMetrics| {
            let numbers = [of_update.intrinsic_reward, of_update.predictor_loss, of_update.intrinsic_value_loss];
            hash = numbers.iter().flatten().fold(hash, mix);
        };
        for _ in 0..2 {
            seen(learner.update(&driver.rollout(&learner, 32)).expect("finite"));
        }
        let cnn = CnnKind::Impala { channels: vec![16, 32], feature: 64 };
        let config_of_images = PpoConfig { cnn, epochs: 1, curiosity, ..image_task::config() };
        let spec = PolicySpec { obs: SCREEN.into(), latent: 0, action_space: ActionSpace::Discrete(4) };
        let mut learner = PpoLearner::new(config_of_images, spec, 1, DeviceKind::Flex).expect("good settings");
        let played = pictures(&learner);
        for _ in 0..2 {
            seen(learner.update(&played).expect("finite"));
        }
        hash
    });
}

/// Pictures large enough for every kind of convolution.
const SCREEN: ImageShape = ImageShape { channels: 3, height: 40, width: 40 };

fn pixels(images: usize) -> Vec<u8> {
    numbers(images * SCREEN.numbers()).iter().map(|x| (x * 60.0 + 128.0) as u8).collect()
}

/// Returns some ticks of a player who sees noise.
fn pictures(learner: &PpoLearner) -> Rollout {
    let (rows, ticks, space) = (8, 4, ActionSpace::Discrete(4));
    let (mut rollout, pixels) = (Rollout::new(rows, SCREEN, 0, &space), pixels(rows * (ticks + 1)));
    let mut rng = Streams::new(5).stream("answers", 0);
    let mut screens = pixels.chunks_exact(rows * SCREEN.numbers());
    let policy = learner.policy();
    for seen in screens.by_ref().take(ticks) {
        let output = policy.forward(&[], seen, rows).expect("finite");
        let mut tick = Tick::new(&space);
        for row in 0..rows {
            let (action, log_prob) = output.sample(row, &mut rng);
            tick.push(&action, log_prob, (normal(&mut rng), row == 2, row == 5));
        }
        tick.add_to(&mut rollout, seen.into(), &[], &output.values);
        rollout.push_cut(5, &seen[..SCREEN.numbers()], &[]).expect("images");
    }
    rollout.ends.next_obs = screens.next().expect("one more").to_vec().into();
    rollout.bootstrap(&policy).expect("they fit");
    rollout
}
