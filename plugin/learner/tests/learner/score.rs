//! SCORE-PPO: the policy starts as the decoder, stays near it if it must, and each switch works.

use crate::corridor;
use crate::skill::corridor_demos;
use crate::toy::{Driver, OBS};
use playbot_learner::rng::{Streams, normal};
use playbot_learner::{
    DeviceKind, LearnError, PenaltyForm, PpoConfig, PpoLearner, PriorKind, ScoreConfig, SkillModel, SkillTrainer,
};
use std::ops::ControlFlow;

pub fn model(epochs: usize) -> SkillModel {
    let mut trainer =
        SkillTrainer::new(crate::skill::config(), corridor_demos(100), 1, DeviceKind::Flex).expect("windows fit");
    for _ in 0..epochs {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer.into_model()
}

fn inputs(n: usize) -> (Vec<f32>, Vec<f32>) {
    let mut rng = Streams::new(9).stream("inputs", 0);
    let mut draw = |len: usize| (0..len).map(|_| normal(&mut rng)).collect();
    (draw(n * 2), draw(n * OBS))
}

fn learner(config: PpoConfig, score: ScoreConfig, model: &SkillModel) -> PpoLearner {
    PpoLearner::with_skill(config, score, model, 1, DeviceKind::Flex).expect("good settings")
}

#[test]
fn the_first_policy_is_the_decoder_exactly() {
    let model = model(1);
    let (z, obs) = inputs(33);
    for n in [1, 2, 33] {
        let (z, obs) = (&z[..n * 2], &obs[..n * OBS]);
        let tied = learner(PpoConfig::default(), ScoreConfig::default(), &model);
        assert_eq!(tied.initial_kl(z, obs, n).expect("a copy"), Some(0.0));
        let score = ScoreConfig { init_from_decoder: false, ..ScoreConfig::default() };
        let free = learner(PpoConfig::default(), score, &model);
        assert!(free.initial_kl(z, obs, n).expect("no copy") > Some(0.0));
    }
}

/// After one update with a given weight of the penalty: the unweighted divergence of the last update's rows.
fn divergence(model: &SkillModel, kl_coef: f64) -> f32 {
    let score = ScoreConfig { kl_coef, ..ScoreConfig::default() };
    let mut learner = learner(corridor::config(), score, model);
    let mut driver = Driver::new(8, 1);
    let mut last = 0.0;
    for _ in 0..5 {
        let rollout = driver.rollout(&learner, 32);
        let metrics = learner.update(&rollout).expect("finite");
        last = metrics.decoder_kl.expect("penalised");
        let alpha = metrics.alpha_mean.expect("penalised");
        assert!((0.0..=1.0).contains(&alpha), "a probability, not {alpha}");
    }
    let (z, obs) = inputs(16);
    assert!(learner.initial_kl(&z, &obs, 16).expect("updated") > Some(0.0));
    last
}

#[test]
fn the_penalty_holds_the_policy_back() {
    let model = model(1);
    let (free, held) = (divergence(&model, 0.0), divergence(&model, 30.0));
    assert!(free > 0.01, "without a penalty the policy leaves: {free}");
    assert!(held < 0.3 * free, "with one it stays: {held} of {free}");
}

#[test]
fn score_solves_the_corridor_from_the_first_rollout() {
    let model = model(8);
    let mut learner = learner(corridor::config(), ScoreConfig::default(), &model);
    let mut driver = Driver::new(8, 1);
    driver.rollout(&learner, 100);
    assert!(driver.recent(1000) < 12.0, "the decoder walks: {}", driver.recent(1000));
    for _ in 0..20 {
        let rollout = driver.rollout(&learner, 32);
        learner.update(&rollout).expect("finite");
    }
    assert!(driver.recent(40) < 7.0, "and learns to dawdle less: {}", driver.recent(40));
}

#[test]
fn every_switch_works() {
    let model = model(1);
    let base = ScoreConfig::default;
    let unconditioned = ScoreConfig { condition: false, init_from_decoder: false, ..base() };
    for score in [
        unconditioned.clone(),
        ScoreConfig { kl: false, ..base() },
        ScoreConfig { prior: PriorKind::StandardNormal, ..base() },
        ScoreConfig { alpha: playbot_learner::AlphaKind::PolicyAction, ..base() },
        ScoreConfig { kl_direction: playbot_learner::KlDirection::PolicyDecoder, ..base() },
        ScoreConfig { alpha: playbot_learner::AlphaKind::BoundedDensity, ..base() },
        ScoreConfig { penalty: PenaltyForm::LegacyCoinrun, ..base() },
    ] {
        let mut learner = learner(corridor::config(), score.clone(), &model);
        let rollout = Driver::new(4, 1).rollout(&learner, 16);
        assert_eq!(rollout.latent, 2);
        let metrics = learner.update(&rollout).expect("finite");
        assert_eq!(metrics.decoder_kl.is_some(), score.kl);
    }
    let bad = ScoreConfig { penalty: PenaltyForm::LegacyD4rl, ..base() };
    let error = PpoLearner::with_skill(corridor::config(), bad, &model, 1, DeviceKind::Flex);
    assert!(error.expect_err("discrete actions").to_string().contains("LegacyD4rl is for continuous actions"));
    let bad = ScoreConfig { init_from_decoder: true, ..unconditioned };
    let error = PpoLearner::with_skill(corridor::config(), bad, &model, 1, DeviceKind::Flex);
    assert!(matches!(error, Err(LearnError::Config(_))));
    let bad = PpoConfig { norm_obs: true, ..corridor::config() };
    let error = PpoLearner::with_skill(bad, base(), &model, 1, DeviceKind::Flex);
    assert!(matches!(error, Err(LearnError::Config(_))));
}
