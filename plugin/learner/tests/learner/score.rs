//! SCORE-PPO: the policy starts as the decoder, and stays near it under the penalty.

use crate::corridor;
use crate::skill::{continuous_demos, corridor_demos};
use crate::toy::{Driver, OBS};
use playbot_learner::rng::{Streams, normal};
use playbot_learner::{
    Actions, DeviceKind, Learner, PenaltyForm, PpoConfig, PpoLearner, Rollout, ScoreConfig, SkillModel, SkillTrainer,
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
        assert_eq!(tied.initial_kl(z, obs.into(), n).expect("a copy"), Some(0.0));
        let score = ScoreConfig { init_from_decoder: false, ..ScoreConfig::default() };
        let free = learner(PpoConfig::default(), score, &model);
        assert!(free.initial_kl(z, obs.into(), n).expect("no copy") > Some(0.0));
    }
}

/// Returns the unweighted divergence in the last of five updates with a given weight of the penalty.
fn divergence(model: &SkillModel, kl_coef: f64) -> f32 {
    let score = ScoreConfig { kl_coef, ..ScoreConfig::default() };
    let mut learner = learner(corridor::config(), score, model);
    let mut driver = Driver::new(8, 1);
    let mut last = 0.0;
    for _ in 0..5 {
        let rollout = driver.rollout(&learner, 32);
        let metrics = learner.update(&rollout).expect("finite");
        last = metrics.decoder_kl.expect("penalised");
        // The mean probability of a draw is Σ p², at least 1/3 for three choices; players waver, so it is not 1.
        let confidence = metrics.confidence.expect("penalised");
        assert!((0.32..0.95).contains(&confidence), "{confidence}");
    }
    let (z, obs) = inputs(16);
    assert!(learner.initial_kl(&z, (&obs).into(), 16).expect("updated") > Some(0.0));
    last
}

#[test]
fn the_penalty_holds_the_policy_back() {
    let model = model(1);
    let (free, held) = (divergence(&model, 0.0), divergence(&model, 30.0));
    assert!(free > 0.01, "without a penalty the policy leaves: {free}");
    assert!(held < 0.3 * free, "with one it stays: {held} of {free}");
}

/// Returns actions of the policy for random observations and skills, with meaningless rewards.
fn aimless_rollout(learner: &PpoLearner, update: u64) -> Rollout {
    let (steps, envs) = (32, 4);
    let rows = steps * envs;
    let mut rng = Streams::new(2).stream("aimless", update);
    let mut draw = |n: usize| -> Vec<f32> { (0..n).map(|_| normal(&mut rng)).collect() };
    let (z, obs, rewards) = (draw(rows * 2), draw(rows), draw(rows));
    let output = learner.policy().forward(&z, &obs, rows).expect("finite");
    let mut actions = Actions::Continuous { dim: 2, values: Vec::new() };
    let mut log_probs = Vec::new();
    for row in 0..rows {
        let (action, log_prob) = output.sample(row, &mut rng);
        actions.push(&action).expect("continuous");
        log_probs.push(log_prob);
    }
    Rollout {
        steps,
        obs: obs.into(),
        z,
        actions,
        log_probs,
        values: output.values,
        rewards,
        terminated: vec![false; rows],
        truncated: vec![false; rows],
        final_values: vec![0.0; rows],
        next_values: vec![0.0; envs],
        ..Rollout::new(envs, 1, 2, &learner.spec().action_space)
    }
}

#[test]
fn the_legacy_penalty_for_mazes_drives_the_policy_away() {
    let trainer = SkillTrainer::new(crate::skill::config(), continuous_demos(), 1, DeviceKind::Flex);
    let model = trainer.expect("windows fit").into_model();
    let divergence = |penalty, kl_coef| {
        let score = ScoreConfig { penalty, kl_coef, ..ScoreConfig::default() };
        let mut learner = learner(corridor::config(), score, &model);
        let updates = (0..6).map(|i| {
            let rollout = aimless_rollout(&learner, i);
            learner.update(&rollout).expect("finite").decoder_kl.expect("penalised")
        });
        updates.last().expect("six of them")
    };
    let free = divergence(PenaltyForm::Mean, 0.0);
    let (held, driven) = (divergence(PenaltyForm::Mean, 10.0), divergence(PenaltyForm::LegacyD4rl, 0.001));
    assert!(held < 0.5 * free && driven > 2.0 * free, "{held} held, {free} free, {driven} as released");
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
