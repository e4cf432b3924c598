//! How long the three things take that decide a training run's time: a forward pass, a PPO update and a skill epoch.
//!
//! `cargo run --release -p playbot_learner --example speed`, at the sizes of the CoinRun experiments. The last column
//! is a hash of all numbers: it must not change with `RAYON_NUM_THREADS`.
#![allow(clippy::print_stdout)]

use playbot_learner::nn::Parameters;
use playbot_learner::rng::{ChaCha8Rng, Streams, normal, unit};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DemoEpisode, DeviceKind, LearnError, Learner, PpoConfig, PpoLearner, Rollout,
    ScoreConfig, SkillConfig, SkillTrainer,
};
use std::ops::ControlFlow;
use std::time::Instant;

const OBS: usize = 530;
const CHOICES: usize = 15;
const ENVS: usize = 64;
const STEPS: usize = 256;
const DEMO_STEPS: usize = 100_000;

fn main() -> Result<(), LearnError> {
    let device = DeviceKind::Flex;
    let streams = Streams::new(1);
    let mut rng = streams.stream("data", 0);
    let space = ActionSpace::Discrete(CHOICES);
    let episodes = (0..DEMO_STEPS / 500)
        .map(|_| DemoEpisode {
            observations: observations(500, &mut rng).into(),
            actions: Actions::Discrete(choices(500, &mut rng)),
        })
        .collect();
    let dataset = Dataset::new(OBS, space, episodes)?;
    let mut trainer = SkillTrainer::new(SkillConfig::default(), dataset, 1, device)?;
    for _ in 0..2 {
        let start = Instant::now();
        trainer.train_epoch(&mut |_| ControlFlow::Continue(()))?;
        let seconds = start.elapsed().as_secs_f64();
        println!("skill epoch, {DEMO_STEPS} steps: {seconds:.2} s  {:016x}", hash(trainer.model().nets()));
    }
    let model = trainer.model();

    let config = PpoConfig::default();
    let mut learner = PpoLearner::with_skill(config, ScoreConfig::default(), &model, 1, device)?;
    let policy = learner.policy();
    let (z, obs) = (normals(ENVS * model.latent(), &mut rng), observations(ENVS, &mut rng));
    let start = Instant::now();
    let rounds = 200;
    for _ in 0..rounds {
        policy.forward(&z, &obs, ENVS)?;
    }
    let ms = start.elapsed().as_secs_f64() * 1000.0 / f64::from(rounds);
    println!("forward of {ENVS} rows: {ms:.3} ms");
    for _ in 0..3 {
        let rollout = rollout(&learner, model.latent(), &mut rng)?;
        let start = Instant::now();
        learner.update(&rollout)?;
        let seconds = start.elapsed().as_secs_f64();
        println!("SCORE-PPO update, {} rows: {seconds:.2} s  {:016x}", rollout.rows(), values(&learner, &z, &obs)?);
    }
    Ok(())
}

fn rollout(learner: &PpoLearner, latent: usize, rng: &mut ChaCha8Rng) -> Result<Rollout, LearnError> {
    let rows = ENVS * STEPS;
    let (obs, z) = (observations(rows, rng), normals(rows * latent, rng));
    let output = learner.policy().forward(&z, &obs, rows)?;
    let mut actions = Vec::with_capacity(rows);
    let mut log_probs = Vec::with_capacity(rows);
    for row in 0..rows {
        let (action, log_prob) = output.sample(row, rng);
        if let playbot_learner::Action::Discrete(action) = action {
            actions.push(action);
        }
        log_probs.push(log_prob);
    }
    Ok(Rollout {
        steps: STEPS,
        obs: obs.into(),
        z,
        actions: Actions::Discrete(actions),
        log_probs,
        values: output.values,
        rewards: normals(rows, rng),
        terminated: (0..rows).map(|_| unit(rng) < 0.01).collect(),
        truncated: vec![false; rows],
        final_values: vec![0.0; rows],
        next_values: vec![0.0; ENVS],
        ..Rollout::new(ENVS, OBS, latent, &learner.spec().action_space)
    })
}

/// Mostly zeros and ones, like the grid of tiles around a character.
fn observations(rows: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..rows * OBS).map(|_| if unit(rng) < 0.2 { 1.0 } else { 0.0 }).collect()
}

fn normals(n: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..n).map(|_| normal(rng)).collect()
}

fn choices(n: usize, rng: &mut ChaCha8Rng) -> Vec<u32> {
    (0..n).map(|_| (unit(rng) * CHOICES as f64) as u32).collect()
}

fn values(learner: &PpoLearner, z: &[f32], obs: &[f32]) -> Result<u64, LearnError> {
    let output = learner.policy().forward(z, obs, ENVS)?;
    Ok(output.head.iter().chain(&output.values).fold(0, mix))
}

fn mix(hash: u64, x: &f32) -> u64 {
    (hash ^ u64::from(x.to_bits())).wrapping_mul(0x0000_0100_0000_01B3).rotate_left(17)
}

fn hash(nets: &(impl Parameters + Clone)) -> u64 {
    struct Hash(u64);
    impl playbot_learner::nn::ParamVisitor for Hash {
        fn visit<const D: usize>(&mut self, _: &str, tensor: &mut burn::tensor::Tensor<D>) {
            let data = tensor.clone().into_data();
            let values = data.as_slice::<f32>().unwrap_or_default();
            self.0 = values.iter().fold(self.0, mix);
        }
    }
    let mut hash = Hash(0);
    nets.clone().visit("", &mut hash);
    hash.0
}
