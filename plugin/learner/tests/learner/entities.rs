//! Sets of things: a task about the nearest one, and the exactness of their encoder.

use crate::corridor;
use crate::files::{after, describe};
use playbot_learner::rng::{self, ChaCha8Rng, Streams, unit};
use playbot_learner::{
    ActionSpace, ActionValue, Actions, Dataset, DatasetEpisode, DeviceKind, EntityBlock, EntityKind, EntitySet,
    InputMap, Learner, MemoryKind, Observations, Policy, PolicyFile, PolicyMetadata, PolicySpec, PpoConfig, PpoLearner,
    Rollout, RolloutStep, ScoreConfig as Score, SkillConfig, SkillModel, SkillTrainer, StartFrom, Workers,
    among_awake_workers,
};
use std::ops::ControlFlow;
use std::path::Path;

/// Numbers of a thing: its distance to the right, and its colour, which is of no importance.
const WIDTH: usize = 2;
const SPACE: ActionSpace = ActionSpace::Discrete(2);

fn block(slots: usize) -> EntityBlock {
    EntityBlock { start: 1, slots, width: WIDTH }
}

fn obs_dim(slots: usize) -> usize {
    1 + block(slots).numbers()
}

fn set(hidden: usize, slots: usize) -> EntityKind {
    EntityKind::Set { hidden, blocks: vec![block(slots)] }
}

fn config(entities: EntityKind) -> PpoConfig {
    PpoConfig { num_steps: 16, norm_reward: false, entities, ..corridor::config() }
}

fn learner_of(config: PpoConfig, slots: usize, seed: u64, device: DeviceKind) -> PpoLearner {
    let spec = PolicySpec { obs: obs_dim(slots).into(), latent: 0, action_space: SPACE };
    PpoLearner::new(config, spec, seed, device).expect("good settings")
}

fn learner(entities: EntityKind, slots: usize, seed: u64) -> PpoLearner {
    learner_of(config(entities), slots, seed, DeviceKind::Flex)
}

/// A scene with things around an agent. The right action is a step to the side of the nearest thing.
#[derive(Clone)]
struct Around(Vec<[f32; WIDTH]>);

impl Around {
    fn draw(count: usize, rng: &mut ChaCha8Rng) -> Self {
        let mut number = || 2.0 * unit(rng) as f32 - 1.0;
        Self((0..count).map(|_| [number(), number()]).collect())
    }

    /// Writes the things into these slots of an observation.
    fn observe(&self, slots: usize, places: &[usize]) -> Vec<f32> {
        let mut obs = vec![0.0; obs_dim(slots)];
        obs[0] = 1.0;
        for (thing, place) in self.0.iter().zip(places) {
            let at = 1 + place * (WIDTH + 1);
            obs[at] = 1.0;
            obs[at + 1..at + 1 + WIDTH].copy_from_slice(thing);
        }
        obs
    }

    /// Returns the right action.
    fn side(&self) -> u32 {
        let nearest = self.0.iter().min_by(|a, b| a[0].abs().total_cmp(&b[0].abs()));
        u32::from(nearest.is_some_and(|thing| thing[0] > 0.0))
    }
}

/// Returns a whole number below `bound`.
fn below(rng: &mut ChaCha8Rng, bound: usize) -> usize {
    rng::below(rng, bound as u64) as usize
}

/// Returns numbers from 0 in an order that `rng` draws.
fn shuffled(n: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut places: Vec<usize> = (0..n).collect();
    (1..n).for_each(|i| places.swap(i, below(rng, i + 1)));
    places
}

/// Gives every observation a new order of slots.
fn permuted(obs: &[f32], slots: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let slot = WIDTH + 1;
    let rows = obs.chunks_exact(obs_dim(slots)).flat_map(|row| {
        let order = shuffled(slots, rng);
        let moved = order.iter().flat_map(|&from| row[1 + from * slot..1 + (from + 1) * slot].to_vec());
        [row[0]].into_iter().chain(moved).collect::<Vec<_>>()
    });
    rows.collect()
}

/// Plays episodes of one tick: one to three things in the first three slots.
struct Driver {
    rng: ChaCha8Rng,
    envs: usize,
    slots: usize,
}

impl Driver {
    fn new(envs: usize, slots: usize, seed: u64) -> Self {
        Self { rng: Streams::new(seed).stream("around", 0), envs, slots }
    }

    fn draw(&mut self) -> Vec<Around> {
        (0..self.envs).map(|_| Around::draw(1 + below(&mut self.rng, 3), &mut self.rng)).collect()
    }

    fn rollout(&mut self, policy: &Policy, steps: usize) -> Rollout {
        let (envs, width) = (self.envs, policy.memory());
        let mut rollout = Rollout::new(envs, obs_dim(self.slots), 0, &SPACE);
        let all_of = |around: &[Around], slots: usize| -> Vec<f32> {
            around.iter().flat_map(|around| around.observe(slots, &[0, 1, 2])).collect()
        };
        for _ in 0..steps {
            let around = self.draw();
            let obs = all_of(&around, self.slots);
            let output = policy.forward(&[], &obs, envs).expect("finite");
            let (mut actions, mut log_probs, mut rewards) = (vec![], vec![], vec![]);
            for (row, around) in around.iter().enumerate() {
                let (ActionValue::Discrete(action), log_prob) = output.sample(row, &mut self.rng) else {
                    panic!("actions are discrete");
                };
                rewards.push(if action == around.side() { 1.0 } else { -1.0 });
                actions.push(action);
                log_probs.push(log_prob);
            }
            let step = RolloutStep {
                obs: (&obs).into(),
                z: &[],
                actions: &Actions::Discrete(actions),
                log_probs: &log_probs,
                values: &output.values,
                rewards: &rewards,
                terminated: &vec![true; envs],
                truncated: &vec![false; envs],
                final_values: &vec![0.0; envs],
            };
            rollout.push_step(step).expect("discrete");
            rollout.push_memory(&vec![0.0; envs * width]);
        }
        let obs = all_of(&self.draw(), self.slots);
        rollout.next_values = policy.values(&[], &obs, envs).expect("finite");
        rollout.ends.next_obs = obs.into();
        rollout.ends.next_memory = vec![0.0; envs * width];
        rollout
    }
}

fn train(learner: &mut PpoLearner, slots: usize, updates: usize, seed: u64) {
    let mut driver = Driver::new(64, slots, seed);
    for _ in 0..updates {
        let rollout = driver.rollout(&learner.policy(), 16);
        learner.update(&rollout).expect("finite");
    }
}

/// Returns the share of right actions among `count` things in slots that `places` gives.
fn right(policy: &Policy, count: usize, places: impl Fn(&mut ChaCha8Rng) -> Vec<usize>) -> f64 {
    let mut rng = Streams::new(99).stream("trial", count as u64);
    let trials: Vec<Around> = (0..2000).map(|_| Around::draw(count, &mut rng)).collect();
    let obs: Vec<f32> = trials.iter().flat_map(|around| around.observe(8, &places(&mut rng))).collect();
    let output = policy.forward(&[], &obs, trials.len()).expect("finite");
    let chosen = trials.iter().enumerate().map(|(row, around)| (output.greedy(row), around.side()));
    let right = chosen.filter(|(action, side)| *action == ActionValue::Discrete(*side)).count();
    right as f64 / trials.len() as f64
}

#[test]
fn a_set_is_known_in_other_slots_and_numbers_and_a_flat_vector_is_not() {
    for seed in 1..=2 {
        let shares = [set(32, 8), EntityKind::Flat].map(|entities| {
            let config = PpoConfig { hidden: vec![64, 64], ..config(entities) };
            let mut learner = learner_of(config, 8, seed, DeviceKind::Flex);
            train(&mut learner, 8, 100, seed);
            let policy = learner.policy();
            [
                right(&policy, 3, |_| vec![0, 1, 2]),
                right(&policy, 3, |rng| shuffled(8, rng)),
                right(&policy, 6, |rng| shuffled(8, rng)),
            ]
        });
        let [[seen, moved, more], [flat_seen, flat_moved, flat_more]] = shares;
        assert!(seen > 0.93 && moved > 0.93, "{shares:?}");
        assert!(more > 0.9, "six things, of which it has never seen more than three: {shares:?}");
        // The flat vector learns slowly, and nothing about slots that were always empty.
        assert!(flat_seen > 0.6 && flat_moved < flat_seen - 0.05 && flat_more < 0.65, "{shares:?}");
    }
}

/// Returns 40 observations of any number of things in any slots.
fn any_rows(slots: usize) -> Vec<f32> {
    let mut rng = Streams::new(5).stream("rows", 0);
    let rows = (0..40).map(|_| {
        let count = below(&mut rng, slots + 1);
        let around = Around::draw(count, &mut rng);
        around.observe(slots, &shuffled(slots, &mut rng))
    });
    rows.flatten().collect()
}

#[test]
fn the_order_of_slots_changes_no_bit_of_the_outputs() {
    let memory = MemoryKind::Gru { hidden: 8, sequence: 8, burn_in: 2 };
    for device in DeviceKind::CPU {
        for (norm_obs, memory) in [(false, MemoryKind::None), (true, MemoryKind::None), (false, memory)] {
            let config = PpoConfig { norm_obs, memory, ..config(set(16, 6)) };
            let mut learner = learner_of(config, 6, 3, device);
            train(&mut learner, 6, 2, 3);
            let (policy, rows) = (learner.policy(), any_rows(6));
            let expected = policy.forward(&[], &rows, 40).expect("finite");
            let mut rng = Streams::new(7).stream("orders", 0);
            for _ in 0..5 {
                let moved = permuted(&rows, 6, &mut rng);
                assert_ne!(moved, rows);
                assert_eq!(policy.forward(&[], &moved, 40).expect("finite"), expected);
            }
            let of_none = Around(Vec::new()).observe(6, &[]);
            let alone = policy.forward(&[], &of_none, 1).expect("nothing there is no fault");
            assert!(alone.values[0].is_finite());
            // It does see what is there.
            let mut changed = rows.clone();
            changed.chunks_exact_mut(obs_dim(6)).for_each(|row| row.iter_mut().skip(2).for_each(|x| *x *= 0.5));
            assert_ne!(policy.forward(&[], &changed, 40).expect("finite").values, expected.values);
        }
    }
}

#[test]
fn the_order_of_slots_changes_no_bit_of_a_training() {
    for norm_obs in [false, true] {
        let config = PpoConfig { norm_obs, ..config(set(16, 6)) };
        let folder = tempfile::tempdir().expect("a folder");
        let files = ["a", "b"].map(|name| folder.path().join(name));
        let mut rng = Streams::new(8).stream("orders", 0);
        for (i, path) in files.iter().enumerate() {
            let mut learner = learner_of(config.clone(), 6, 3, DeviceKind::Flex);
            let mut driver = Driver::new(16, 6, 3);
            for _ in 0..3 {
                let mut rollout = driver.rollout(&learner.policy(), 16);
                if let (1, Observations::Vector(obs)) = (i, &mut rollout.obs) {
                    *obs = permuted(obs, 6, &mut rng);
                }
                learner.update(&rollout).expect("finite");
            }
            learner.save(path).expect("written");
        }
        let [a, b] = files.map(|path| std::fs::read(path).expect("readable"));
        assert!(a == b, "normalised: {norm_obs}");
    }
}

#[test]
fn more_empty_slots_change_no_bit() {
    for norm_obs in [false, true] {
        let outputs = [3, 8].map(|slots| {
            let config = PpoConfig { norm_obs, ..config(set(16, slots)) };
            let mut learner = learner_of(config, slots, 3, DeviceKind::Flex);
            train(&mut learner, slots, 3, 3);
            let mut rng = Streams::new(4).stream("rows", 0);
            let rows: Vec<f32> = (0..40).flat_map(|_| Around::draw(3, &mut rng).observe(slots, &[2, 0, 1])).collect();
            learner.policy().forward(&[], &rows, 40).expect("finite")
        });
        assert_eq!(outputs[0], outputs[1], "normalised: {norm_obs}");
    }
}

#[test]
fn an_agent_sees_the_same_things_alone_and_among_others() {
    for device in DeviceKind::CPU {
        let policy = learner_of(config(set(16, 6)), 6, 3, device).policy();
        let rows = any_rows(6);
        let all = policy.forward(&[], &rows, 40).expect("finite");
        for (row, obs) in rows.chunks_exact(obs_dim(6)).enumerate() {
            let alone = policy.forward(&[], obs, 1).expect("finite");
            assert_eq!((&alone.head[..], alone.values[0]), (&all.head[row * 2..row * 2 + 2], all.values[row]));
        }
    }
}

#[test]
fn a_loaded_learner_of_sets_goes_on_bit_for_bit_on_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let config = PpoConfig { norm_obs: true, ..config(set(32, 8)) };
    let whole = |threads: usize, name: &str| {
        Workers::new(threads).bound(|| {
            among_awake_workers(|| {
                let mut learner = learner_of(config.clone(), 8, 5, DeviceKind::Flex);
                let mut driver = Driver::new(64, 8, 5);
                for update in 0..4 {
                    if update == 2 && threads == 3 {
                        learner.save(&path("half")).expect("written");
                        learner = PpoLearner::load(&path("half"), DeviceKind::Flex).expect("read");
                    }
                    let rollout = driver.rollout(&learner.policy(), 16);
                    learner.update(&rollout).expect("finite");
                }
                learner.save(&path(name)).expect("written");
            });
        });
        std::fs::read(path(name)).expect("readable")
    };
    let one = whole(1, "one");
    assert!(one == whole(2, "two") && one == whole(3, "resumed"));
}

#[test]
fn the_things_of_a_set_share_their_normalisation() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint");
    let mut learner = learner_of(PpoConfig { norm_obs: true, ..config(set(16, 6)) }, 6, 3, DeviceKind::Flex);
    let rollout = Driver::new(16, 6, 3).rollout(&learner.policy(), 16);
    learner.update(&rollout).expect("finite");
    learner.save(&path).expect("written");
    let bytes = std::fs::read(&path).expect("readable");
    let file = safetensors::SafeTensors::deserialize(&bytes).expect("safetensors");
    let numbers =
        |name: &str| -> Vec<f64> { bytemuck::pod_collect_to_vec(file.tensor(name).expect("a normaliser").data()) };
    let (mean, var, counts) = (numbers("obs_norm.mean"), numbers("obs_norm.var"), numbers("obs_norm.counts"));
    let Observations::Vector(obs) = &rollout.obs else { panic!("vectors") };
    let things: Vec<f64> = obs
        .chunks_exact(obs_dim(6))
        .flat_map(|row| row[1..].chunks_exact(WIDTH + 1).filter(|slot| slot[0] == 1.0).map(|slot| f64::from(slot[1])))
        .collect();
    let n = things.len() as f64;
    let by_hand = things.iter().sum::<f64>() / n;
    let deviation = things.iter().map(|x| (x - by_hand).powi(2)).sum::<f64>() / n;
    for slot in 0..6 {
        let at = 1 + slot * (WIDTH + 1);
        assert_eq!((mean[at], var[at]), (0.0, 1.0), "presences stay");
        assert_eq!((mean[at + 1], var[at + 1], counts[at + 1]), (mean[2], var[2], n + 1e-4));
    }
    assert!((mean[2] - by_hand).abs() < 1e-6 && (var[2] - deviation).abs() < 1e-4, "{} {by_hand}", mean[2]);
}

#[test]
fn a_policy_file_keeps_the_sets() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bot.policy");
    let mut learner = learner(set(16, 6), 6, 5);
    train(&mut learner, 6, 1, 5);
    let metadata = PolicyMetadata {
        observations: ["x".to_owned()].into_iter().chain(EntitySet::names("enemy", 6, &["dx", "colour"])).collect(),
        ..PolicyMetadata::default()
    };
    let file = PolicyFile { metadata, policy: learner.policy(), skills: None };
    let rows = any_rows(6);
    file.save(&path, &rows[..obs_dim(6)], &[], 1).expect("written");
    let loaded = PolicyFile::load(&path, DeviceKind::Flex).expect("read");
    assert_eq!((loaded.policy.entities(), loaded.policy.spec()), (vec![block(6)], learner.spec()));
    assert_eq!(EntitySet::all_in(&loaded.metadata.observations)[0].to_string(), "enemy: up to 6 with dx, colour");
    let of = |policy: &Policy| policy.forward(&[], &rows, 40).expect("finite");
    assert_eq!(of(&loaded.policy), of(&learner.policy()));
    let load = |path: &Path| PolicyFile::load(path, DeviceKind::Flex).map(drop);
    for (place, value, words) in [
        ("/policy/actor/entities/blocks/0/start", 2, "lie in the 19 observed values"),
        ("/policy/actor/entities/blocks/0/width", 3, "`actor` reads observations of"),
        ("/policy/actor/entities/obs_dim", 20, "`actor` reads observations of"),
        ("/policy/actor/entities/hidden", 15, "`actor` reads observations of"),
    ] {
        let error = after(&path, load, |contents| describe(contents, place, value.into())).to_string();
        assert!(error.contains(words), "{place}: {error}");
    }
}

#[test]
fn without_sets_the_setting_is_without_effect_and_not_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = [EntityKind::default(), EntityKind::Set { hidden: 3, blocks: Vec::new() }, EntityKind::Flat];
    let files = files.map(|entities| {
        let mut learner = learner(entities, 3, 1);
        train(&mut learner, 3, 1, 1);
        let path = folder.path().join("checkpoint");
        learner.save(&path).expect("written");
        assert_eq!(learner.policy().entities(), []);
        std::fs::read(path).expect("readable")
    });
    let text = String::from_utf8_lossy(&files[0][..4000]).into_owned();
    assert!(!text.contains("entities") && text.contains("norm_obs"), "{text}");
    let weights = |bytes: &[u8]| {
        let file = safetensors::SafeTensors::deserialize(bytes).expect("safetensors");
        file.tensor("actor.l0.weight").expect("a layer").data().to_vec()
    };
    assert!(weights(&files[0]) == weights(&files[1]) && weights(&files[0]) == weights(&files[2]));
}

#[test]
fn settings_that_do_not_fit_are_refused() {
    let spec = PolicySpec { obs: obs_dim(3).into(), latent: 0, action_space: SPACE };
    let text = |config: PpoConfig, spec| {
        PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect_err("it does not fit").to_string()
    };
    assert!(text(config(set(16, 4)), spec).contains("set 0, of 4 slots with 2 numbers each, takes the values 1..13"));
    assert!(text(config(set(0, 3)), spec).contains("ppo.entities"));
    let stack = PpoConfig { memory: MemoryKind::Stack { ticks: 3 }, ..config(set(16, 3)) };
    assert!(text(stack.clone(), spec).contains("use a Gru"));
    let flat = PpoConfig { entities: EntityKind::Flat, ..stack };
    assert!(PpoLearner::new(flat, spec, 1, DeviceKind::Flex).is_ok());
    let image = playbot_learner::ImageShape { channels: 3, height: 64, width: 64 };
    let error = text(config(set(16, 3)), PolicySpec { obs: image.into(), ..spec });
    assert!(error.contains("sets of things are parts of vectors"), "{error}");
}

fn names(slots: usize, beside: &[&str]) -> Vec<String> {
    beside.iter().map(|name| (*name).to_owned()).chain(EntitySet::names("thing", slots, &["dx", "colour"])).collect()
}

#[test]
fn a_policy_gets_more_slots_and_values_beside_them_and_stays_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint");
    for norm_obs in [false, true] {
        let mut old = learner_of(PpoConfig { norm_obs, ..config(set(16, 3)) }, 3, 5, DeviceKind::Flex);
        train(&mut old, 3, 2, 5);
        old.save(&path).expect("written");
        let map = InputMap::by_name(&names(3, &["one"]), &names(5, &["fuel", "one"])).expect("all are there");
        let wide = EntityBlock { start: 2, ..block(5) };
        let entities = EntityKind::Set { hidden: 16, blocks: vec![wide] };
        let spec = PolicySpec { obs: (1 + obs_dim(5)).into(), latent: 0, action_space: SPACE };
        let fresh = |entities| {
            PpoLearner::new(PpoConfig { norm_obs, ..config(entities) }, spec, 6, DeviceKind::Flex).expect("good")
        };
        let mut new = fresh(entities.clone());
        let start = StartFrom { inputs: Some(&map), moments: true, ..StartFrom::new(&path) };
        let report = new.start_from(&start).expect("it has more");
        assert!(report.taken.contains(&"actor.entities".to_owned()) && report.anew.is_empty(), "{report}");
        assert_eq!((report.new_inputs, report.is_same_policy), (1, false), "more things would be seen at once");
        let mut rng = Streams::new(6).stream("rows", 0);
        for _ in 0..40 {
            let around = Around::draw(below(&mut rng, 4), &mut rng);
            let expected = old.policy().forward(&[], &around.observe(3, &[0, 1, 2]), 1).expect("finite");
            let fuel = [unit(&mut rng) as f32];
            let row: Vec<f32> = fuel.into_iter().chain(around.observe(5, &shuffled(5, &mut rng))).collect();
            assert_eq!(new.policy().forward(&[], &row, 1).expect("finite"), expected);
        }
        let error = |learner: &mut PpoLearner| learner.start_from(&start).expect_err("others").to_string();
        let text = error(&mut fresh(EntityKind::Flat));
        assert!(text.contains("it reads sets of things as sets, and the new run value by value"), "{text}");
        assert!(text.contains("`ppo.entities` and `skills.entities`"), "{text}");
        let text = error(&mut fresh(EntityKind::Set { hidden: 8, blocks: vec![wide] }));
        assert!(text.contains("its sets of things are others"), "{text}");
    }
}

// Skill models of sets.

fn demos(slots: usize, order: Option<u64>) -> Dataset {
    let streams = Streams::new(21);
    let mut orders = Streams::new(order.unwrap_or_default()).stream("orders", 0);
    let episodes = (0..60).map(|i| {
        let mut rng = streams.stream("demo", i);
        let (mut observations, mut actions) = (Vec::new(), Vec::new());
        for _ in 0..12 {
            let around = Around::draw(below(&mut rng, 4), &mut rng);
            observations.extend(around.observe(slots, &[0, 1, 2]));
            actions.push(around.side());
        }
        if order.is_some() {
            observations = permuted(&observations, slots, &mut orders);
        }
        DatasetEpisode { observations: observations.into(), actions: Actions::Discrete(actions) }
    });
    Dataset::new(obs_dim(slots), SPACE, episodes.collect()).expect("consistent")
}

fn skills(norm_obs: bool, order: Option<u64>) -> SkillTrainer {
    let config = SkillConfig { norm_obs, entities: set(16, 5), ..crate::skill::config() };
    let mut trainer = SkillTrainer::new(config, demos(5, order), 1, DeviceKind::Flex).expect("windows fit");
    for _ in 0..2 {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer
}

#[test]
fn a_policy_over_sets_starts_as_an_exact_copy_of_the_decoder() {
    for norm_obs in [false, true] {
        let model = skills(norm_obs, None).into_model();
        let memory = MemoryKind::Gru { hidden: 8, sequence: 8, burn_in: 0 };
        for memory in [MemoryKind::None, memory] {
            // The settings of its own encoder are without effect: the decoder brings one.
            let config = PpoConfig { memory, ..config(set(7, 5)) };
            let learner = PpoLearner::with_skill(config, Score::default(), &model, 1, DeviceKind::Flex);
            let learner = learner.expect("good settings");
            let (rows, mut rng) = (any_rows(5), Streams::new(9).stream("z", 0));
            let z: Vec<f32> = (0..40 * model.latent()).map(|_| unit(&mut rng) as f32).collect();
            assert_eq!(learner.initial_kl(&z, (&rows).into(), 40).expect("a copy"), Some(0.0));
            let policy = learner.policy();
            assert_eq!(policy.entities(), [block(5)]);
            let moved = permuted(&rows, 5, &mut rng);
            let output = policy.forward(&z, &rows, 40).expect("finite");
            assert_eq!(output, policy.forward(&z, &moved, 40).expect("finite"));
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("bot.policy");
            let file = PolicyFile { metadata: PolicyMetadata::default(), policy, skills: learner.skills() };
            file.save(&path, &rows, &z, 40).expect("written");
            let loaded = PolicyFile::load(&path, DeviceKind::Flex).expect("the examples agree");
            assert_eq!(loaded.policy.forward(&z, &rows, 40).expect("finite"), output);
        }
        let stack = PpoConfig { memory: MemoryKind::Stack { ticks: 2 }, ..config(EntityKind::Flat) };
        let error = PpoLearner::with_skill(stack, Score::default(), &model, 1, DeviceKind::Flex).expect_err("a stack");
        assert!(error.to_string().contains("skills.entities"), "{error}");
    }
}

#[test]
fn a_policy_sees_sets_through_a_normaliser_that_knows_them() {
    let of_flat = |norm_obs| {
        let config = SkillConfig { norm_obs, entities: EntityKind::Flat, ..crate::skill::config() };
        SkillTrainer::new(config, demos(5, None), 1, DeviceKind::Flex).expect("windows fit").into_model()
    };
    let score = Score { init_from_decoder: false, ..Score::default() };
    let learner = |model: &SkillModel, entities| {
        PpoLearner::with_skill(config(entities), score.clone(), model, 1, DeviceKind::Flex)
    };
    let error = learner(&of_flat(true), set(16, 5)).expect_err("presences would be normalised").to_string();
    assert!(error.contains("`ppo.entities` must be like `skills.entities`"), "{error}");
    assert!(learner(&of_flat(true), EntityKind::Flat).is_ok() && learner(&of_flat(false), set(16, 5)).is_ok());
    assert!(learner(&skills(true, None).into_model(), set(7, 5)).is_ok());
}

#[test]
fn a_score_learner_of_sets_goes_on_bit_for_bit() {
    let model = skills(false, None).into_model();
    let learner = PpoLearner::with_skill(config(set(16, 5)), Score::default(), &model, 1, DeviceKind::Flex);
    let mut learner = learner.expect("good settings");
    let folder = tempfile::tempdir().expect("a folder");
    let (path, latent) = (folder.path().join("checkpoint"), model.latent());
    let rollout = |learner: &PpoLearner, seed: u64| {
        let mut rng = Streams::new(seed).stream("z", 0);
        let (envs, rows) = (40, any_rows(5));
        let z: Vec<f32> = (0..envs * latent).map(|_| unit(&mut rng) as f32).collect();
        let output = learner.policy().forward(&z, &rows, envs).expect("finite");
        let mut rollout = Rollout::new(envs, obs_dim(5), latent, &SPACE);
        let actions = (0..envs as u32).map(|row| row % 2).collect::<Vec<_>>();
        let log_prob = |(row, action): (usize, &u32)| output.head[row * 2 + *action as usize];
        let step = RolloutStep {
            obs: (&rows).into(),
            z: &z,
            log_probs: &actions.iter().enumerate().map(log_prob).collect::<Vec<_>>(),
            actions: &Actions::Discrete(actions),
            values: &output.values,
            rewards: &(0..envs).map(|row| row as f32 / 40.0).collect::<Vec<_>>(),
            terminated: &vec![true; envs],
            truncated: &vec![false; envs],
            final_values: &vec![0.0; envs],
        };
        rollout.push_step(step).expect("discrete");
        rollout.next_values = vec![0.0; envs];
        (rollout.ends.next_z, rollout.ends.next_obs) = (z, rows.into());
        rollout
    };
    learner.update(&rollout(&learner, 1)).expect("finite");
    learner.save(&path).expect("written");
    let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
    let next = rollout(&learner, 2);
    assert_eq!(loaded.update(&next).expect("finite"), learner.update(&next).expect("finite"));
}

#[test]
fn skills_are_the_same_in_any_order_of_slots() {
    let folder = tempfile::tempdir().expect("a folder");
    for norm_obs in [false, true] {
        let files = [None, Some(1)].map(|order| {
            let path = folder.path().join("skills");
            skills(norm_obs, order).into_model().save(&path).expect("written");
            let model = SkillModel::load(&path, DeviceKind::Flex).expect("read");
            assert_eq!(model.config().entities, set(16, 5));
            std::fs::read(path).expect("readable")
        });
        assert!(files[0] == files[1], "normalised: {norm_obs}");
    }
}

#[test]
fn sac_is_not_tied_to_skills_of_sets() {
    let model = skills(false, None).into_model();
    let config = playbot_learner::SacConfig::default();
    let learner = playbot_learner::SacLearner::with_skill(config, Score::default(), &model, 1, DeviceKind::Flex);
    let error = learner.expect_err("it reads values").to_string();
    assert!(error.contains("`skills.entities=Flat`"), "{error}");
}
