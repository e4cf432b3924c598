//! PPO solves the corridor, and a broken learner does not.

use crate::toy::{BEST, Driver, OBS, SPACE};
use playbot_learner::{DeviceKind, PolicySpec, PpoConfig, PpoLearner};

pub fn config() -> PpoConfig {
    PpoConfig {
        lr: 3e-3,
        num_steps: 32,
        minibatches: 4,
        epochs: 4,
        gamma: 0.99,
        hidden: vec![16, 16],
        ..PpoConfig::default()
    }
}

/// The results of a run.
struct Training {
    /// Mean length of an episode under the first policy.
    steps_before: f64,
    /// Mean length of an episode under the last policies.
    steps_after: f64,
    /// Entropy in the last update as a share of that in the first.
    entropy_left: f32,
    /// The largest share of clipped rows in an update.
    clip_fraction: f32,
    /// The largest estimate of KL(old ‖ new) in an update.
    approx_kl: f32,
}

fn train(config: PpoConfig, seed: u64, device: DeviceKind) -> Training {
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    let steps = config.num_steps;
    let mut learner = PpoLearner::new(config, spec, seed, device).expect("good settings");
    let mut driver = Driver::new(8, seed);
    driver.rollout(&learner, 100);
    let steps_before = driver.recent(1000);
    driver.lengths.clear();
    let updates: Vec<_> = (0..40)
        .map(|_| {
            let rollout = driver.rollout(&learner, steps);
            learner.update(&rollout).expect("finite")
        })
        .collect();
    let (first, last) = (updates[0].entropy, updates[39].entropy);
    assert!((0.9 * 3f32.ln()..1.0001 * 3f32.ln()).contains(&first), "three choices, nearly alike: {first} nats");
    Training {
        steps_before,
        steps_after: driver.recent(40),
        entropy_left: last / first,
        clip_fraction: updates.iter().map(|update| update.clip_fraction).fold(0.0, f32::max),
        approx_kl: updates.iter().map(|update| update.approx_kl).fold(0.0, f32::max),
    }
}

#[test]
fn ppo_solves_the_corridor() {
    for (seed, device) in [(1, DeviceKind::Flex), (2, DeviceKind::Flex), (1, DeviceKind::Ndarray)] {
        let training = train(config(), seed, device);
        let (before, after) = (training.steps_before, training.steps_after);
        assert!(before > 3.0 * BEST, "random play takes {before} steps");
        assert!(after < 1.3 * BEST, "seed {seed} on {device}: {after} steps after training");
        let Training { entropy_left, clip_fraction, approx_kl, .. } = training;
        assert!(entropy_left < 0.8, "a policy that knows the way is surer than at first: {entropy_left}");
        assert!((0.01..0.5).contains(&clip_fraction), "some rows are clipped, not most: {clip_fraction}");
        assert!((1e-3..0.2).contains(&approx_kl), "an update is a small step: {approx_kl} nats");
    }
}

#[test]
fn with_normalised_observations_too() {
    let after = train(PpoConfig { norm_obs: true, ..config() }, 1, DeviceKind::Flex).steps_after;
    assert!(after < 1.3 * BEST, "{after} steps after training");
}

#[test]
fn without_a_learning_rate_to_speak_of_nothing_is_learned() {
    let training = train(PpoConfig { lr: 1e-9, ..config() }, 1, DeviceKind::Flex);
    assert!(training.steps_after > 3.0 * BEST, "{} steps", training.steps_after);
    assert!((training.entropy_left - 1.0).abs() < 1e-2 && training.clip_fraction == 0.0);
    assert!(training.approx_kl < 1e-6, "the policy stays as it is: {} nats", training.approx_kl);
}
