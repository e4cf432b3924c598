//! One training step: forward, backward and Adam.

use std::cell::LazyCell;

use burn::tensor::{Tensor, TensorData};
use criterion::Criterion;
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, EntityBlock, EntityKind, PolicySpec, PpoConfig, PpoLearner,
    SkillConfig, SkillTrainer, StdKind, among_awake_workers,
    nn::{ActionBatch, Activation, Adam, AdamConfig, CnnKind, ImageNet, Mlp, NamedGrads, tracked},
    policy::{Actor, Critic, NetShape},
    ppo::{Minibatch, PpoBatch, PpoNets, gradient_step},
    rng::ChaCha8Rng,
};

use crate::data::{CHOICES, DEVICE, IMAGE, choices, images as image_tensor, matrix, normals, pixels, rng, tiles};

/// The paper's skill model on vectors of AntMaze's size: 4 layers of a bidirectional GRU 200, windows of 10, batches of
/// 50.
pub fn skill(criterion: &mut Criterion) {
    let (obs_dim, action_dim, steps) = (29, 8, 2000);
    let config = SkillConfig { encoder_hidden: 200, gru_hidden: 200, gru_layers: 4, ..SkillConfig::default() };
    let mut rng = rng("skill");
    let episodes = (0..20).map(|_| DatasetEpisode {
        observations: normals(steps * obs_dim, &mut rng).into(),
        actions: Actions::Continuous { dim: action_dim, values: normals(steps * action_dim, &mut rng) },
    });
    let dataset = Dataset::new(obs_dim, ActionSpace::Continuous(action_dim), episodes.collect()).expect("fits");
    let mut trainer = SkillTrainer::new(config, dataset, 1, DEVICE).expect("fits");
    criterion.bench_function("step/skill", |bencher| bencher.iter(|| trainer.train_batch().expect("learns").loss));
}

/// A regression on 8 numbers through two hidden layers of 200.
pub fn mlp(criterion: &mut Criterion) {
    for batch in [64, 512] {
        let mut rng = rng("mlp");
        let mut net = tracked(&Mlp::new(37, &[200, 200], 8, Activation::Tanh, 1.0, &mut rng, &DEVICE.plain()));
        let mut adam = Adam::new(AdamConfig::default());
        let (x, target) = (matrix(batch, 37, &mut rng), matrix(batch, 8, &mut rng));
        let mut step = || {
            let loss = (net.forward(x.clone()) - target.clone()).square().mean();
            let grads = NamedGrads::take(&mut net, "", loss.backward()).expect("finite");
            adam.step(&mut net, "", &grads, 3e-4, 1.0).expect("fits");
        };
        criterion.bench_function(&format!("step/mlp-37-200-200-8/{batch}"), |bencher| {
            // As updates do.
            among_awake_workers(|| bencher.iter(&mut step));
        });
    }
}

/// A minibatch of PPO with the actor and critic of CoinRun's experiments.
pub fn ppo(criterion: &mut Criterion) {
    let (obs_dim, rows) = (563, 2048);
    let mut rng = rng("ppo");
    let device = DEVICE.plain();
    let shape = NetShape { obs_dim, latent: 0, hidden: vec![200, 200], activation: Activation::Relu };
    let mut nets = tracked(&PpoNets {
        actor: Actor::new(&shape, ActionSpace::Discrete(CHOICES), StdKind::Vector, &mut rng, &device),
        critic: Critic::new(&shape, &mut rng, &device),
        intrinsic: None,
    });
    let inputs = tiles(rows * obs_dim, &mut rng);
    ppo_step(criterion, "step/ppo-563-200-200-15/2048", &mut nets, (inputs, obs_dim), rng);
}

/// The same with 32 slots of five numbers, half of which hold a thing, read as a set and value by value.
pub fn entities(criterion: &mut Criterion) {
    let block = EntityBlock { start: 8, slots: 32, width: 5 };
    let (obs_dim, rows) = (8 + block.numbers(), 2048);
    let set = EntityKind::Set { hidden: 64, blocks: vec![block] };
    for (name, entities) in [("set", set), ("flat", EntityKind::Flat)] {
        let mut rng = rng("entities");
        let mut inputs = normals(rows * obs_dim, &mut rng);
        for row in inputs.chunks_exact_mut(obs_dim) {
            for (slot, numbers) in row[block.range()].chunks_exact_mut(1 + block.width).enumerate() {
                match slot % 2 {
                    0 => numbers[0] = 1.0,
                    _ => numbers.fill(0.0),
                }
            }
        }
        let spec = PolicySpec { obs: obs_dim.into(), latent: 0, action_space: ActionSpace::Discrete(CHOICES) };
        let config = PpoConfig { entities, ..PpoConfig::default() };
        let learner = PpoLearner::new(config, spec, 1, DEVICE).expect("fits");
        let mut nets = tracked(learner.nets());
        ppo_step(criterion, &format!("step/ppo-32-things-{name}/2048"), &mut nets, (inputs, obs_dim), rng);
    }
}

/// Times gradient steps of PPO on random data.
fn ppo_step(
    criterion: &mut Criterion,
    name: &str,
    nets: &mut PpoNets,
    (inputs, obs_dim): (Vec<f32>, usize),
    mut rng: ChaCha8Rng,
) {
    let (rows, device) = (inputs.len() / obs_dim, DEVICE.plain());
    let inputs = TensorData::new(inputs, [rows, obs_dim]);
    let actions = Actions::Discrete(choices(rows, &mut rng));
    let mut column = || Tensor::<1>::from_data(TensorData::new(normals(rows, &mut rng), [rows]), &device);
    let batch = Minibatch {
        inputs: Tensor::<2>::from_data(inputs, &device).into(),
        augmented: None,
        recall: None,
        left: None,
        logit_offsets: None,
        free: None,
        ppo: PpoBatch {
            actions: ActionBatch::new(&actions, &device),
            old_log_probs: column() * 0.01 - libm::logf(CHOICES as f32),
            advantages: column(),
            old_values: column(),
            returns: column(),
        },
        teacher: None,
        intrinsic_returns: None,
    };
    let (config, mut adam) = (PpoConfig::default(), Adam::new(AdamConfig::default()));
    criterion.bench_function(name, |bencher| {
        among_awake_workers(|| {
            bencher.iter(|| gradient_step(nets, &mut adam, &batch, &config, None, 3e-4).expect("finite"));
        });
    });
}

/// Both image encoders, from bytes to features alone and as a step towards others.
pub fn images(criterion: &mut Criterion) {
    for (name, kind) in [("nature", CnnKind::Nature { feature: 512 }), ("impala", CnnKind::default())] {
        for batch in [64, 256, 2048] {
            let made = LazyCell::new(|| {
                let mut rng = rng("images");
                let net = ImageNet::new(&kind, IMAGE, &mut rng, &DEVICE.plain()).expect("fits");
                (net, pixels(batch, &mut rng), matrix(batch, kind.features(), &mut rng))
            });
            criterion.bench_function(&format!("features/{name}/{batch}"), |bencher| {
                let (net, bytes, _) = &*made;
                bencher.iter(|| net.forward(image_tensor(bytes.clone())).sum().into_scalar::<f32>());
            });
            criterion.bench_function(&format!("step/{name}/{batch}"), |bencher| {
                let (net, bytes, target) = &*made;
                let (mut net, mut adam) = (tracked(net), Adam::new(AdamConfig::default()));
                let mut step = || {
                    let loss = (net.forward(image_tensor(bytes.clone())) - target.clone()).square().mean();
                    let grads = NamedGrads::take(&mut net, "", loss.backward()).expect("finite");
                    adam.step(&mut net, "", &grads, 3e-4, 1.0).expect("fits");
                };
                among_awake_workers(|| bencher.iter(&mut step));
            });
        }
    }
}
