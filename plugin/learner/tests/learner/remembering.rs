//! Policies that remember: a maze whose cue is shown once, and the exactness of what is remembered.

use crate::corridor;
use crate::score::model;
use crate::toy::{OBS, SPACE};
use playbot_learner::rng::{ChaCha8Rng, Streams, unit};
use playbot_learner::{
    ActionSpace, ActionValue, Actions, DeviceKind, Learner, MemoryKind, Policy, PolicyFile, PolicyMetadata, PolicySpec,
    PpoConfig, PpoLearner, Rollout, RolloutStep, ScoreConfig, SkillModel, StartFrom,
};

/// Ticks from the cue to the junction.
const CORRIDOR: usize = 5;
const WIDTH: usize = 3;
const MEMORY: usize = 16;

/// A walker whose first observation says on which side the goal is. It walks by itself; at the junction it chooses.
#[derive(Clone)]
struct TMaze {
    goal: u32,
    time: usize,
    rng: ChaCha8Rng,
}

impl TMaze {
    fn new(rng: ChaCha8Rng) -> Self {
        let mut maze = Self { goal: 0, time: 0, rng };
        maze.begin();
        maze
    }

    fn begin(&mut self) {
        (self.time, self.goal) = (0, u32::from(unit(&mut self.rng) < 0.5));
    }

    fn observe(&self) -> [f32; WIDTH] {
        let cue = if self.goal == 1 { 1.0 } else { -1.0 };
        let at = |time| if self.time == time { 1.0 } else { 0.0 };
        [cue * at(0), at(CORRIDOR), 1.0]
    }

    /// Returns the reward, and whether the episode is over.
    fn step(&mut self, action: u32) -> (f32, bool) {
        self.time += 1;
        match self.time > CORRIDOR {
            true if action == self.goal => (1.0, true),
            true => (-1.0, true),
            false => (0.0, false),
        }
    }
}

/// Plays several mazes, and notes how many episodes were won.
struct Driver {
    mazes: Vec<TMaze>,
    rngs: Vec<ChaCha8Rng>,
    memory: Vec<f32>,
    won: Vec<bool>,
}

impl Driver {
    fn new(envs: usize, seed: u64) -> Self {
        let streams = Streams::new(seed);
        Self {
            mazes: (0..envs as u64).map(|i| TMaze::new(streams.stream("cues", i))).collect(),
            rngs: (0..envs as u64).map(|i| streams.stream("play", i)).collect(),
            memory: Vec::new(),
            won: Vec::new(),
        }
    }

    fn observe(&self) -> Vec<f32> {
        self.mazes.iter().flat_map(TMaze::observe).collect()
    }

    fn rollout(&mut self, policy: &Policy, steps: usize) -> Rollout {
        let (envs, width) = (self.mazes.len(), policy.memory());
        self.memory.resize(envs * width, 0.0);
        let mut rollout = Rollout::new(envs, WIDTH, 0, &ActionSpace::Discrete(2));
        for _ in 0..steps {
            let obs = self.observe();
            let output = policy.forward_remembering(&[], &[], &self.memory, &obs, envs).expect("finite");
            let before = std::mem::replace(&mut self.memory, output.memory.clone());
            let (mut actions, mut log_probs, mut rewards, mut terminated) = (vec![], vec![], vec![], vec![]);
            for (row, maze) in self.mazes.iter_mut().enumerate() {
                let (ActionValue::Discrete(action), log_prob) = output.sample(row, &mut self.rngs[row]) else {
                    panic!("actions are discrete");
                };
                let (reward, over) = maze.step(action);
                if over {
                    self.won.push(reward > 0.0);
                    maze.begin();
                    self.memory[row * width..(row + 1) * width].fill(0.0);
                }
                actions.push(action);
                log_probs.push(log_prob);
                rewards.push(reward);
                terminated.push(over);
            }
            let none = vec![false; envs];
            let step = RolloutStep {
                obs: (&obs).into(),
                z: &[],
                actions: &Actions::Discrete(actions),
                log_probs: &log_probs,
                values: &output.values,
                rewards: &rewards,
                terminated: &terminated,
                truncated: &none,
                final_values: &vec![0.0; envs],
            };
            rollout.push_step(step).expect("discrete");
            rollout.push_memory(&before);
        }
        let obs = self.observe();
        rollout.next_values = policy.values_remembering(&[], &[], &self.memory, &obs, envs).expect("finite");
        rollout.ends.next_obs = obs.into();
        rollout.ends.next_memory = self.memory.clone();
        rollout
    }
}

fn gru(sequence: usize, burn_in: usize) -> MemoryKind {
    MemoryKind::Gru { hidden: MEMORY, sequence, burn_in }
}

fn learner(memory: MemoryKind, seed: u64) -> PpoLearner {
    let config = PpoConfig { num_steps: 48, norm_reward: false, memory, ..corridor::config() };
    let spec = PolicySpec { obs: WIDTH.into(), latent: 0, action_space: ActionSpace::Discrete(2) };
    PpoLearner::new(config, spec, seed, DeviceKind::Flex).expect("good settings")
}

/// Returns the share of the last 400 episodes that was won, after a training.
fn won(memory: MemoryKind, seed: u64) -> f64 {
    let (mut learner, mut driver) = (learner(memory, seed), Driver::new(16, seed));
    for _ in 0..150 {
        let rollout = driver.rollout(&learner.policy(), 48);
        learner.update(&rollout).expect("finite");
    }
    driver.won.clear();
    while driver.won.len() < 400 {
        driver.rollout(&learner.policy(), 48);
    }
    driver.won.iter().filter(|won| **won).count() as f64 / driver.won.len() as f64
}

#[test]
fn only_a_policy_that_remembers_finds_the_goal_of_a_cue() {
    for seed in 1..=3 {
        let with = won(gru(16, 0), seed);
        assert!(with >= 0.95, "seed {seed}: {with} with memory");
        let without = won(MemoryKind::None, seed);
        assert!((0.4..0.6).contains(&without), "seed {seed}: {without} without");
    }
}

#[test]
fn a_stack_of_vectors_remembers_as_many_ticks() {
    let with = won(MemoryKind::Stack { ticks: CORRIDOR + 1 }, 1);
    assert!(with >= 0.95, "{with}");
    let too_few = won(MemoryKind::Stack { ticks: CORRIDOR }, 1);
    assert!((0.4..0.6).contains(&too_few), "{too_few}");
}

/// Vectors of two numbers in a stack of three, by hand.
#[test]
fn a_stack_has_the_newest_vector_first() {
    let config = PpoConfig { memory: MemoryKind::Stack { ticks: 3 }, ..corridor::config() };
    let spec = PolicySpec { obs: 2.into(), latent: 0, action_space: SPACE };
    let policy = PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings").policy();
    assert_eq!(policy.memory(), 4);
    let mut memory = Vec::new();
    let mut seen = |obs: &[f32]| {
        memory = policy.forward_remembering(&[], &[], &memory, obs, 1).expect("finite").memory;
        memory.clone()
    };
    assert_eq!(seen(&[1.0, 2.0]), [1.0, 2.0, 0.0, 0.0]);
    assert_eq!(seen(&[3.0, 4.0]), [3.0, 4.0, 1.0, 2.0]);
    assert_eq!(seen(&[5.0, 6.0]), [5.0, 6.0, 3.0, 4.0]);
}

#[test]
fn with_short_sequences_and_a_burn_in_too() {
    let with = won(gru(4, 4), 1);
    assert!(with >= 0.95, "{with}");
}

/// An update of a policy that does not move sees the probabilities with which it has played, although it reads whole
/// sequences instead of single ticks.
#[test]
fn what_is_learned_from_is_what_was_remembered_in_play() {
    for memory in [gru(64, 0), gru(5, 0), gru(3, 2), gru(1, 4), MemoryKind::Stack { ticks: 4 }] {
        let (mut learner, mut driver) = (learner(memory, 1), Driver::new(4, 1));
        for _ in 0..3 {
            learner.update(&driver.rollout(&learner.policy(), 48)).expect("finite");
        }
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("checkpoint.safetensors");
        learner.save(&path).expect("written");
        let still = PpoConfig { lr: 1e-30, ..learner.config().clone() };
        let spec = learner.spec();
        let mut learner = PpoLearner::new(still, spec, 1, DeviceKind::Flex).expect("good settings");
        learner.start_from(&StartFrom::new(&path)).expect("the same networks");
        let metrics = learner.update(&driver.rollout(&learner.policy(), 48)).expect("finite");
        assert!(metrics.approx_kl.abs() < 1e-6 && metrics.clip_fraction == 0.0, "{memory:?}: {metrics:?}");
        // With states that are not those of play it would not be so.
        let mut rollout = driver.rollout(&learner.policy(), 48);
        rollout.memory.iter_mut().for_each(|x| *x = 0.9 - *x);
        let metrics = learner.update(&rollout).expect("finite");
        assert!(metrics.approx_kl > 1e-5, "{memory:?}: {metrics:?}");
    }
}

#[test]
fn a_loaded_learner_that_remembers_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let (mut learner, mut driver) = (learner(gru(8, 2), 5), Driver::new(4, 1));
    for _ in 0..2 {
        learner.update(&driver.rollout(&learner.policy(), 16)).expect("finite");
    }
    learner.save(&path).expect("written");
    let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
    let rollout = driver.rollout(&learner.policy(), 16);
    let expected = learner.update(&rollout).expect("finite");
    assert_eq!(loaded.update(&rollout).expect("finite"), expected);
    let (first, second) = (folder.path().join("a"), folder.path().join("b"));
    learner.save(&first).expect("written");
    loaded.save(&second).expect("written");
    let read = |path| std::fs::read(path).expect("readable");
    assert_eq!(read(&first), read(&second));
}

#[test]
fn an_agent_remembers_the_same_alone_and_among_others() {
    for device in DeviceKind::CPU {
        let config = PpoConfig { memory: gru(8, 0), ..PpoConfig::default() };
        let spec = PolicySpec { obs: 40.into(), latent: 0, action_space: ActionSpace::Continuous(3) };
        let policy = PpoLearner::new(config, spec, 1, device).expect("good settings").policy();
        let n = 2100;
        let mut rng = Streams::new(1).stream("rows", 0);
        let mut numbers = |width: usize| -> Vec<f32> { (0..n * width).map(|_| unit(&mut rng) as f32 - 0.5).collect() };
        let (obs, memory) = (numbers(40), numbers(MEMORY));
        let all = policy.forward_remembering(&[], &[], &memory, &obs, n).expect("finite");
        for row in [0, 7, n - 1] {
            let (obs, memory) = (&obs[row * 40..(row + 1) * 40], &memory[row * MEMORY..(row + 1) * MEMORY]);
            let alone = policy.forward_remembering(&[], &[], memory, obs, 1).expect("finite");
            assert_eq!(alone.head, all.head[row * 3..(row + 1) * 3]);
            assert_eq!(alone.values, all.values[row..=row]);
            assert_eq!(alone.memory, all.memory[row * MEMORY..(row + 1) * MEMORY]);
        }
    }
}

#[test]
fn a_copy_of_the_decoder_with_memory_is_still_an_exact_copy() {
    let model = model(1);
    for memory in [gru(8, 0), MemoryKind::Stack { ticks: 3 }] {
        is_an_exact_copy(&model, memory);
    }
}

fn is_an_exact_copy(model: &SkillModel, memory: MemoryKind) {
    let config = PpoConfig { memory, ..corridor::config() };
    let learner = PpoLearner::with_skill(config, ScoreConfig::default(), model, 1, DeviceKind::Flex);
    let learner = learner.expect("good settings");
    let policy = learner.policy();
    let mut rng = Streams::new(9).stream("inputs", 0);
    let mut draw = |len: usize| (0..len).map(|_| unit(&mut rng) as f32).collect::<Vec<_>>();
    let (z, obs, memory) = (draw(33 * 2), draw(33 * OBS), draw(33 * policy.memory()));
    assert_eq!(learner.initial_kl(&z, (&obs).into(), 33).expect("a copy"), Some(0.0));
    let remembering = policy.forward_remembering(&z, &[], &memory, &obs, 33).expect("finite");
    assert_eq!(remembering.head, policy.forward(&z, &obs, 33).expect("finite").head, "whatever it remembers");
    assert_ne!(remembering.memory, policy.forward(&z, &obs, 33).expect("finite").memory);
}

#[test]
fn a_policy_file_keeps_the_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bot.policy");
    let (mut learner, mut driver) = (learner(gru(8, 0), 5), Driver::new(4, 1));
    learner.update(&driver.rollout(&learner.policy(), 16)).expect("finite");
    let file = PolicyFile { metadata: PolicyMetadata::default(), policy: learner.policy(), skills: None };
    file.save(&path, &[0.5, 0.1, 1.0], &[], 1).expect("written");
    let loaded = PolicyFile::load(&path, DeviceKind::Flex).expect("read").policy;
    assert_eq!((loaded.memory(), loaded.spec()), (MEMORY, learner.spec()));
    let memory = vec![0.3; MEMORY];
    let of = |policy: &Policy| policy.forward_remembering(&[], &[], &memory, &[0.2, 0.1, 1.0], 1).expect("finite");
    assert_eq!(of(&loaded), of(&learner.policy()));
}

#[test]
fn a_rollout_without_what_was_remembered_is_refused() {
    let mut learner = learner(gru(8, 0), 5);
    let mut rollout = Driver::new(4, 1).rollout(&learner.policy(), 16);
    (rollout.memory, rollout.ends.next_memory) = (Vec::new(), Vec::new());
    let text = learner.update(&rollout).expect_err("no memory").to_string();
    assert!(text.contains("memory of the rollout"), "{text}");
    let text = learner.policy().forward_remembering(&[], &[], &[1.0], &[0.0; WIDTH], 1).expect_err("too short");
    assert!(text.to_string().contains("memories"), "{text}");
    let config = PpoConfig { memory: gru(0, 0), ..corridor::config() };
    let text = config.validate().expect_err("no ticks").to_string();
    assert!(text.contains("ppo.memory"), "{text}");
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    assert!(PpoLearner::new(config, spec, 1, DeviceKind::Flex).is_err());
    let config = PpoConfig { memory: MemoryKind::Stack { ticks: 3 }, ..corridor::config() };
    let image = playbot_learner::ImageShape { channels: 3, height: 64, width: 64 };
    let text = config.check_observation(&image.into()).expect_err("pictures").to_string();
    assert!(text.contains("image.stack"), "{text}");
}

#[test]
fn a_policy_that_has_no_memory_can_get_one_and_stays_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let mut plain = learner(MemoryKind::None, 5);
    plain.update(&Driver::new(4, 1).rollout(&plain.policy(), 16)).expect("finite");
    plain.save(&path).expect("written");
    let obs = [0.4, -0.2, 1.0];
    let expected = plain.policy().forward(&[], &obs, 1).expect("finite");
    for memory in [gru(8, 0), MemoryKind::Stack { ticks: 3 }] {
        let mut learner = learner(memory, 6);
        let report = learner.start_from(&StartFrom { moments: true, ..StartFrom::new(&path) }).expect("it fits");
        assert!(report.is_same_policy && report.taken.contains(&"actor.head".to_owned()), "{report}");
        let memory = vec![0.7; learner.policy().memory()];
        let found = learner.policy().forward_remembering(&[], &[], &memory, &obs, 1).expect("finite");
        assert_eq!((found.head, found.values), (expected.head.clone(), expected.values.clone()), "{report}");
        learner.update(&Driver::new(4, 1).rollout(&learner.policy(), 16)).expect("it learns on");
    }
}

#[test]
fn what_remembers_is_not_widened() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    learner(gru(8, 0), 5).save(&path).expect("written");
    let refused = |memory, width: usize| {
        let config = PpoConfig { num_steps: 48, norm_reward: false, memory, ..corridor::config() };
        let spec = PolicySpec { obs: width.into(), latent: 0, action_space: ActionSpace::Discrete(2) };
        let mut learner = PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings");
        learner.start_from(&StartFrom::new(&path)).expect_err("it does not fit").to_string()
    };
    assert!(refused(gru(8, 0), WIDTH + 1).contains("of fewer inputs"));
    assert!(refused(MemoryKind::None, WIDTH).contains("and that of the new run is None: give it the same"));
    assert!(
        refused(MemoryKind::Gru { hidden: 4, sequence: 8, burn_in: 0 }, WIDTH)
            .contains("its `ppo.memory` is Gru(hidden:")
    );
}

#[test]
fn a_curious_policy_remembers_too() {
    let curiosity = ron::from_str("Rnd()").expect("all of it has defaults");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let config = PpoConfig { curiosity, memory: gru(8, 2), hidden: vec![16], ..PpoConfig::default() };
    let spec = PolicySpec { obs: WIDTH.into(), latent: 0, action_space: ActionSpace::Discrete(2) };
    let mut learner = PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings");
    let mut driver = Driver::new(4, 1);
    learner.update(&driver.rollout(&learner.policy(), 32)).expect("finite");
    learner.save(&path).expect("written");
    let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
    let rollout = driver.rollout(&learner.policy(), 32);
    assert_eq!(loaded.update(&rollout).expect("finite"), learner.update(&rollout).expect("finite"));
    let forgotten = playbot_learner::Rollout { memory: vec![0.0; rollout.memory.len()], ..rollout.clone() };
    let mut again = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
    assert_ne!(again.update(&forgotten).expect("finite"), loaded.update(&rollout).expect("finite"));
}
