//! Errors with names, instead of panics, for bad data and numbers that diverge.

use crate::corridor::config;
use crate::toy::{Driver, OBS, SPACE};
use playbot_learner::{
    Actions, DeviceKind, LearnError, Learner, Observations, PolicySpec, PpoConfig, PpoLearner, Rollout,
};

fn learner(config: PpoConfig) -> PpoLearner {
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings")
}

/// Returns the numbers of a rollout's vectors, to be changed.
pub fn vectors(observations: &mut Observations) -> &mut [f32] {
    let Observations::Vector(values) = observations else { panic!("the corridor is seen as vectors") };
    values
}

fn after(change: impl Fn(&mut Rollout)) -> LearnError {
    let mut learner = learner(PpoConfig { norm_reward: false, ..config() });
    let mut rollout = Driver::new(4, 1).rollout(&learner, 16);
    change(&mut rollout);
    learner.update(&rollout).expect_err("a bad rollout")
}

#[test]
fn numbers_that_run_away_are_named() {
    let error = after(|rollout| rollout.values[3] = f32::NAN);
    assert!(matches!(&error, LearnError::NotFinite { tensor, .. } if tensor == "policy_loss"), "{error}");
    let mut learner = learner(PpoConfig { lr: 1e30, ..config() });
    let mut driver = Driver::new(4, 1);
    let rollout = driver.rollout(&learner, 16);
    let result = (0..5).try_for_each(|_| learner.update(&rollout).map(|_| ()));
    assert!(matches!(result, Err(LearnError::NotFinite { .. })));
}

#[test]
fn numbers_that_are_not_finite_are_refused_before_anything_changes() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut learner = learner(PpoConfig { norm_obs: true, norm_reward: true, ..config() });
    let rollout = Driver::new(4, 1).rollout(&learner, 16);
    let bytes = |learner: &PpoLearner| {
        let path = folder.path().join("checkpoint");
        learner.save(&path).expect("written");
        std::fs::read(path).expect("readable")
    };
    let before = bytes(&learner);
    let changes: [(&str, fn(&mut Rollout)); 3] = [
        ("rollout rewards: row 3", |rollout| rollout.rewards[3] = f32::NAN),
        ("rollout obs: row 1", |rollout| vectors(&mut rollout.obs)[OBS] = f32::INFINITY),
        ("rollout ends next_obs: row 2", |rollout| vectors(&mut rollout.ends.next_obs)[2 * OBS] = f32::NAN),
    ];
    for (text, change) in changes {
        let mut bad = rollout.clone();
        change(&mut bad);
        let error = learner.update(&bad).expect_err("not finite");
        assert!(matches!(error, LearnError::Input { .. }) && error.to_string().starts_with(text), "{error}");
        assert!(bytes(&learner) == before, "{text}");
    }
    learner.update(&rollout).expect("finite");
}

#[test]
fn rollouts_that_do_not_fit_are_named() {
    let error = after(|rollout| rollout.values.truncate(3));
    assert!(error.to_string().contains("rollout values"), "{error}");
    let error = after(|rollout| rollout.actions = Actions::Discrete(vec![3; rollout.rows()]));
    assert!(matches!(error, LearnError::Action(_)), "{error}");
    let error = after(|rollout| *rollout = Rollout::new(4, OBS, 0, &SPACE));
    assert!(error.to_string().contains("next_values"), "{error}");
}

#[test]
fn a_policy_checks_its_inputs() {
    let policy = learner(config()).policy();
    assert!(matches!(policy.forward(&[], &[0.0; OBS + 1], 1), Err(LearnError::Shape { .. })));
    let error = policy.forward(&[], &[f32::NAN; OBS], 1).expect_err("not a number");
    assert_eq!(error.to_string(), "`actor output` is not finite");
    assert!(policy.forward(&[], &[0.0; 0], 0).expect("nothing to do").is_empty());
}

#[test]
fn settings_that_cannot_work_are_named() {
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    for (name, config) in [
        ("minibatches", PpoConfig { minibatches: 0, ..config() }),
        ("gamma", PpoConfig { gamma: 1.5, ..config() }),
        ("lr", PpoConfig { lr: f64::NAN, ..config() }),
        ("total_updates", PpoConfig { anneal_lr: true, ..config() }),
    ] {
        let error = PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect_err("bad settings");
        assert!(error.to_string().contains(name), "{error}");
    }
}
