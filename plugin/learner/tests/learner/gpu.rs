//! Learning on a graphics card: the same as on the CPU, within tolerance, from the same rollouts. A software renderer
//! suffices.

use crate::{corridor, image_task, score, toy};
use burn::cubecl::logging::{LaunchObservation, LaunchObserver};
use playbot_learner::nn::CnnKind;
use playbot_learner::{
    Actions, Curiosity, DeviceKind, ImageShape, Learner, Observations, PolicySpec, PpoConfig, PpoLearner, Rollout,
    ScoreConfig, SkillModel, SkillTrainer, Traffic, UpdateMetrics,
};
use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

const CARD: DeviceKind = DeviceKind::Wgpu;

fn assert_near(found: &[f32], want: &[f32], tolerance: f32, what: &str) {
    assert_eq!(found.len(), want.len(), "{what}");
    for (found, want) in found.iter().zip(want) {
        assert!((found - want).abs() <= tolerance * (1.0 + want.abs()), "{what}: {found} for {want}");
    }
}

fn assert_alike(found: &UpdateMetrics, want: &UpdateMetrics) {
    for ((name, found), (other, want)) in found.scalars().into_iter().zip(want.scalars()) {
        assert_eq!(name, other);
        assert!((found - want).abs() <= 2e-3 * (1.0 + want.abs()), "{name}: {found} for {want}");
    }
}

/// Two learners of the same settings, one on each device, learn from the first one's rollouts.
fn learn_alike(make: impl Fn(DeviceKind) -> PpoLearner, mut play: impl FnMut(&PpoLearner) -> Rollout) {
    let (mut cpu, mut card) = (make(DeviceKind::Flex), make(CARD));
    for _ in 0..2 {
        let rollout = play(&cpu);
        let want = cpu.update(&rollout).expect("finite");
        assert_alike(&card.update(&rollout).expect("finite"), &want);
        let n = rollout.envs;
        let (z, obs) = (&rollout.z[..n * rollout.latent], rollout.obs.rows(0..n, rollout.obs_kind.numbers()));
        let z = if cpu.policy().latent() == 0 { &[] } else { z };
        let (want, found) = (cpu.policy().forward(z, obs, n), card.policy().forward(z, obs, n));
        let (want, found) = (want.expect("finite"), found.expect("finite"));
        assert_near(&found.head, &want.head, 2e-3, "head");
        assert_near(&found.values, &want.values, 2e-3, "values");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("learner.safetensors");
    card.save(&path).expect("writable");
    // A learner from a card continues on the CPU, and the other way round.
    let mut on_cpu = PpoLearner::load(&path, DeviceKind::Flex).expect("readable");
    let mut on_card = PpoLearner::load(&path, CARD).expect("readable");
    let rollout = play(&cpu);
    let want = card.update(&rollout).expect("finite");
    assert_alike(&on_cpu.update(&rollout).expect("finite"), &want);
    assert_alike(&on_card.update(&rollout).expect("finite"), &want);
}

#[test]
fn ppo_on_vectors() {
    let spec = PolicySpec { obs: toy::OBS.into(), latent: 0, action_space: toy::SPACE };
    let mut driver = toy::Driver::new(8, 1);
    let make = |device| PpoLearner::new(corridor::config(), spec, 1, device).expect("good settings");
    learn_alike(make, |learner| driver.rollout(learner, 8));
}

#[test]
fn score_on_vectors_with_skills_from_the_cpu() {
    let model = score::model(1);
    let mut driver = toy::Driver::new(8, 1);
    let settings = ScoreConfig::default();
    let make = |device| {
        PpoLearner::with_skill(corridor::config(), settings.clone(), &model, 1, device).expect("good settings")
    };
    learn_alike(make, |learner| driver.rollout(learner, 8));
}

#[test]
fn ppo_on_images() {
    let spec = PolicySpec { obs: image_task::SHAPE.into(), latent: 0, action_space: image_task::SPACE };
    let config = PpoConfig { num_steps: 4, ..image_task::config() };
    let mut driver = image_task::Driver::new(8, 1);
    let make = |device| PpoLearner::new(config.clone(), spec, 1, device).expect("good settings");
    learn_alike(make, |learner| driver.rollout(learner, 4));
}

#[test]
fn curiosity_on_vectors_and_images() {
    let curious = |config| PpoConfig { curiosity: Curiosity::rnd(), ..config };
    let spec = PolicySpec { obs: toy::OBS.into(), latent: 0, action_space: toy::SPACE };
    let mut driver = toy::Driver::new(8, 1);
    let make = |device| PpoLearner::new(curious(corridor::config()), spec, 1, device).expect("good settings");
    learn_alike(make, |learner| driver.rollout(learner, 8));
    let spec = PolicySpec { obs: image_task::SHAPE.into(), latent: 0, action_space: image_task::SPACE };
    let config = PpoConfig { num_steps: 4, ..image_task::config() };
    let mut driver = image_task::Driver::new(8, 1);
    let make = |device| PpoLearner::new(curious(config.clone()), spec, 1, device).expect("good settings");
    learn_alike(make, |learner| driver.rollout(learner, 4));
}

#[test]
fn skills() {
    let [mut cpu, mut card] = [DeviceKind::Flex, CARD].map(|device| {
        SkillTrainer::new(crate::skill::config(), crate::skill::corridor_demos(20), 1, device).expect("windows fit")
    });
    for _ in 0..4 {
        let (want, found) = (cpu.train_batch().expect("finite"), card.train_batch().expect("finite"));
        let numbers = |m: playbot_learner::SkillMetrics| [m.loss, m.nll, m.kl, m.latent_norm, m.grad_norm];
        assert_near(&numbers(found), &numbers(want), 2e-3, "metrics");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("skills.safetensors");
    card.into_model().save(&path).expect("writable");
    SkillModel::load(&path, DeviceKind::Flex).expect("read where it was not made");
}

/// The kernels that were started.
#[derive(Default)]
struct Launches(AtomicU64);

impl LaunchObserver for Launches {
    fn launched(&self, _: &'static str) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

const PICTURE: ImageShape = ImageShape { channels: 3, height: 64, width: 64 };

/// Returns a rollout of random pictures.
fn pictures(envs: usize, steps: usize) -> Rollout {
    let rows = envs * steps;
    let numbers = |n: usize| (0..n).map(|i| (i * 7919 % 97) as f32 / 97.0).collect::<Vec<_>>();
    Rollout {
        steps,
        obs: Observations::Image((0..rows * PICTURE.numbers()).map(|i| (i * 31 % 251) as u8).collect()),
        actions: Actions::Discrete((0..rows).map(|i| i as u32 % 4).collect()),
        log_probs: vec![-1.4; rows],
        values: numbers(rows),
        rewards: numbers(rows),
        terminated: vec![false; rows],
        truncated: vec![false; rows],
        final_values: vec![f32::NAN; rows],
        next_values: numbers(envs),
        ..Rollout::new(envs, PICTURE, 0, &image_task::SPACE)
    }
}

/// With fused operations a step of the Nature-CNN takes about 250 kernels and one of IMPALA 460; without, 320 and 610.
#[test]
fn a_step_takes_few_kernels() {
    let rollout = pictures(8, 10);
    let impala = CnnKind::Impala { channels: vec![4, 8, 8], feature: 64 };
    for (cnn, most) in [(CnnKind::Nature { feature: 64 }, 280), (impala, 520)] {
        let counts = [1, 5].map(|minibatches| {
            let spec = PolicySpec { obs: PICTURE.into(), latent: 0, action_space: image_task::SPACE };
            let config = PpoConfig { num_steps: 10, minibatches, epochs: 1, cnn: cnn.clone(), ..image_task::config() };
            let mut learner = PpoLearner::new(config, spec, 1, CARD).expect("good settings");
            learner.update(&rollout).expect("finite");
            let launches = Arc::new(Launches::default());
            let observed = LaunchObservation::new(launches.clone());
            learner.update(&rollout).expect("finite");
            drop(observed);
            launches.0.load(Ordering::Relaxed)
        });
        let of_step = (counts[1] - counts[0]) / 4;
        assert!((10..=most).contains(&of_step), "{cnn:?}: {of_step} kernels in a step");
        // Beside its steps an update hardly computes.
        assert!(counts[0] <= of_step + 40, "{cnn:?}: {counts:?} kernels in updates of one step and of five");
    }
}

/// A rollout is sent once and no more, and of each step only the metrics are read. Pixels are sent as bytes.
#[test]
fn an_update_moves_few_bytes() {
    let rollout = pictures(8, 10);
    let (rows, minibatches, epochs) = (80, 5, 2);
    let spec = PolicySpec { obs: PICTURE.into(), latent: 0, action_space: image_task::SPACE };
    let cnn = CnnKind::Nature { feature: 64 };
    let config = PpoConfig { num_steps: 10, minibatches, epochs, cnn, ..image_task::config() };
    let mut learner = PpoLearner::new(config, spec, 1, CARD).expect("good settings");
    learner.update(&rollout).expect("finite");
    let before = Traffic::so_far();
    learner.update(&rollout).expect("finite");
    let now = Traffic::so_far();
    let (sent, read) = (now.sent - before.sent, now.read - before.read);
    // Beside its pixels a row has an action of 8 bytes, four numbers of 4, and a place in a minibatch of each epoch.
    let least = rows * (PICTURE.numbers() + 8 + 4 * 4 + epochs * 4) as u64;
    assert!((least..=least + 1024).contains(&sent), "{sent} bytes were sent, where a rollout has {least}");
    let steps = (epochs * minibatches) as u64;
    assert!((steps * 4..=steps * 64).contains(&read), "{read} bytes were read after {steps} steps");
}
