//! Every kind of policy that the trainers make, with random weights.

use crate::{
    OnnxPolicy,
    evaluator::{Elem, Evaluator, Value},
    policy_form::{PolicyForm, Stored},
};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, DeviceKind, EntityBlock, EntityKind, ImageShape, Learner,
    MemoryKind, ObsKind, ObsSlice, Observations, PolicyFile, PolicyMetadata, PolicySpec, PpoConfig, PpoLearner,
    PriorKind, SacConfig, SacLearner, ScoreConfig, SkillConfig, SkillDraw, SkillModel, SkillTrainer, SpirlConfig,
    SpirlLearner, StdKind,
    nn::CnnKind,
    rng::{Streams, normal},
};
use std::{collections::BTreeMap, path::Path};

/// A policy of one kind.
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) file: PolicyFile,
    pub(super) bytes: Vec<u8>,
}

impl Kind {
    /// Returns `n` observations: near zero, with some far from it.
    pub(super) fn observations(&self, n: usize) -> Observations {
        let kind = self.file.policy.observation();
        let mut rng = Streams::new(5).stream(self.name, 0);
        match kind {
            ObsKind::Vector(width) => {
                let mut numbers: Vec<f32> = (0..n * width).map(|_| normal(&mut rng)).collect();
                let far = if self.file.policy.normalises() { 30.0 } else { 3.0 };
                for (i, row) in numbers.chunks_exact_mut(width).enumerate() {
                    if i % 10 == 9 {
                        row.iter_mut().for_each(|x| *x *= far);
                    }
                    for block in self.file.policy.entities() {
                        for (slot, thing) in row[block.range()].chunks_exact_mut(block.width + 1).enumerate() {
                            match (i >> slot) % 2 {
                                0 => thing.fill(0.0),
                                _ => thing[0] = 1.0,
                            }
                        }
                    }
                }
                numbers.into()
            }
            ObsKind::Image(image) => {
                // Areas of one brightness, by which pictures differ.
                let mut area = 0.0;
                let mut byte = |i: usize| {
                    if i.is_multiple_of(40) {
                        area = 128.0 + 110.0 * normal(&mut rng);
                    }
                    (area + 20.0 * normal(&mut rng)).clamp(0.0, 255.0) as u8
                };
                Observations::Image((0..n * image.numbers()).map(&mut byte).collect())
            }
        }
    }

    /// Returns random numbers, `n` times `width`.
    pub(super) fn numbers(&self, what: &str, n: usize, width: usize) -> Vec<f32> {
        let mut rng = Streams::new(6).stream(what, 0);
        (0..n * width).map(|_| 0.7 * normal(&mut rng)).collect()
    }

    /// Returns observations as the input of a graph.
    pub(super) fn input(&self, obs: ObsSlice<'_>, n: usize) -> Value {
        match (obs, self.file.policy.observation()) {
            (ObsSlice::Vector(values), ObsKind::Vector(width)) => singles(&[n, width], values),
            (ObsSlice::Image(bytes), ObsKind::Image(ImageShape { channels, height, width })) => {
                let numbers = bytes.iter().map(|&byte| f64::from(byte)).collect();
                Value::new(Elem::Byte, vec![n, channels, height, width], numbers).expect("whole images")
            }
            _ => panic!("observations of the policy's kind"),
        }
    }
}

/// Returns single-precision numbers as an input of a graph.
pub(super) fn singles(shape: &[usize], numbers: &[f32]) -> Value {
    let numbers = numbers.iter().map(|&x| f64::from(x)).collect();
    Value::new(Elem::Single, shape.to_vec(), numbers).expect("they fill it")
}

const DEVICE: DeviceKind = DeviceKind::Flex;
const LATENT: usize = 3;
const SETS: [EntityBlock; 2] =
    [EntityBlock { start: 1, slots: 4, width: 3 }, EntityBlock { start: 18, slots: 2, width: 1 }];

fn spec(obs: impl Into<ObsKind>, action_space: ActionSpace) -> PolicySpec {
    PolicySpec { obs: obs.into(), latent: 0, action_space }
}

fn ppo(spec: PolicySpec, config: PpoConfig) -> PolicyFile {
    let config = PpoConfig { hidden: vec![32, 24], ..config };
    finished(&PpoLearner::new(config, spec, 1, DEVICE).expect("valid"))
}

fn sac(spec: PolicySpec, config: SacConfig) -> PolicyFile {
    let config = SacConfig { random_start: false, hidden: vec![32, 24], ..config };
    finished(&SacLearner::new(config, spec, 1, DEVICE).expect("valid"))
}

fn finished(learner: &dyn Learner) -> PolicyFile {
    of_parts(learner.policy(), learner.skills())
}

fn of_parts(policy: playbot_learner::Policy, skills: Option<playbot_learner::SkillSource>) -> PolicyFile {
    let names = |n: usize| (0..n).map(|i| format!("value {i}")).collect();
    let metadata = PolicyMetadata {
        game: "kinds".to_owned(),
        game_version: 3,
        observations: match policy.observation() {
            ObsKind::Vector(width) => names(width),
            ObsKind::Image(_) => Vec::new(),
        },
        actions: Vec::new(),
        algorithm: "test".to_owned(),
        training: "random weights".to_owned(),
        code: "tests".to_owned(),
        ..PolicyMetadata::default()
    };
    PolicyFile { metadata, policy, skills }
}

/// Learns a skill model a little.
fn model(obs: impl Into<ObsKind>, space: ActionSpace, config: SkillConfig) -> SkillModel {
    let obs = obs.into();
    let steps = 12;
    let mut rng = Streams::new(2).stream("demo", 0);
    let mut episode = || {
        let observations = match obs {
            ObsKind::Vector(width) => {
                (0..steps * width).map(|i| (i % width) as f32 * normal(&mut rng)).collect::<Vec<f32>>().into()
            }
            ObsKind::Image(image) => Observations::Image((0..steps * image.numbers()).map(|i| (i * 7) as u8).collect()),
        };
        let actions = match space {
            ActionSpace::Discrete(n) => Actions::Discrete((0..steps).map(|i| (i % n) as u32).collect()),
            ActionSpace::Continuous(dim) => {
                Actions::Continuous { dim, values: (0..steps * dim).map(|i| (i % 3) as f32 - 1.0).collect() }
            }
            ActionSpace::Mixed(_) => panic!("not made here"),
        };
        DatasetEpisode { observations, actions }
    };
    let dataset = Dataset::new(obs, space, vec![episode(), episode(), episode()]).expect("consistent");
    let config = SkillConfig { latent: LATENT, window: 4, hidden: vec![20, 16], ..config };
    SkillTrainer::new(config, dataset, 1, DEVICE).expect("windows fit").into_model()
}

fn score(model: &SkillModel, config: ScoreConfig, ppo: PpoConfig) -> PolicyFile {
    let config = ScoreConfig { skill_interval: 5, ..config };
    finished(&PpoLearner::with_skill(ppo, config, model, 1, DEVICE).expect("valid"))
}

/// Returns one policy of every kind.
pub(super) fn all() -> Vec<Kind> {
    let (discrete, continuous) = (ActionSpace::Discrete(5), ActionSpace::Continuous(3));
    let (several, mixed) = (ActionSpace::mixed([3, 2, 4], 0), ActionSpace::mixed([3, 2], 2));
    let tanh = PpoConfig { norm_obs: true, activation: Default::default(), ..PpoConfig::default() };
    let gru = |hidden| MemoryKind::Gru { hidden, sequence: 8, burn_in: 0 };
    let plain = PpoConfig::default;
    let remembering = |memory| PpoConfig { memory, norm_obs: true, ..plain() };
    let sets = EntityKind::Set { hidden: 12, blocks: SETS.to_vec() };
    let small = ImageShape { channels: 3, height: 20, width: 23 };
    let large = ImageShape { channels: 2, height: 36, width: 40 };
    let impala = CnnKind::Impala { channels: vec![6, 8], feature: 16 };
    let skills = |tanh_latent, norm_obs| SkillConfig { tanh_latent, norm_obs, ..SkillConfig::default() };
    let discrete_skills = model(7, discrete, skills(true, true));
    let free_skills = model(7, continuous, SkillConfig { decoder_std: StdKind::State, ..skills(false, true) });
    let pictured = model(small, discrete, SkillConfig { cnn: impala.clone(), ..skills(true, false) });
    let cloned = |model: &SkillModel, draw| {
        let skills =
            playbot_learner::SkillSource { prior: model.prior(), decoder: model.policy(), skill_interval: 4, draw };
        of_parts(model.policy(), Some(skills))
    };
    let spirl = |ppo| {
        let score = ScoreConfig { skill_interval: 5, ..ScoreConfig::default() };
        let config = SpirlConfig { learn_decoder: false, ..SpirlConfig::default() };
        finished(&SpirlLearner::ppo(config, ppo, &score, &discrete_skills, 1, DEVICE).expect("valid"))
    };
    let spirl_sac = || {
        let score = ScoreConfig { skill_interval: 5, ..ScoreConfig::default() };
        let config = SpirlConfig::default();
        let learner = SpirlLearner::sac(config, SacConfig::default(), &plain(), &score, &discrete_skills, 1, DEVICE);
        finished(&learner.expect("valid"))
    };
    let standard = ScoreConfig { prior: PriorKind::StandardNormal, ..ScoreConfig::default() };
    let clock = ScoreConfig { critic_clock: true, ..ScoreConfig::default() };
    let policies = [
        ("discrete", ppo(spec(6, discrete), plain())),
        ("discrete normalised", ppo(spec(6, discrete), tanh)),
        ("continuous", ppo(spec(6, continuous), PpoConfig { norm_obs: true, ..plain() })),
        ("several choices", ppo(spec(6, several), plain())),
        ("mixed", ppo(spec(6, mixed), PpoConfig { norm_obs: true, ..plain() })),
        ("squashed", sac(spec(6, continuous), SacConfig { norm_obs: true, ..SacConfig::default() })),
        ("discrete sac", sac(spec(6, discrete), SacConfig::default())),
        ("gru", ppo(spec(6, discrete), remembering(gru(10)))),
        ("gru continuous", ppo(spec(6, continuous), remembering(gru(10)))),
        ("stack", ppo(spec(6, discrete), remembering(MemoryKind::Stack { ticks: 4 }))),
        ("sets", ppo(spec(23, discrete), PpoConfig { entities: sets.clone(), norm_obs: true, ..plain() })),
        ("sets gru", ppo(spec(23, mixed), PpoConfig { entities: sets, ..remembering(gru(6)) })),
        ("impala", ppo(spec(small, discrete), PpoConfig { cnn: impala.clone(), ..plain() })),
        ("impala gru", ppo(spec(small, several), PpoConfig { cnn: impala, memory: gru(6), ..plain() })),
        ("nature", ppo(spec(large, discrete), PpoConfig { cnn: CnnKind::Nature { feature: 24 }, ..plain() })),
        ("skills", score(&discrete_skills, ScoreConfig::default(), plain())),
        ("skills clock", score(&discrete_skills, clock, plain())),
        ("skills free", score(&free_skills, ScoreConfig::default(), plain())),
        ("skills standard normal", score(&discrete_skills, standard, plain())),
        ("skills gru", score(&discrete_skills, ScoreConfig::default(), PpoConfig { memory: gru(6), ..plain() })),
        ("skills stack", {
            let memory = MemoryKind::Stack { ticks: 3 };
            score(&discrete_skills, ScoreConfig::default(), PpoConfig { memory, ..plain() })
        }),
        ("skills pictured", score(&pictured, ScoreConfig::default(), plain())),
        ("cloned", cloned(&discrete_skills, SkillDraw::Sample)),
        ("cloned free", cloned(&free_skills, SkillDraw::Mean)),
        ("spirl", spirl(plain())),
        ("spirl gru", spirl(PpoConfig { memory: gru(7), ..plain() })),
        ("spirl sac", spirl_sac()),
    ];
    policies.into_iter().map(|(name, file)| randomised(name, &file)).collect()
}

/// Replaces weights by random ones with which outputs differ from observation to observation.
fn randomised(name: &'static str, file: &PolicyFile) -> Kind {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bot.policy");
    let (kind, n) = (Kind { name, file: file.clone(), bytes: Vec::new() }, 3);
    let (obs, latent) = (kind.observations(n), file.policy.latent());
    let z = kind.numbers("skill", n, latent);
    file.save(&path, &obs, &z, n).expect("sound");
    let mut form = PolicyForm::parse(&path, &std::fs::read(&path).expect("written")).expect("of this version");
    let mut rng = Streams::new(4).stream(name, 0);
    for (array, stored) in &mut form.arrays {
        let is_weight = ["actor.", "critic.", "prior.", "obs_norm."].iter().any(|prefix| array.starts_with(prefix));
        match stored {
            Stored::Single(shape, numbers) if is_weight => {
                // A recurrent layer is small by itself, the convolutions and dense layers are scaled to keep the size.
                let inputs: usize = match shape[..] {
                    [inputs, _] if array.ends_with("weight") => inputs,
                    [_, inputs, rows, columns] => inputs * rows * columns,
                    _ => 10,
                };
                // Features of pictures are alike, so the layers behind them are larger.
                let gain = match shape[..] {
                    [_, _, _, _] => 0.8,
                    _ if file.policy.cnn().is_some() => 1.4,
                    _ => 1.1,
                };
                let scale = gain / (inputs as f32).sqrt();
                numbers.iter_mut().for_each(|x| *x = scale * normal(&mut rng));
            }
            Stored::Double(numbers) if is_weight => {
                let is_mean = array.ends_with("mean");
                let random = |x: f32| if is_mean { f64::from(x) } else { f64::from(x).abs() + 0.3 };
                numbers.iter_mut().for_each(|x| *x = random(normal(&mut rng)));
            }
            _ => {}
        }
    }
    // Its examples are of other weights: those of the graph take their place.
    let bytes = form.to_bytes(&path).expect("sound");
    let onnx =
        OnnxPolicy::of_form(&PolicyForm::parse(&path, &bytes).expect("sound")).expect("every kind can be exported");
    let graph = Evaluator::parse(&path, &onnx.policy).expect("sound");
    let mut inputs = BTreeMap::from([("observation".to_owned(), kind.input(obs.as_slice(), n))]);
    let zeros = |width: usize| singles(&[n, width], &vec![0.0; n * width]);
    if latent > 0 {
        inputs.insert("skill".to_owned(), singles(&[n, latent], &z));
    }
    if file.policy.memory() > 0 {
        inputs.insert("memory".to_owned(), zeros(file.policy.memory()));
    }
    let names: Vec<&str> = graph.outputs().collect();
    let outputs = graph.run(inputs.clone(), &names).expect("it runs");
    let space = file.policy.action_space();
    let rows = |name: &str, width: usize| -> Vec<Vec<f32>> {
        let numbers = outputs.get(name).map_or(&[][..], Value::numbers);
        let row = |row: &[f64]| row.iter().map(|&x| x as f32).collect();
        if width == 0 { vec![Vec::new(); n] } else { numbers.chunks_exact(width).map(row).collect() }
    };
    let (options, means) = (rows("log_probabilities", space.options()), rows("mean", space.numbers()));
    let head = options.into_iter().zip(means).flat_map(|(options, means)| [options, means].concat()).collect();
    form.put("examples.head", &[n, space.dim()], head);
    let log_std = rows("log_std", space.numbers()).concat();
    form.put("examples.log_std", &[n, space.numbers()], log_std);
    if outputs.contains_key("value") {
        form.put("examples.value", &[n, 1], rows("value", 1).concat());
    }
    if let (Some(prior), Some(skills)) = (&onnx.prior, &file.skills) {
        let graph = Evaluator::parse(&path, prior).expect("sound");
        inputs.insert("noise".to_owned(), zeros(latent));
        inputs.insert("memory".to_owned(), zeros(skills.prior.memory()));
        let drawn = graph.run(inputs, &["skill"]).expect("it runs");
        let means = drawn["skill"].numbers().iter().map(|&x| x as f32).collect();
        form.put("examples.prior_mean", &[n, latent], means);
    }
    let bytes = form.to_bytes(Path::new(name)).expect("sound");
    let file =
        PolicyFile::from_bytes(Path::new(name), &bytes, DEVICE).expect("the graph computes what the policy does");
    Kind { name, file, bytes }
}
