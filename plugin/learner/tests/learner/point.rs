//! PPO and SAC on points with goals in the plane.

use crate::field::{Field, HURRY, OBS, Point, SPACE};
use crate::tick::Tick;
use playbot_learner::rng::Streams;
use playbot_learner::{
    ActionValue, DeviceKind, EntropyCoef, Learner, ObsKind, PolicySpec, PpoConfig, PpoLearner, Rollout, SacConfig,
    SacLearner, TimeLimit,
};

pub const SPEC: PolicySpec = PolicySpec { obs: ObsKind::Vector(OBS), latent: 0, action_space: SPACE };
/// Returns episodes of points that go straight to their goals, as rollouts of one environment each.
pub fn recordings(episodes: u64) -> Vec<Rollout> {
    let streams = Streams::new(21);
    let episode = |i| {
        let mut point = Point::new(&mut streams.stream("recorded", i));
        let mut rollout = Rollout::new(1, OBS, 0, &SPACE);
        loop {
            let obs = point.observe();
            let [x, y, to_x, to_y] = obs;
            let velocity = [to_x - x, to_y - y].map(|way| (5.0 * way).clamp(-1.0, 1.0));
            let mut tick = Tick::new(&SPACE);
            tick.push(&ActionValue::Continuous(velocity.to_vec()), 0.0, point.step(&HURRY, &velocity));
            tick.add_to(&mut rollout, (&obs).into(), &[], &[0.0]);
            if tick.is_done(0) {
                rollout.next_values = vec![0.0];
                rollout.ends.next_obs = vec![0.0; OBS].into();
                return rollout;
            }
        }
    };
    (0..episodes).map(episode).filter(|rollout| rollout.terminated.last() == Some(&true)).collect()
}

/// Returns the share of the episodes of `ticks` ticks of play that reach their goals.
pub fn success(learner: &impl Learner, ticks: usize) -> f64 {
    Field::new(&HURRY, 32, 99).success(learner, ticks)
}

pub fn sac_config() -> SacConfig {
    SacConfig {
        actor_lr: 2e-3,
        critic_lr: 2e-3,
        temperature_lr: 2e-3,
        batch: 64,
        buffer: 10_000,
        learning_starts: 256,
        num_steps: 8,
        actor_every: 1,
        tau: 0.02,
        gamma: 0.95,
        entropy: EntropyCoef::Auto { initial: 0.2, target_scale: None },
        hidden: vec![32, 32],
        ..SacConfig::default()
    }
}

/// Returns the success after 2000 steps.
fn sac(config: SacConfig, seed: u64, device: DeviceKind) -> f64 {
    let steps = config.num_steps;
    let mut learner = SacLearner::new(config, SPEC, seed, device).expect("good settings");
    let mut field = Field::new(&HURRY, 8, seed);
    while learner.transitions() < 2000 {
        learner.update(&field.rollout(&learner, steps)).expect("finite");
    }
    success(&learner, 60)
}

#[test]
fn sac_reaches_the_goal() {
    let untrained = SacLearner::new(SacConfig { learning_starts: 0, ..sac_config() }, SPEC, 1, DeviceKind::Flex);
    let before = success(&untrained.expect("good settings"), 60);
    assert!(before < 0.4, "without training {before} of the episodes succeed");
    for (seed, device) in [(1, DeviceKind::Flex), (2, DeviceKind::Flex), (1, DeviceKind::Ndarray)] {
        let after = sac(sac_config(), seed, device);
        assert!(after > 0.9, "seed {seed} on {device}: {after}");
    }
}

#[test]
fn sac_learns_from_normalised_numbers_and_with_a_fixed_temperature_too() {
    let normalised = SacConfig { norm_obs: true, norm_reward: true, ..sac_config() };
    let after = sac(normalised, 1, DeviceKind::Flex);
    assert!(after > 0.9, "normalised: {after}");
    let fixed =
        SacConfig { entropy: EntropyCoef::Fixed(0.02), actor_every: 2, time_limit: TimeLimit::Legacy, ..sac_config() };
    let after = sac(fixed, 1, DeviceKind::Flex);
    assert!(after > 0.9, "with a fixed temperature: {after}");
}

#[test]
fn ppo_reaches_the_goal() {
    let config = PpoConfig {
        lr: 3e-3,
        num_steps: 32,
        minibatches: 4,
        epochs: 8,
        gamma: 0.95,
        ent_coef: 0.0,
        hidden: vec![32, 32],
        ..PpoConfig::default()
    };
    let steps = config.num_steps;
    let mut learner = PpoLearner::new(config, SPEC, 1, DeviceKind::Flex).expect("good settings");
    let before = success(&learner, 60);
    assert!(before < 0.5, "without training {before} of the episodes succeed");
    let mut field = Field::new(&HURRY, 16, 1);
    for _ in 0..60 {
        learner.update(&field.rollout(&learner, steps)).expect("finite");
    }
    let after = success(&learner, 60);
    assert!(after > 0.9, "{after}");
}
