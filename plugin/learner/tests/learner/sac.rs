//! SAC: discrete actions, the numbers of an update by hand, restarts, and errors.

use crate::errors::vectors;
use crate::field::{Field, HURRY};
use crate::point;
use crate::toy::{BEST, Driver, OBS, SPACE};
use playbot_learner::{
    ActionSpace, Actions, DeviceKind, EndStates, EntropyCoef, FileError, LearnError, Learner, ObsKind, PolicySpec,
    PpoLearner, Rollout, SacConfig, SacLearner, SacMetrics, TimeLimit,
};

pub const SPEC: PolicySpec = PolicySpec { obs: ObsKind::Vector(OBS), latent: 0, action_space: SPACE };

pub fn config() -> SacConfig {
    SacConfig {
        entropy: EntropyCoef::Auto { initial: 0.1, target_scale: Some(0.2) },
        gamma: 0.97,
        hidden: vec![16, 16],
        ..point::sac_config()
    }
}

fn learner(config: SacConfig) -> SacLearner {
    SacLearner::new(config, SPEC, 1, DeviceKind::Flex).expect("good settings")
}

#[test]
fn discrete_sac_solves_the_corridor() {
    for (seed, device) in [(1, DeviceKind::Flex), (2, DeviceKind::Flex), (1, DeviceKind::Ndarray)] {
        let mut learner = SacLearner::new(config(), SPEC, seed, device).expect("good settings");
        let mut driver = Driver::new(8, seed);
        driver.rollout(&learner, 100);
        let before = driver.recent(1000);
        assert!(before > 3.0 * BEST, "random play takes {before} steps");
        while learner.transitions() < 3000 {
            learner.update(&driver.rollout(&learner, 8)).expect("finite");
        }
        driver.lengths.clear();
        driver.rollout(&learner, 60);
        let after = driver.recent(40);
        assert!(after < 1.3 * BEST, "seed {seed} on {device}: {after} steps after training");
    }
}

/// Returns a rollout of one environment, one step from observation 1 to observation 2 with reward 3.
fn step(terminated: bool, truncated: bool) -> Rollout {
    let cut = truncated && !terminated;
    Rollout {
        steps: 1,
        obs: vec![1.0].into(),
        actions: Actions::Discrete(vec![0]),
        log_probs: vec![0.0],
        values: vec![0.0],
        rewards: vec![3.0],
        terminated: vec![terminated],
        truncated: vec![truncated],
        final_values: vec![0.0],
        next_values: vec![0.0],
        ends: EndStates {
            cut_rows: if cut { vec![0] } else { Vec::new() },
            cut_obs: if cut { vec![2.0] } else { Vec::new() }.into(),
            // Where the episode was cut off, the next one begins in a state of huge value.
            next_obs: vec![if terminated || truncated { 1e6 } else { 2.0 }].into(),
            ..EndStates::new(&ObsKind::Vector(1))
        },
        ..Rollout::new(1, 1, 0, &ActionSpace::Discrete(1))
    }
}

/// Returns √loss of the first step of the critics. With one choice the entropy is 0, so that y = 3 + ½ min Q(2) or 3.
fn errors(terminated: bool, truncated: bool, time_limit: TimeLimit) -> f64 {
    let config = SacConfig {
        time_limit,
        gamma: 0.5,
        batch: 4,
        learning_starts: 1,
        hidden: Vec::new(),
        entropy: EntropyCoef::Fixed(0.0),
        ..SacConfig::default()
    };
    let spec = PolicySpec { obs: 1.into(), latent: 0, action_space: ActionSpace::Discrete(1) };
    let mut learner = SacLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings");
    let metrics = learner.update(&step(terminated, truncated)).expect("finite");
    f64::from(metrics.qf_loss.expect("a step was due"))
}

#[test]
fn only_terminations_stop_the_target() {
    // Without hidden layers and with orthogonal weights of one number, Q₁ and Q₂ are w s with w = ±1: Q(1) = ±1.
    let square = |y1: f64, y2: f64| 0.5 * (y1.powi(2) + y2.powi(2));
    // For every pair of signs: (Q₁(1), Q₂(1)) and the smaller one at 2.
    let outcomes = |counts: bool| {
        [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(q1, q2): (f64, f64)| {
            let y = 3.0 + if counts { 0.5 * 2.0 * q1.min(q2) } else { 0.0 };
            square(q1 - y, q2 - y)
        })
    };
    let close = |loss: f64, expected: f64| (loss - expected).abs() < 1e-4;
    let over = errors(true, false, TimeLimit::Bootstrap);
    let signs = outcomes(false).iter().position(|&loss| close(over, loss)).expect("y = 3 after a termination");
    let goes_on = outcomes(true)[signs];
    assert!(!close(over, goes_on));
    assert!(close(errors(false, false, TimeLimit::Bootstrap), goes_on), "in the middle");
    assert!(close(errors(false, true, TimeLimit::Bootstrap), goes_on), "a time limit bootstraps");
    assert!(close(errors(false, true, TimeLimit::Legacy), over), "unless asked not to");
    assert!(close(errors(true, true, TimeLimit::Bootstrap), over), "termination wins");
    assert!(close(errors(true, true, TimeLimit::Legacy), over));
}

#[test]
fn gradient_steps_keep_pace_with_the_transitions() {
    let slow =
        SacConfig { updates_per_step: 0.34375, learning_starts: 40, actor_every: 3, buffer: 50, batch: 4, ..config() };
    let mut learner = learner(slow);
    let mut driver = Driver::new(4, 1);
    let mut steps = Vec::new();
    let mut last = SacMetrics::default();
    for _ in 0..8 {
        last = learner.update(&driver.rollout(&learner, 4)).expect("finite");
        steps.push(last.gradient_steps);
    }
    // 16 rows each; the third reaches 48 of 40. 5.5 a time, with the halves carried over.
    assert_eq!(steps, [0, 0, 5, 11, 16, 22, 27, 33]);
    assert_eq!((last.transitions, learner.transitions(), learner.updates()), (128, 128, 8));
    let names: Vec<_> = last.scalars().into_iter().map(|(name, _)| name).collect();
    for name in
        ["charts/entropy_coef", "losses/actor_loss", "losses/qf_loss", "losses/entropy", "losses/temperature_loss"]
    {
        assert!(names.contains(&name), "{name}");
    }
    assert!(!names.contains(&"score/decoder_kl"));
    let warming = SacMetrics { transitions: 16, ..SacMetrics::default() };
    assert_eq!(warming.scalars(), [("charts/transitions", 16.0), ("charts/gradient_steps", 0.0)]);
}

#[test]
fn while_the_critics_warm_up_the_actor_stays_where_it_is() {
    let warm = SacConfig { critic_warmup: 10, learning_starts: 16, updates_per_step: 0.5, batch: 4, ..config() };
    let mut learner = learner(SacConfig { random_start: false, actor_every: 1, ..warm });
    let mut driver = Driver::new(4, 1);
    let played = driver.rollout(&learner, 4);
    let head =
        |learner: &SacLearner| learner.policy().forward(&played.z, &played.obs, played.rows()).expect("finite").head;
    let start = head(&learner);
    let first = learner.update(&played).expect("finite");
    assert_eq!((first.gradient_steps, first.actor_loss, first.temperature_loss), (8, None, None));
    assert!(first.qf_loss.is_some() && head(&learner) == start, "only the critics learn");
    let second = learner.update(&played).expect("finite");
    assert!(second.gradient_steps == 16 && second.actor_loss.is_some());
    assert!(head(&learner) != start && second.entropy_coef != first.entropy_coef, "and then all do");
}

/// Checks that a restored learner continues alike, by every report and the whole states.
fn goes_on(mut learner: SacLearner, mut rollout: impl FnMut(&SacLearner) -> Rollout) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    for _ in 0..3 {
        let played = rollout(&learner);
        learner.update(&played).expect("finite");
    }
    learner.save(&path).expect("written");
    let mut loaded = SacLearner::load(&path, DeviceKind::Flex).expect("read");
    assert_eq!((loaded.updates(), loaded.seed()), (3, learner.seed()));
    assert_eq!((loaded.config(), loaded.gradient_steps()), (learner.config(), learner.gradient_steps()));
    assert!(learner.gradient_steps() > 0);
    for _ in 0..3 {
        let played = rollout(&learner);
        let expected = learner.update(&played).expect("finite");
        assert_eq!(loaded.update(&played).expect("finite"), expected);
    }
    let (first, second) = (folder.path().join("a"), folder.path().join("b"));
    learner.save(&first).expect("written");
    loaded.save(&second).expect("written");
    let read = |path| std::fs::read(path).expect("readable");
    assert_eq!(read(&first), read(&second), "whole states are equal, byte for byte");
    assert!(matches!(PpoLearner::load(&path, DeviceKind::Flex), Err(FileError::Format { .. })));
}

#[test]
fn a_loaded_learner_goes_on_bit_for_bit() {
    let small = SacConfig { updates_per_step: 0.37, learning_starts: 30, actor_every: 2, buffer: 70, ..config() };
    let mut driver = Driver::new(4, 1);
    goes_on(learner(small.clone()), |learner| driver.rollout(learner, 8));
    let normalised = SacConfig { norm_obs: true, norm_reward: true, ..small };
    let continuous = SacLearner::new(normalised, point::SPEC, u64::MAX, DeviceKind::Flex).expect("good settings");
    let mut field = Field::new(&HURRY, 4, 1);
    goes_on(continuous, |learner| field.rollout(learner, 8));
}

#[test]
fn bad_rollouts_and_numbers_are_named() {
    let after = |change: fn(&mut Rollout)| {
        let mut learner = learner(SacConfig { learning_starts: 1, ..config() });
        let mut rollout = Driver::new(4, 1).rollout(&learner, 4);
        change(&mut rollout);
        let error = learner.update(&rollout).expect_err("a bad rollout");
        assert_eq!(learner.transitions(), 0, "{error}");
        error
    };
    let error = after(|rollout| rollout.rewards[3] = f32::NAN);
    assert!(matches!(&error, LearnError::Input { row: 3, .. }), "{error}");
    let error = after(|rollout| vectors(&mut rollout.obs)[4 * OBS + 1] = f32::INFINITY);
    assert!(matches!(&error, LearnError::Input { row: 4, .. }), "{error}");
    let error = after(|rollout| vectors(&mut rollout.ends.next_obs)[OBS] = f32::NAN);
    assert!(error.to_string().contains("next_obs: row 1"), "{error}");
    let error = after(|rollout| rollout.ends = EndStates::new(&rollout.obs_kind));
    assert!(error.to_string().contains("next_obs"), "{error}");
    let error = after(|rollout| rollout.truncated[2] = true);
    assert!(error.to_string().contains("row 2"), "{error}");
    let error = after(|rollout| rollout.actions = Actions::Discrete(vec![3; rollout.rows()]));
    assert!(matches!(error, LearnError::Action(_)), "{error}");
    let error = after(|rollout| *rollout = Rollout::new(0, OBS, 0, &SPACE));
    assert!(error.to_string().contains("empty"), "{error}");
}

#[test]
fn settings_that_cannot_work_are_named() {
    for (name, config) in [
        ("batch", SacConfig { batch: 0, ..config() }),
        ("actor_every", SacConfig { actor_every: 0, ..config() }),
        ("critic_lr", SacConfig { critic_lr: f64::NAN, ..config() }),
        ("tau", SacConfig { tau: 1.5, ..config() }),
        ("gamma", SacConfig { gamma: -0.1, ..config() }),
        ("log_std", SacConfig { log_std: (2.0, -5.0), ..config() }),
        ("updates_per_step", SacConfig { updates_per_step: 0.0, ..config() }),
        (
            "`sac.entropy` initial",
            SacConfig { entropy: EntropyCoef::Auto { initial: 0.0, target_scale: None }, ..config() },
        ),
        ("entropy", SacConfig { entropy: EntropyCoef::Fixed(-1.0), ..config() }),
    ] {
        let error = SacLearner::new(config, SPEC, 1, DeviceKind::Flex).expect_err("bad settings");
        assert!(error.to_string().contains(name), "{error}");
    }
    let error = serde_json::from_str::<SacConfig>(r#"{"taw": 0.1}"#).expect_err("unknown key");
    assert!(error.to_string().contains("taw"), "{error}");
    let text = serde_json::to_string(&SacConfig::default()).expect("plain numbers");
    assert_eq!(serde_json::from_str::<SacConfig>(&text).expect("its own text"), SacConfig::default());
}
