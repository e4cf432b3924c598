//! How long one training step takes at the sizes of the paper: the skill model, a small tanh network, and one
//! minibatch of PPO on CoinRun; and both image encoders on 64×64 RGB, from bytes to features alone and as a step.
//!
//! `cargo run --release -p playbot_learner --example steps`. Each step is forward, backward and Adam; every line has
//! the best and the median time in milliseconds, and the number of steps timed. `--json` prints one object per line;
//! any other word runs only the cases whose names have it.
//! The last column is a hash of what was computed: it must not change with `RAYON_NUM_THREADS`.
#![allow(clippy::print_stdout)]

use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{
    ActionBatch, Activation, Adam, AdamConfig, CnnKind, ImageNet, Mlp, NamedGrads, ObsBatch, tracked,
};
use playbot_learner::policy::{Actor, Critic, NetShape};
use playbot_learner::ppo::{Minibatch, PpoBatch, PpoNets, gradient_step};
use playbot_learner::rng::{ChaCha8Rng, Streams, normal, unit};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DemoEpisode, DeviceKind, ImageShape, LearnError, PpoConfig, SkillConfig,
    SkillTrainer, StdKind,
};
use std::time::Instant;

const DEVICE: DeviceKind = DeviceKind::Flex;

fn main() -> Result<(), LearnError> {
    skill(60)?;
    for batch in [64, 512] {
        mlp(batch, 400)?;
    }
    ppo(60)?;
    for (batch, rounds) in [(64, 30), (250, 12), (2048, 3)] {
        cnn("Nature", &CnnKind::Nature { feature: 512 }, batch, rounds)?;
        cnn("IMPALA", &CnnKind::default(), batch, rounds.div_ceil(3))?;
    }
    Ok(())
}

/// The paper's skill model on vectors of AntMaze's size.
fn skill(rounds: usize) -> Result<(), LearnError> {
    let (obs_dim, action_dim, steps) = (29, 8, 2000);
    let config = SkillConfig { encoder_hidden: 200, gru_hidden: 200, gru_layers: 4, ..SkillConfig::default() };
    let mut rng = Streams::new(1).stream("data", 0);
    let episodes = (0..20)
        .map(|_| DemoEpisode {
            observations: normals(steps * obs_dim, &mut rng).into(),
            actions: Actions::Continuous { dim: action_dim, values: normals(steps * action_dim, &mut rng) },
        })
        .collect();
    let dataset = Dataset::new(obs_dim, ActionSpace::Continuous(action_dim), episodes)?;
    let mut trainer = SkillTrainer::new(config, dataset, 1, DEVICE)?;
    time("skill, 4-layer GRU 200, batch 50, window 10", rounds, || Ok(f64::from(trainer.train_batch()?.loss)))
}

/// A regression on 8 numbers through two hidden layers of 200.
fn mlp(batch: usize, rounds: usize) -> Result<(), LearnError> {
    let mut rng = Streams::new(1).stream("mlp", 0);
    let device = DEVICE.plain();
    let mut net = tracked(&Mlp::new(37, &[200, 200], 8, Activation::Tanh, 1.0, &mut rng, &device));
    let mut adam = Adam::new(AdamConfig::default());
    let mut tensor = |width: usize| -> Tensor<2> {
        Tensor::from_data(TensorData::new(normals(batch * width, &mut rng), [batch, width]), &device)
    };
    let (x, target) = (tensor(37), tensor(8));
    time(&format!("MLP 37-200-200-8 tanh, batch {batch}"), rounds, || {
        let loss = (net.forward(x.clone()) - target.clone()).square().mean();
        let grads = NamedGrads::take(&mut net, "", loss.backward())?;
        adam.step(&mut net, "", &grads, 3e-4, 1.0)?;
        Ok(grads.norm())
    })
}

/// Actor and critic of CoinRun's experiments.
fn ppo(rounds: usize) -> Result<(), LearnError> {
    let (obs_dim, choices, rows) = (563, 15, 2048);
    let streams = Streams::new(1);
    let mut rng = streams.stream("ppo", 0);
    let device = DEVICE.plain();
    let shape = NetShape { obs_dim, latent: 0, hidden: vec![200, 200], activation: Activation::Relu };
    let space = ActionSpace::Discrete(choices);
    let mut nets = tracked(&PpoNets {
        actor: Actor::new(&shape, space, StdKind::Vector, &mut rng, &device),
        critic: Critic::new(&shape, &mut rng, &device),
    });
    let inputs = (0..rows * obs_dim).map(|_| if unit(&mut rng) < 0.2 { 1.0 } else { 0.0 }).collect::<Vec<f32>>();
    let actions = (0..rows).map(|_| (unit(&mut rng) * choices as f64) as u32).collect();
    let mut column = || Tensor::<1>::from_data(TensorData::new(normals(rows, &mut rng), [rows]), &device);
    let batch = Minibatch {
        inputs: Tensor::<2>::from_data(TensorData::new(inputs, [rows, obs_dim]), &device).into(),
        ppo: PpoBatch {
            actions: ActionBatch::new(&Actions::Discrete(actions), &device),
            old_log_probs: column() * 0.01 - (choices as f32).ln(),
            advantages: column(),
            old_values: column(),
            returns: column(),
        },
        teacher: None,
    };
    let config = PpoConfig::default();
    let mut adam = Adam::new(AdamConfig::default());
    time("PPO 563-200-200-15 relu, batch 2048", rounds, || {
        Ok(gradient_step(&mut nets, &mut adam, &batch, &config, None, 3e-4)?.grad_norm)
    })
}

/// The features of a batch of images, and a step towards others.
fn cnn(name: &str, kind: &CnnKind, batch: usize, rounds: usize) -> Result<(), LearnError> {
    let mut rng = Streams::new(1).stream("cnn", 0);
    let device = DEVICE.plain();
    let image = ImageShape { channels: 3, height: 64, width: 64 };
    let frozen = ImageNet::new(kind, image, &mut rng, &device)?;
    let mut net = tracked(&frozen);
    let pixels: Vec<u8> = (0..batch * image.numbers()).map(|_| (unit(&mut rng) * 256.0) as u8).collect();
    let target = normals(batch * kind.features(), &mut rng);
    let target = Tensor::<2>::from_data(TensorData::new(target, [batch, kind.features()]), &device);
    let features = |net: &ImageNet| {
        let shape = [batch, image.channels, image.height, image.width];
        match ObsBatch::pixels(pixels.clone(), shape, &device) {
            ObsBatch::Image(x) => Ok(net.forward(x)),
            ObsBatch::Vector(_) => Err(LearnError::Config("pixels are images".to_owned())),
        }
    };
    time(&format!("{name} 64x64x3, batch {batch}, features alone"), rounds, || {
        let sum = features(&frozen)?.sum().into_scalar::<f32>();
        Ok(f64::from(sum))
    })?;
    let mut adam = Adam::new(AdamConfig::default());
    time(&format!("{name} 64x64x3, batch {batch}"), rounds, || {
        let loss = (features(&net)? - target.clone()).square().mean();
        let grads = NamedGrads::take(&mut net, "", loss.backward())?;
        adam.step(&mut net, "", &grads, 3e-4, 1.0)?;
        Ok(grads.norm())
    })
}

fn normals(n: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..n).map(|_| normal(rng)).collect()
}

/// Runs `step` some times to warm up, then `rounds` times, and prints how long that took.
fn time(name: &str, rounds: usize, mut step: impl FnMut() -> Result<f64, LearnError>) -> Result<(), LearnError> {
    if std::env::args().skip(1).any(|word| !word.starts_with("--") && !name.contains(&word)) {
        return Ok(());
    }
    let mut hash = 0u64;
    let mut times = Vec::with_capacity(rounds);
    for round in 0..rounds + rounds / 10 {
        let start = Instant::now();
        let result = step()?;
        if round >= rounds / 10 {
            times.push(start.elapsed().as_secs_f64() * 1000.0);
        }
        hash = (hash ^ result.to_bits()).wrapping_mul(0x0000_0100_0000_01B3).rotate_left(17);
    }
    times.sort_by(f64::total_cmp);
    let (best, median) = (times[0], times[rounds / 2]);
    if std::env::args().any(|arg| arg == "--json") {
        println!(
            "{{\"case\":\"{name}\",\"best_ms\":{best:.3},\"median_ms\":{median:.3},\"steps\":{rounds},\"hash\":\"{hash:016x}\"}}"
        );
    } else {
        println!("{name:<45} best {best:8.3} ms  median {median:8.3} ms  of {rounds}  {hash:016x}");
    }
    Ok(())
}
