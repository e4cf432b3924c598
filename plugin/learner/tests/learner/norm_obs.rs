//! Observations of differing scale, through the skill model's frozen normaliser, for all networks that are tied to
//! it.

use playbot_learner::rng::{Streams, normal, unit};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, DeviceKind, EndStates, ImageShape, LearnError, Learner, ObsKind,
    PpoConfig, PpoLearner, Rollout, SacConfig, SacLearner, ScoreConfig, SkillConfig, SkillDraw, SkillMetrics,
    SkillModel, SkillTrainer, StdKind,
};
use std::ops::ControlFlow;

const OBS: usize = 4;
pub const PLANE: ActionSpace = ActionSpace::Continuous(2);
pub const CHOICE: ActionSpace = ActionSpace::Discrete(2);
/// Deviation of the noise on the demonstrators' continuous actions.
const NOISE: f32 = 0.1;

/// Returns observations of demonstrators in a hall: a position up to 50 m, an angle around 0.1, and a number that
/// never changes.
pub fn hall(n: usize, stream: u64) -> Vec<f32> {
    let mut rng = Streams::new(3).stream("hall", stream);
    let mut row = || [50.0 * unit(&mut rng) as f32, 50.0 * unit(&mut rng) as f32, 0.1 * normal(&mut rng), 1.25];
    (0..n).flat_map(|_| row()).collect()
}

/// Returns the intended action: turn against the angle, and move to the middle of the hall.
fn meant(row: &[f32]) -> [f32; 2] {
    [-6.0 * row[2], 1.0 - row[0] / 25.0]
}

/// Returns their recordings: vectors with noise, or the sign of the turn.
pub fn demos(space: ActionSpace) -> Dataset {
    let episodes = (0..60).map(|i| {
        let mut rng = Streams::new(4).stream("noise", i);
        let observations = hall(20, i);
        let wanted = observations.chunks_exact(OBS).map(meant);
        let actions = match space {
            ActionSpace::Discrete(_) => Actions::Discrete(wanted.map(|a| u32::from(a[0] > 0.0)).collect()),
            ActionSpace::Continuous(dim) => {
                let values = wanted.flatten().map(|a| a + NOISE * normal(&mut rng)).collect();
                Actions::Continuous { dim, values }
            }
            ActionSpace::Mixed(_) => panic!("a choice or a vector"),
        };
        DatasetEpisode { observations: observations.into(), actions }
    });
    Dataset::new(OBS, space, episodes.collect()).expect("consistent")
}

pub fn config(norm_obs: bool) -> SkillConfig {
    SkillConfig { norm_obs, ..crate::skill::config() }
}

pub fn trainer(config: SkillConfig, space: ActionSpace) -> SkillTrainer {
    SkillTrainer::new(config, demos(space), 1, DeviceKind::Flex).expect("windows fit")
}

/// Returns the metrics of the last of some epochs.
pub fn train(trainer: &mut SkillTrainer, epochs: usize) -> SkillMetrics {
    let epochs = (0..epochs).map(|_| trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite"));
    epochs.last().flatten().expect("not stopped")
}

pub fn model(space: ActionSpace) -> SkillModel {
    let mut trainer = trainer(config(true), space);
    train(&mut trainer, 3);
    trainer.into_model()
}

pub fn skills(model: &SkillModel, obs: &[f32]) -> Vec<f32> {
    model.prior().sample(obs, obs.len() / OBS, SkillDraw::Mean, &mut |_| 0.0).expect("finite")
}

#[test]
fn normalised_numbers_are_learned_from_faster() {
    for decoder_std in [StdKind::Vector, StdKind::State] {
        let last = |norm_obs| {
            let mut trainer = trainer(SkillConfig { decoder_std, ..config(norm_obs) }, PLANE);
            (train(&mut trainer, 20).nll, trainer.into_model())
        };
        let ((raw, _), (normalised, model)) = (last(false), last(true));
        // Five steps of two dimensions; -8.8 would leave nothing but the noise.
        assert!(normalised < raw - 2.5, "{decoder_std:?}: {normalised} normalised, {raw} raw");
        // In use, as in training, they are given raw.
        let obs = hall(50, 1000);
        let output = model.policy().forward(&skills(&model, &obs), &obs, 50).expect("finite");
        let wanted: Vec<f32> = obs.chunks_exact(OBS).flat_map(meant).collect();
        let error = output.head.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).sum::<f32>() / 100.0;
        assert!(error < 0.15, "{decoder_std:?}: mean error {error}");
    }
}

#[test]
fn a_value_that_no_demonstration_holds_stays_small() {
    let model = model(PLANE);
    let mut seen = [0.0; 4];
    model.obs_stats().expect("normalised").normalize_into(&[1e9, -1e9, 30.0, 3.25], &mut seen);
    assert_eq!(seen[..3], [10.0, -10.0, 10.0]);
    assert!((seen[3] - 2.0).abs() < 1e-5, "a constant is centred only: {}", seen[3]);
    let bare = trainer(config(false), PLANE).into_model();
    assert!(bare.obs_stats().is_none() && !bare.policy().normalises() && model.policy().normalises());
}

pub fn score(init_from_decoder: bool) -> ScoreConfig {
    ScoreConfig { init_from_decoder, ..ScoreConfig::default() }
}

pub fn ppo(score: ScoreConfig, model: &SkillModel) -> PpoLearner {
    let config = PpoConfig { lr: 1e-3, minibatches: 2, hidden: vec![32, 32], ..PpoConfig::default() };
    PpoLearner::with_skill(config, score, model, 1, DeviceKind::Flex).expect("good settings")
}

fn sac_config() -> SacConfig {
    SacConfig { learning_starts: 1, batch: 32, hidden: vec![32, 32], ..SacConfig::default() }
}

pub fn sac(score: ScoreConfig, model: &SkillModel) -> SacLearner {
    SacLearner::with_skill(sac_config(), score, model, 1, DeviceKind::Flex).expect("good settings")
}

#[test]
fn the_first_policy_is_the_decoder_exactly() {
    for decoder_std in [StdKind::Vector, StdKind::State] {
        let mut trainer = trainer(SkillConfig { decoder_std, ..config(true) }, PLANE);
        train(&mut trainer, 2);
        let model = trainer.into_model();
        for n in [1, 2, 33] {
            let obs = hall(n, 50);
            let z = skills(&model, &obs);
            let (tied, free) = (ppo(score(true), &model), ppo(score(false), &model));
            assert_eq!(tied.initial_kl(&z, (&obs).into(), n).expect("a copy"), Some(0.0));
            assert!(free.initial_kl(&z, (&obs).into(), n).expect("no copy") > Some(0.0));
        }
    }
    let model = model(CHOICE);
    let obs = hall(33, 50);
    let tied = sac(score(true), &model);
    assert_eq!(tied.initial_kl(&skills(&model, &obs), (&obs).into(), 33).expect("a copy"), Some(0.0));
}

/// Returns a rollout of independent states in which turning right is rewarded.
pub fn rollout(learner: &impl Learner, space: ActionSpace, number: u64) -> Rollout {
    let (steps, envs) = (8, 4);
    let rows = steps * envs;
    let (prior, obs) = (learner.prior().expect("skills"), hall(rows, 100 + number));
    let mut rng = Streams::new(2).stream("rollout", number);
    let z = prior.sample(&obs, rows, SkillDraw::Sample, &mut |_| normal(&mut rng)).expect("finite");
    let output = learner.policy().forward(&z, &obs, rows).expect("finite");
    let (mut actions, mut log_probs) = (Actions::empty(&space), Vec::new());
    for row in 0..rows {
        let (action, log_prob) = output.sample(row, &mut rng);
        actions.push(&action).expect("of the space");
        log_probs.push(log_prob);
    }
    let rewards = match &actions {
        Actions::Discrete(choices) => choices.iter().map(|&a| a as f32).collect(),
        Actions::Continuous { values, .. } => values.chunks_exact(2).map(|a| a[0]).collect(),
        Actions::Mixed { .. } => panic!("a choice or a vector"),
    };
    let next_z = z[..envs * prior.latent()].to_vec();
    let ends = EndStates { next_obs: hall(envs, 200 + number).into(), next_z, ..EndStates::new(&ObsKind::Vector(OBS)) };
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
        ends,
        ..Rollout::new(envs, OBS, prior.latent(), &space)
    }
}

#[test]
fn what_cannot_be_normalised_is_refused() {
    for init_from_decoder in [true, false] {
        let running = PpoConfig { norm_obs: true, ..PpoConfig::default() };
        let error = PpoLearner::with_skill(running, score(init_from_decoder), &model(PLANE), 1, DeviceKind::Flex);
        let error = error.expect_err("two normalisers");
        assert!(matches!(&error, LearnError::Config(text) if text.contains("same frozen normaliser")), "{error}");
        let running = SacConfig { norm_obs: true, ..sac_config() };
        let error = SacLearner::with_skill(running, score(init_from_decoder), &model(CHOICE), 1, DeviceKind::Flex);
        assert!(error.expect_err("two normalisers").to_string().contains("same frozen normaliser"));
    }
    let image = ImageShape { channels: 1, height: 12, width: 12 };
    let episode = DatasetEpisode { observations: vec![0u8; 8 * 144].into(), actions: Actions::Discrete(vec![0; 8]) };
    let data = Dataset::new(ObsKind::Image(image), CHOICE, vec![episode]).expect("consistent");
    let error = SkillTrainer::new(config(true), data, 1, DeviceKind::Flex).expect_err("pixels");
    assert!(matches!(&error, LearnError::Setting(error) if error.why.contains("is for vectors")), "{error}");
}
