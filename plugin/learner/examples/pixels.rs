//! Where the time of PPO from pixels goes: the parts of a gradient step, the forward pass of a tick and whole updates, of
//! Nature- and IMPALA-networks over 64×64 images in colour. All times are the best of several.
//!
//! `cargo run --release --workspace --example pixels`. 64 environments, 128 steps, 3 passes in 8 minibatches; any other word
//! runs only the cases whose names have it. The last column is a hash of the policy, which must not change with
//! `RAYON_NUM_THREADS`.
#![allow(clippy::print_stdout)]

use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionBatch, Activation, Adam, AdamConfig, CnnKind, ImageNet, ObsBatch, tracked};
use playbot_learner::policy::{Actor, Critic, NetInput, NetShape};
use playbot_learner::ppo::{Minibatch, PpoBatch, PpoNets, gradient_step};
use playbot_learner::rng::{ChaCha8Rng, Streams, below, normal, unit};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DemoEpisode, DeviceKind, ImageShape, LearnError, Learner, Observations, PolicySpec,
    PpoConfig, PpoLearner, Rollout, ScoreConfig, SkillConfig, SkillTrainer, StdKind,
};
use std::time::Instant;

const DEVICE: DeviceKind = DeviceKind::Flex;
const IMAGE: ImageShape = ImageShape { channels: 3, height: 64, width: 64 };
const SPACE: ActionSpace = ActionSpace::Discrete(15);
const ENVS: usize = 64;
const STEPS: usize = 128;

fn main() -> Result<(), LearnError> {
    let nature = CnnKind::Nature { feature: 512 };
    let small = CnnKind::Nature { feature: 128 };
    for (name, cnn) in [("nature 512", nature), ("nature 128", small), ("impala", CnnKind::default())] {
        if std::env::args().skip(1).any(|word| !name.contains(&word)) {
            continue;
        }
        split(name, &cnn)?;
        let config = PpoConfig { num_steps: STEPS, cnn: cnn.clone(), ..PpoConfig::default() };
        let spec = PolicySpec { obs: IMAGE.into(), latent: 0, action_space: SPACE };
        case(&format!("ppo {name}"), PpoLearner::new(config.clone(), spec, 1, DEVICE)?)?;
        let mut rng = Streams::new(1).stream("demo", 0);
        let episode = DemoEpisode { observations: pixels(10, &mut rng), actions: Actions::Discrete(vec![0; 10]) };
        let dataset = Dataset::new(IMAGE, SPACE, vec![episode])?;
        let model = SkillTrainer::new(SkillConfig { cnn, ..SkillConfig::default() }, dataset, 1, DEVICE)?.into_model();
        let score = ScoreConfig::default();
        case(&format!("score-ppo {name}"), PpoLearner::with_skill(config, score, &model, 1, DEVICE)?)?;
    }
    Ok(())
}

/// The parts of one gradient step, on a minibatch of 1024 images.
fn split(name: &str, cnn: &CnnKind) -> Result<(), LearnError> {
    let (device, rows) = (DEVICE.plain(), ENVS * STEPS / 8);
    let mut rng = Streams::new(1).stream("split", 0);
    let shape = NetShape { obs_dim: cnn.features(), latent: 0, hidden: vec![200, 200], activation: Activation::Relu };
    let trunk = ImageNet::new(cnn, IMAGE, &mut rng, &device)?;
    let actor = Actor::new(&shape, SPACE, StdKind::Vector, &mut rng, &device);
    let critic = Critic::new(&shape, &mut rng, &device);
    let heads = PpoNets { actor: actor.clone(), critic: critic.clone() };
    let whole = PpoNets { actor: actor.with_cnn(trunk.clone()), critic };
    let Observations::Image(bytes) = pixels(rows, &mut rng) else { return Ok(()) };
    let images = || match ObsBatch::pixels(bytes.clone(), [rows, 3, 64, 64], &device) {
        ObsBatch::Image(x) => x,
        ObsBatch::Vector(_) => unreachable!("made of pixels"),
    };
    let x = images();
    let features = trunk.forward(x.clone());
    let column = |value: f32| Tensor::<1>::full([rows], value, &device);
    let ppo = PpoBatch {
        actions: ActionBatch::new(&Actions::Discrete((0..rows).map(|_| below(&mut rng, 15) as u32).collect()), &device),
        old_log_probs: column(-15.0f32.ln()),
        advantages: Tensor::from_data(
            TensorData::new((0..rows).map(|_| normal(&mut rng)).collect::<Vec<f32>>(), [rows]),
            &device,
        ),
        old_values: column(0.0),
        returns: column(1.0),
    };
    let step = |nets: &PpoNets, inputs: NetInput| {
        let (mut nets, mut adam) = (tracked(nets), Adam::new(AdamConfig::default()));
        let batch = Minibatch { inputs, ppo: ppo.clone(), teacher: None };
        best(5, || gradient_step(&mut nets, &mut adam, &batch, &PpoConfig::default(), None, 1e-4).map(drop))
    };
    let to_numbers = best(5, || {
        images();
        Ok(())
    })?;
    let forward = best(5, || {
        trunk.forward(x.clone());
        Ok(())
    })?;
    let heads = step(&heads, features.into())?;
    let whole = step(&whole, NetInput::Images { z: None, pixels: x.clone() })?;
    println!(
        "{name:<12} step of {rows}: bytes to numbers {to_numbers:.1} ms, trunk forward {forward:.1} ms, heads alone \
         {heads:.1} ms, all of it {whole:.1} ms"
    );
    Ok(())
}

/// The best time in milliseconds.
fn best(rounds: usize, mut run: impl FnMut() -> Result<(), LearnError>) -> Result<f64, LearnError> {
    let mut best = f64::INFINITY;
    for _ in 0..rounds {
        let start = Instant::now();
        run()?;
        best = best.min(start.elapsed().as_secs_f64() * 1000.0);
    }
    Ok(best)
}

fn case(name: &str, mut learner: PpoLearner) -> Result<(), LearnError> {
    let mut rng = Streams::new(1).stream("data", 0);
    let rollout = rollout(&learner, &mut rng)?;
    let (policy, n) = (learner.policy(), ENVS);
    let z = &rollout.z[..n * rollout.latent];
    let tick = rollout.obs.rows(0..n, IMAGE.numbers());
    let forward = best(20, || policy.forward(z, tick, n).map(drop))?;
    let update = best(2, || learner.update(&rollout).map(drop))? / 1000.0;
    let output = learner.policy().forward(z, tick, n)?;
    let hash = output
        .head
        .iter()
        .chain(&output.values)
        .fold(0u64, |hash, x| (hash ^ u64::from(x.to_bits())).wrapping_mul(0x0000_0100_0000_01B3).rotate_left(17));
    println!(
        "{name:<22} forward of {n} {forward:7.2} ms   update of {} rows {update:6.2} s   {hash:016x}",
        rollout.rows()
    );
    Ok(())
}

fn rollout(learner: &PpoLearner, rng: &mut ChaCha8Rng) -> Result<Rollout, LearnError> {
    let (rows, latent) = (ENVS * STEPS, learner.rollout_latent());
    let actions = (0..rows).map(|_| below(rng, 15) as u32).collect();
    Ok(Rollout {
        steps: STEPS,
        obs: pixels(rows, rng),
        z: (0..rows * latent).map(|_| normal(rng)).collect(),
        actions: Actions::Discrete(actions),
        log_probs: vec![-15.0f32.ln(); rows],
        values: vec![0.0; rows],
        rewards: (0..rows).map(|_| normal(rng)).collect(),
        terminated: (0..rows).map(|_| unit(rng) < 0.01).collect(),
        truncated: vec![false; rows],
        final_values: vec![0.0; rows],
        next_values: vec![0.0; ENVS],
        ..Rollout::new(ENVS, IMAGE, latent, &SPACE)
    })
}

fn pixels(rows: usize, rng: &mut ChaCha8Rng) -> Observations {
    let mut pixels = vec![0u8; rows * IMAGE.numbers()];
    pixels.iter_mut().for_each(|pixel| *pixel = below(rng, 256) as u8);
    pixels.into()
}
