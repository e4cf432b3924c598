//! PPO and SCORE-PPO from pixels: they learn the features of a shared trunk, exactly.

use crate::image_task::{self, Driver, SHAPE, SPACE, config, image, model};
use crate::toy;
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{
    ActionBatch, Activation, Adam, AdamConfig, CnnKind, ImageNet, ParamVisitor, Parameters, tracked,
};
use playbot_learner::policy::{Actor, Critic, NetInput, NetShape};
use playbot_learner::ppo::{Minibatch, PpoBatch, PpoNets, gradient_step};
use playbot_learner::rng::{Streams, below, normal};
use playbot_learner::{
    Actions, DeviceKind, ImageShape, LearnError, Learner, ObsKind, PolicySpec, PpoConfig, PpoLearner, Rollout,
    ScoreConfig, SkillModel, StdKind,
};

pub const SPEC: PolicySpec = PolicySpec { obs: ObsKind::Image(SHAPE), latent: 0, action_space: SPACE };
const ENVS: usize = 16;
/// Largest number of updates.
const PATIENCE: usize = 30;

pub fn ppo(config: PpoConfig, seed: u64) -> PpoLearner {
    PpoLearner::new(config, SPEC, seed, DeviceKind::Flex).expect("good settings")
}

pub fn score(config: PpoConfig, model: &SkillModel, seed: u64) -> PpoLearner {
    PpoLearner::with_skill(config, ScoreConfig::default(), model, seed, DeviceKind::Flex).expect("good settings")
}

/// Returns the updates until nearly all answers of the last two rollouts were right. Without learned features of the
/// trunk it takes more than [`PATIENCE`].
fn updates_to_solve(mut learner: PpoLearner, seed: u64) -> usize {
    let mut driver = Driver::new(ENVS, seed);
    for update in 1..=PATIENCE {
        let rollout = driver.rollout(&learner, config().num_steps);
        learner.update(&rollout).expect("finite");
        if update > 1 && driver.recent(2 * rollout.rows()) > 0.9 {
            return update;
        }
    }
    PATIENCE + 1
}

#[test]
fn ppo_learns_what_is_to_be_seen_and_skills_of_poor_players_help() {
    let (mut with_skills, mut without) = (Vec::new(), Vec::new());
    for seed in 1..=3 {
        without.push(updates_to_solve(ppo(config(), seed), seed));
        with_skills.push(updates_to_solve(score(config(), &model(10, seed), seed), seed));
    }
    assert!(without.iter().all(|updates| *updates <= PATIENCE), "PPO alone must see it too: {without:?}");
    let (score, ppo) = (with_skills.iter().sum::<usize>(), without.iter().sum::<usize>());
    assert!(3 * score <= 2 * ppo, "updates with skills {with_skills:?}, without {without:?}");
}

#[test]
fn the_first_policy_is_the_decoder_exactly() {
    let learner = score(config(), &model(1, 1), 1);
    // More than are read at a time.
    let n = 300;
    let mut rng = Streams::new(9).stream("inputs", 0);
    let pixels: Vec<u8> = (0..n).flat_map(|i| image(i % 4, &mut rng)).collect();
    let n = n as usize;
    let z: Vec<f32> = (0..n * 2).map(|_| normal(&mut rng)).collect();
    let width = SHAPE.numbers();
    for rows in [0..1, 0..2, 255..257, 0..n] {
        let (z, pixels) = (&z[rows.start * 2..rows.end * 2], &pixels[rows.start * width..rows.end * width]);
        assert_eq!(learner.initial_kl(z, pixels.into(), rows.len()).expect("a copy"), Some(0.0));
        let score = ScoreConfig { init_from_decoder: false, ..ScoreConfig::default() };
        let free = PpoLearner::with_skill(config(), score, &model(1, 1), 1, DeviceKind::Flex).expect("good settings");
        assert!(free.initial_kl(z, pixels.into(), rows.len()).expect("no copy") > Some(0.0));
    }
    let whole = learner.policy().forward(&z, &pixels, n).expect("finite");
    for row in [0, 255, 256, 299] {
        let (z, pixels) = (&z[row * 2..row * 2 + 2], &pixels[row * width..(row + 1) * width]);
        let alone = learner.policy().forward(z, pixels, 1).expect("finite");
        assert_eq!((&alone.head[..], alone.values[0]), (&whole.head[row * 4..row * 4 + 4], whole.values[row]));
        assert_eq!(learner.policy().values(z, pixels, 1).expect("finite"), alone.values);
    }
}

#[test]
fn the_penalty_is_measured_and_holds_the_policy_back() {
    let model = model(4, 1);
    let divergence = |kl_coef| {
        let score = ScoreConfig { kl_coef, ..ScoreConfig::default() };
        let learner = PpoLearner::with_skill(config(), score, &model, 1, DeviceKind::Flex);
        let (mut learner, mut driver) = (learner.expect("good settings"), Driver::new(ENVS, 1));
        let updates = (0..6).map(|_| {
            let rollout = driver.rollout(&learner, 8);
            learner.update(&rollout).expect("finite").decoder_kl.expect("penalised")
        });
        updates.last().expect("six of them")
    };
    let (free, held) = (divergence(0.0), divergence(30.0));
    assert!(free > 0.01 && held < 0.3 * free, "{held} held, {free} free");
}

#[test]
fn a_loaded_learner_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let model = model(1, 1);
    for mut learner in [ppo(config(), 5), score(config(), &model, 5)] {
        let mut driver = Driver::new(4, 1);
        learner.update(&driver.rollout(&learner, 16)).expect("finite");
        learner.save(&path).expect("written");
        let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
        assert_eq!((loaded.spec(), loaded.config()), (learner.spec(), learner.config()));
        for _ in 0..2 {
            let rollout = driver.rollout(&learner, 16);
            let expected = learner.update(&rollout).expect("finite");
            assert_eq!(loaded.update(&rollout).expect("finite"), expected);
        }
        let bytes = |learner: &PpoLearner| {
            learner.save(&path).expect("written");
            std::fs::read(&path).expect("readable")
        };
        assert!(bytes(&loaded) == bytes(&learner), "whole states are equal, byte for byte");
    }
}

#[test]
fn values_of_all_ends_at_once_are_those_of_each_tick() {
    let learner = ppo(config(), 1);
    let mut driver = Driver::new(ENVS, 1);
    let rollout = driver.rollout(&learner, 40);
    let (policy, width) = (learner.policy(), SHAPE.numbers());
    for (i, &row) in rollout.ends.cut_rows.iter().enumerate() {
        let value = policy.values(&[], rollout.ends.cut_obs.row(i, width), 1).expect("finite");
        assert_eq!(rollout.final_values[row], value[0]);
    }
    assert_eq!(rollout.next_values.len(), ENVS);
    assert!(rollout.next_values.iter().any(|value| *value != 0.0));

    // The corridor's driver asks at every tick.
    let spec = PolicySpec { obs: toy::OBS.into(), latent: 0, action_space: toy::SPACE };
    let learner = PpoLearner::new(crate::corridor::config(), spec, 1, DeviceKind::Flex).expect("good settings");
    let asked = toy::Driver::new(8, 1).rollout(&learner, 100);
    let mut filled = asked.clone();
    filled.bootstrap(&learner.policy()).expect("they fit");
    assert!(!asked.ends.cut_rows.is_empty());
    for &row in &asked.ends.cut_rows {
        assert_eq!(filled.final_values[row], asked.final_values[row]);
    }
    let done = asked.done();
    let last = &done[done.len() - 8..];
    for env in (0..8).filter(|&env| !last[env]) {
        assert_eq!(filled.next_values[env], asked.next_values[env]);
    }
    filled.ends.next_obs.clear();
    assert!(filled.bootstrap(&learner.policy()).expect_err("no states").to_string().contains("next_obs"));
}

#[test]
fn images_of_another_kind_are_refused() {
    let mut learner = ppo(config(), 1);
    let rollout = Driver::new(4, 1).rollout(&learner, 8);
    let mut error = |change: &dyn Fn(&mut Rollout)| {
        let mut bad = rollout.clone();
        change(&mut bad);
        learner.update(&bad).expect_err("does not fit").to_string()
    };
    let stacked = ImageShape { channels: 2, ..SHAPE };
    let text = error(&|bad| *bad = Rollout::new(4, stacked, 0, &SPACE));
    assert!(text.contains("next_values"), "{text}");
    let text = error(&|bad| {
        *bad = Rollout { next_values: vec![0.0; 4], ..Rollout::new(4, stacked, 0, &SPACE) };
    });
    assert!(text.contains("must be images of 1 channels") && text.contains("are images of 2 channels"), "{text}");
    let text = error(&|bad| bad.obs = vec![0u8; 7].into());
    assert!(text.contains("rollout obs: expected 4608, found 7"), "{text}");
    let text = error(&|bad| bad.obs = vec![0.0; 4608].into());
    assert!(text.contains("rollout obs are vectors, not images"), "{text}");
    learner.update(&rollout).expect("it fits");

    let policy = learner.policy();
    let shape = policy.forward(&[], &vec![0u8; 2 * SHAPE.numbers()], 1).expect_err("two channels");
    assert!(matches!(shape, LearnError::Shape { expected: 144, found: 288, .. }), "{shape}");
    let vector = policy.values(&[], &[0.0; 144], 1).expect_err("a vector");
    assert!(matches!(vector, LearnError::Config(_)), "{vector}");
    assert_eq!((policy.observation(), policy.cnn()), (SPEC.obs, Some(image_task::cnn())));

    let refused = |config| PpoLearner::new(config, SPEC, 1, DeviceKind::Flex).expect_err("cannot work").to_string();
    let text = refused(PpoConfig { cnn: CnnKind::Nature { feature: 8 }, ..config() });
    assert!(text.contains("at least 36 rows"), "{text}");
    assert!(refused(PpoConfig { norm_obs: true, ..config() }).contains("norm_obs is for vectors"));
    let empty = CnnKind::Impala { channels: vec![4, 0], feature: 8 };
    assert!(refused(PpoConfig { cnn: empty, ..config() }).contains("`ppo.cnn`"));
    let spec = PolicySpec { obs: toy::OBS.into(), latent: 0, action_space: SPACE };
    let mut blind = PpoLearner::new(config(), spec, 1, DeviceKind::Flex).expect("good settings");
    let text = blind.update(&rollout).expect_err("images").to_string();
    assert!(text.contains("must be vectors of 8"), "{text}");
}

/// Returns a minibatch whose policy loss, entropy and value loss all depend on the observation.
fn minibatch(rows: usize) -> Minibatch {
    let device = DeviceKind::Flex.plain();
    let mut rng = Streams::new(3).stream("batch", 0);
    let pixels: Vec<f32> =
        (0..rows).flat_map(|i| image(i as u32 % 4, &mut rng)).map(|pixel| f32::from(pixel) / 255.0).collect();
    let actions = (0..rows).map(|_| below(&mut rng, 4) as u32).collect();
    let mut column = || {
        let values = (0..rows).map(|_| normal(&mut rng)).collect::<Vec<f32>>();
        Tensor::<1>::from_data(TensorData::new(values, [rows]), &device)
    };
    Minibatch {
        augmented: None,
        recall: None,
        left: None,
        logit_offsets: None,
        free: None,
        inputs: NetInput::Images {
            z: None,
            pixels: Tensor::from_data(TensorData::new(pixels, [rows, 1, SHAPE.height, SHAPE.width]), &device),
        },
        ppo: PpoBatch {
            actions: ActionBatch::new(&Actions::Discrete(actions), &device),
            old_log_probs: column() * 0.0 - 4.0f32.ln(),
            advantages: column(),
            old_values: column(),
            returns: column(),
        },
        teacher: None,
        intrinsic_returns: None,
    }
}

fn nets() -> PpoNets {
    let (mut rng, device) = (Streams::new(1).stream("nets", 0), DeviceKind::Flex.plain());
    let shape = NetShape { obs_dim: 8, latent: 0, hidden: vec![16], activation: Activation::Tanh };
    let actor = Actor::new(&shape, SPACE, StdKind::Vector, &mut rng, &device);
    let cnn = ImageNet::new(&image_task::cnn(), SHAPE, &mut rng, &device).expect("it fits");
    let critic = Critic::new(&shape, &mut rng, &device);
    let mut nets = PpoNets { actor: Actor { cnn: Some(cnn), ..actor }, critic, intrinsic: None };
    // The head is small at the start, and so is its gradient for the trunk.
    nets.actor.net.head.weight = nets.actor.net.head.weight.clone() * 50.0;
    tracked(&nets)
}

/// Returns the loss of `nets` and its gradients, by name, in the optimizer's first moments.
fn loss(nets: &PpoNets, batch: &Minibatch, config: &PpoConfig) -> (f64, Adam) {
    let mut adam = Adam::new(AdamConfig { beta1: 0.0, beta2: 0.0, ..AdamConfig::default() });
    let step = gradient_step(&mut nets.clone(), &mut adam, batch, config, None, 0.0).expect("finite");
    (step.total_loss, adam)
}

/// Moves one parameter.
struct Move<'a> {
    name: &'a str,
    by: Vec<f32>,
}

impl ParamVisitor for Move<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        if name == self.name {
            let by = TensorData::new(self.by.clone(), tensor.dims());
            *tensor =
                (tensor.clone().inner() + Tensor::from_data(by, &DeviceKind::Flex.plain())).autodiff().require_grad();
        }
    }
}

#[test]
fn gradients_of_the_shared_trunk_are_those_of_finite_differences() {
    let (nets, batch) = (nets(), minibatch(32));
    let config = PpoConfig { max_grad_norm: 1e30, clip: 0.9, clip_value_loss: false, ..config() };
    let gradient = |config: &PpoConfig, name: &str| {
        let (_, adam) = loss(&nets, &batch, config);
        adam.moments(name).expect("a parameter").0.to_vec()
    };
    let only_values = PpoConfig { vf_coef: 1e6, ..config.clone() };
    let no_values = PpoConfig { vf_coef: 0.0, ..config.clone() };
    for name in ["s0.conv.weight", "s0.res1.conv0.bias", "s1.conv.weight", "s1.res0.conv1.weight", "fc.weight"] {
        let name = &format!("actor.cnn.{name}");
        let gradient_of = |config| gradient(config, name);
        let whole = gradient_of(&config);
        let length = |values: &[f32]| values.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        let norm = length(&whole);
        // Along the gradient the loss changes by its length.
        let moved = |by: f64| {
            let mut moved = nets.clone();
            let by = whole.iter().map(|g| (f64::from(*g) / norm * by) as f32).collect();
            moved.visit("", &mut Move { name, by });
            loss(&moved, &batch, &config).0
        };
        let step = 3e-3;
        let slope = (moved(step) - moved(-step)) / (2.0 * step);
        assert!((slope / norm - 1.0).abs() < 0.03, "{name}: {slope} along a gradient of {norm}");
        // Both heads teach the trunk.
        let critic: Vec<f32> = gradient_of(&only_values).iter().map(|g| g / 1e6 * 0.5).collect();
        let sum: Vec<f32> = gradient_of(&no_values).iter().zip(&critic).map(|(a, c)| a + c).collect();
        let (actor, critic) = (length(&gradient_of(&no_values)), length(&critic));
        assert!(actor > 0.05 * norm && critic > 0.05 * norm, "{name}: {actor} and {critic} of {norm}");
        let off = whole.iter().zip(&sum).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt();
        assert!(off < 1e-3 * norm, "{name}: {off} of {norm}");
    }
}
