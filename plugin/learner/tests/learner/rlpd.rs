//! RLPD: SAC with recordings in each batch, and an ensemble of normalised critics.

use crate::field::{Field, HURRY};
use crate::point::{self, SPEC, recordings, sac_config};
use playbot_learner::{DeviceKind, LearnError, Learner, RlpdConfig, SacConfig, SacLearner};

fn config() -> SacConfig {
    SacConfig { updates_per_step: 0.5, learning_starts: 64, norm_obs: true, ..sac_config() }
}

fn rlpd(rlpd: &RlpdConfig) -> SacLearner {
    let learner = SacLearner::with_demos(config(), rlpd, &recordings(100), SPEC, 1, DeviceKind::Flex);
    learner.expect("good settings")
}

fn small() -> RlpdConfig {
    RlpdConfig { critics: 4, ..RlpdConfig::default() }
}

/// Returns the success after this many steps of play.
fn success(mut learner: SacLearner, steps: u64) -> f64 {
    let mut field = Field::new(&HURRY, 8, 1);
    while learner.transitions() < steps {
        learner.update(&field.rollout(&learner, 8)).expect("finite");
    }
    point::success(&learner, 90)
}

#[test]
fn recordings_make_it_learn_sooner() {
    let steps = 512;
    let with = success(rlpd(&small()), steps);
    let without = success(SacLearner::new(config(), SPEC, 1, DeviceKind::Flex).expect("good settings"), steps);
    assert!(with > 0.85 && with > without + 0.1, "{with} with recordings, {without} without");
}

#[test]
fn the_ensemble_and_its_normalised_layers_are_in_the_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let (mut learner, mut field) = (rlpd(&small()), Field::new(&HURRY, 4, 1));
    let mut play = |learner: &SacLearner| field.rollout(learner, 32);
    learner.update(&play(&learner)).expect("finite");
    learner.save(&path).expect("written");
    let mut loaded = SacLearner::load(&path, DeviceKind::Flex).expect("read");
    for _ in 0..2 {
        let rollout = play(&learner);
        assert_eq!(learner.update(&rollout).expect("finite"), loaded.update(&rollout).expect("finite"));
    }
    let bytes = std::fs::read(&path).expect("readable");
    let names = String::from_utf8_lossy(&bytes[..20_000.min(bytes.len())]).into_owned();
    for name in ["\"q4.l1.norm.scale\"", "\"target.q1.l0.norm.shift\"", "\"demos.rewards\""] {
        assert!(names.contains(name), "{name}");
    }
    assert!(!names.contains("\"q5."));
}

#[test]
fn a_target_of_some_critics_is_not_that_of_all() {
    let loss = |target_critics| {
        let config = RlpdConfig { target_critics, ..small() };
        let (mut learner, mut field) = (rlpd(&config), Field::new(&HURRY, 4, 1));
        let metrics = learner.update(&field.rollout(&learner, 64)).expect("finite");
        metrics.qf_values.expect("steps were due")
    };
    assert!(loss(1) > loss(4), "the least of few is more than the least of all");
}

#[test]
fn what_cannot_work_is_refused() {
    let learner = |config: &RlpdConfig, demos: &[_]| {
        SacLearner::with_demos(sac_config(), config, demos, SPEC, 1, DeviceKind::Flex).expect_err("cannot work")
    };
    assert!(learner(&small(), &[]).to_string().contains("no steps"));
    let mut unpaid = recordings(3);
    unpaid.iter_mut().for_each(|episode| episode.rewards.fill(0.0));
    assert!(learner(&small(), &unpaid).to_string().contains("hold no reward"));
    let mut broken = recordings(3);
    broken[1].rewards[0] = f32::NAN;
    assert!(matches!(learner(&small(), &broken), LearnError::Input { .. }));
    let none = RlpdConfig { demo_share: 0.0, ..small() };
    assert!(learner(&none, &recordings(3)).to_string().contains("demo_share"));
}
