//! SCORE-SAC: the skill as input, the copy of the decoder, and the penalty under SAC.

use crate::sac::config;
use crate::score::model;
use crate::toy::{Driver, OBS};
use playbot_learner::rng::{Streams, normal};
use playbot_learner::{
    ActionSpace, ActionValue, Actions, ConfidenceKind, Dataset, DatasetEpisode, DeviceKind, EndStates, EntropyCoef,
    KlDirection, LearnError, Learner, ObsKind, Observations, Rollout, SacConfig, SacLearner, ScoreConfig, SkillModel,
    SkillTrainer,
};
use std::ops::ControlFlow;

fn learner(config: SacConfig, score: ScoreConfig, model: &SkillModel) -> SacLearner {
    SacLearner::with_skill(config, score, model, 1, DeviceKind::Flex).expect("good settings")
}

fn inputs(n: usize, obs_dim: usize) -> (Vec<f32>, Vec<f32>) {
    let mut rng = Streams::new(9).stream("inputs", 0);
    let mut draw = |len: usize| (0..len).map(|_| normal(&mut rng)).collect();
    (draw(n * 2), draw(n * obs_dim))
}

#[test]
fn a_discrete_actor_starts_as_the_decoder_exactly() {
    let model = model(1);
    let (z, obs) = inputs(33, OBS);
    let tied = learner(config(), ScoreConfig::default(), &model);
    assert_eq!(tied.initial_kl(&z, (&obs).into(), 33).expect("a copy"), Some(0.0));
    // It plays itself though learning has not started.
    let (played, decoded) = (tied.policy().forward(&z, &obs, 33), model.policy().forward(&z, &obs, 33));
    assert_eq!(played.expect("finite").head, decoded.expect("finite").head);
    let free = learner(config(), ScoreConfig { init_from_decoder: false, ..ScoreConfig::default() }, &model);
    assert!(free.initial_kl(&z, (&obs).into(), 33).expect("no copy") > Some(0.0));
}

/// Returns the divergence between decoder and actor after 1000 transitions with a given penalty.
fn divergence(model: &SkillModel, score: ScoreConfig) -> f32 {
    let mut learner = learner(config(), score.clone(), model);
    let mut driver = Driver::new(8, 1);
    let mut observed = (Vec::new(), Observations::empty(&OBS.into()));
    while learner.transitions() < 1000 {
        let rollout = driver.rollout(&learner, 8);
        let metrics = learner.update(&rollout).expect("finite");
        assert_eq!(metrics.decoder_kl.is_some(), score.kl && metrics.actor_loss.is_some());
        observed = (rollout.z, rollout.obs);
    }
    let (z, obs) = observed;
    learner.initial_kl(&z, (&obs).into(), obs.numbers() / OBS).expect("updated").expect("a skill model")
}

#[test]
fn the_penalty_keeps_a_discrete_actor_near() {
    let model = model(1);
    let free = divergence(&model, ScoreConfig { kl: false, ..ScoreConfig::default() });
    assert!(free > 0.02, "without a penalty the policy leaves: {free}");
    for kl_direction in [KlDirection::DecoderPolicy, KlDirection::PolicyDecoder] {
        let held = divergence(&model, ScoreConfig { kl_coef: 10.0, kl_direction, ..ScoreConfig::default() });
        assert!(held < 0.3 * free, "with one it stays: {held} of {free}, {kl_direction:?}");
    }
}

/// Returns a model of demonstrators that move by (0.5 x, -x).
fn continuous_model() -> SkillModel {
    let streams = Streams::new(5);
    let episodes = (0..60).map(|i| {
        let mut rng = streams.stream("demo", i);
        let observations: Vec<f32> = (0..20).map(|_| normal(&mut rng)).collect();
        let values = observations.iter().flat_map(|x| [0.5 * x, -x]).collect();
        DatasetEpisode { observations: observations.into(), actions: Actions::Continuous { dim: 2, values } }
    });
    let data = Dataset::new(1, ActionSpace::Continuous(2), episodes.collect()).expect("consistent");
    let mut trainer = SkillTrainer::new(crate::skill::config(), data, 3, DeviceKind::Flex).expect("windows fit");
    for _ in 0..20 {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer.into_model()
}

/// Returns rows of random skills, observations and actions; action (1, 1) is best.
fn random_rollout(seed: u64, n: usize) -> Rollout {
    let mut rng = Streams::new(seed).stream("rollout", 0);
    let mut draw = |len: usize| (0..len).map(|_| normal(&mut rng).tanh()).collect::<Vec<f32>>();
    let (obs, z, values) = (draw(n), draw(2 * n), draw(2 * n));
    Rollout {
        steps: 1,
        rewards: values.chunks_exact(2).map(|a| a[0] + a[1]).collect(),
        obs: obs.into(),
        z,
        actions: Actions::Continuous { dim: 2, values },
        log_probs: vec![0.0; n],
        values: vec![0.0; n],
        terminated: vec![true; n],
        truncated: vec![false; n],
        final_values: vec![0.0; n],
        next_values: vec![0.0; n],
        ends: EndStates {
            next_obs: vec![0.0; n].into(),
            next_z: vec![0.0; 2 * n],
            ..EndStates::new(&ObsKind::Vector(1))
        },
        ..Rollout::new(n, 1, 2, &ActionSpace::Continuous(2))
    }
}

/// Returns the mean distance of the actor's median action from the decoder's mean, and the divergence, after
/// training.
fn distance(model: &SkillModel, score: ScoreConfig) -> (f32, f32) {
    let config = SacConfig { learning_starts: 1, entropy: EntropyCoef::Fixed(0.05), updates_per_step: 2.0, ..config() };
    let mut learner = learner(config, score, model);
    for seed in 0..4 {
        learner.update(&random_rollout(seed, 128)).expect("finite");
    }
    let probe = random_rollout(9, 64);
    let played = learner.policy().forward(&probe.z, &probe.obs, 64).expect("finite");
    let decoded = model.policy().forward(&probe.z, &probe.obs, 64).expect("finite");
    let mut sum = 0.0;
    for row in 0..64 {
        let (ActionValue::Continuous(a), ActionValue::Continuous(b)) = (played.greedy(row), decoded.greedy(row)) else {
            panic!("continuous")
        };
        sum += a.iter().zip(&b).map(|(x, y)| (x - y.clamp(-1.0, 1.0)).abs()).sum::<f32>() / 128.0;
    }
    (sum, learner.initial_kl(&probe.z, (&probe.obs).into(), 64).expect("updated").expect("a skill model"))
}

#[test]
fn the_penalty_leads_a_continuous_actor_to_the_decoder() {
    let model = continuous_model();
    let base = || ScoreConfig { init_from_decoder: false, confidence: ConfidenceKind::Off, ..ScoreConfig::default() };
    let free = distance(&model, ScoreConfig { kl: false, ..base() });
    assert!(free.0 > 0.4, "without a penalty it goes where the reward is: {free:?}");
    for kl_direction in [KlDirection::DecoderPolicy, KlDirection::PolicyDecoder] {
        let held = distance(&model, ScoreConfig { kl_coef: 10.0, kl_direction, ..base() });
        assert!(held.0 < 0.15, "{kl_direction:?}: {held:?} of {free:?}");
        assert!(held.1 < 0.3 * free.1, "{kl_direction:?}: {held:?} of {free:?}");
    }
}

#[test]
fn a_squashed_actor_cannot_be_a_copy_and_the_error_says_what_to_do() {
    let model = continuous_model();
    let error = SacLearner::with_skill(config(), ScoreConfig::default(), &model, 1, DeviceKind::Flex);
    let error = error.expect_err("an exact copy is impossible");
    assert!(matches!(error, LearnError::Config(_)));
    assert!(error.to_string().contains("init_from_decoder to false"), "{error}");
}

#[test]
fn a_loaded_learner_with_skills_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let mut first = learner(SacConfig { learning_starts: 1, ..config() }, ScoreConfig::default(), &model(1));
    let mut driver = Driver::new(4, 1);
    first.update(&driver.rollout(&first, 8)).expect("finite");
    first.save(&path).expect("written");
    let mut second = SacLearner::load(&path, DeviceKind::Flex).expect("read");
    let rollout = driver.rollout(&first, 8);
    assert_eq!(first.update(&rollout).expect("finite"), second.update(&rollout).expect("finite"));
    assert_eq!(first.score_config(), second.score_config());
}
