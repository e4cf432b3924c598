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

fn train(config: PpoConfig, seed: u64, device: DeviceKind) -> (f64, f64) {
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    let steps = config.num_steps;
    let mut learner = PpoLearner::new(config, spec, seed, device).expect("good settings");
    let mut driver = Driver::new(8, seed);
    driver.rollout(&learner, 100);
    let before = driver.recent(1000);
    driver.lengths.clear();
    for _ in 0..40 {
        let rollout = driver.rollout(&learner, steps);
        let metrics = learner.update(&rollout).expect("finite");
        assert!(metrics.entropy >= 0.0 && metrics.clip_fraction <= 1.0 && metrics.approx_kl >= 0.0);
    }
    (before, driver.recent(40))
}

#[test]
fn ppo_solves_the_corridor() {
    for (seed, device) in [(1, DeviceKind::Flex), (2, DeviceKind::Flex), (1, DeviceKind::Ndarray)] {
        let (before, after) = train(config(), seed, device);
        assert!(before > 3.0 * BEST, "random play takes {before} steps");
        assert!(after < 1.3 * BEST, "seed {seed} on {device}: {after} steps after training");
    }
}

#[test]
fn with_normalised_observations_too() {
    let (_, after) = train(PpoConfig { norm_obs: true, ..config() }, 1, DeviceKind::Flex);
    assert!(after < 1.3 * BEST, "{after} steps after training");
}

#[test]
fn without_a_learning_rate_to_speak_of_nothing_is_learned() {
    let (_, after) = train(PpoConfig { lr: 1e-9, ..config() }, 1, DeviceKind::Flex);
    assert!(after > 3.0 * BEST, "{after} steps");
}
