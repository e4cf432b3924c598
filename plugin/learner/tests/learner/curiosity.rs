//! Curiosity: it finds a reward that play at random does not find, and all of its state is in checkpoints.

use crate::corridor::config;
use crate::tick::Tick;
use crate::toy::{self, Driver};
use crate::{image_task, pixels, score};
use playbot_learner::rng::{ChaCha8Rng, Streams};
use playbot_learner::{
    ActionSpace, ActionValue, Curiosity, DeviceKind, EndStates, Learner, Policy, PolicyFile, PolicyMetadata,
    PolicySpec, PpoConfig, PpoLearner, Rollout, ScoreConfig, StartFrom,
};

/// Places of a lock; the last one is open.
const PLACES: usize = 14;
const SPACE: ActionSpace = ActionSpace::Discrete(3);
/// Steps until an episode is cut off.
const LIMIT: usize = 60;

/// Several locks. One of three actions leads on, the others lead back to the first place. Only an open lock pays.
///
/// A player at random opens one in 3^13 tries.
struct Locks {
    /// Place and time of each.
    states: Vec<(usize, usize)>,
    rngs: Vec<ChaCha8Rng>,
    opened: usize,
    /// The farthest place that was reached.
    farthest: usize,
}

impl Locks {
    fn new(seed: u64) -> Self {
        let streams = Streams::new(seed);
        let rngs = (0..16).map(|i| streams.stream("play", i)).collect();
        Self { states: vec![(0, 0); 16], rngs, opened: 0, farthest: 0 }
    }

    fn observe(&self) -> Vec<f32> {
        self.states.iter().flat_map(|(place, _)| (0..PLACES).map(move |p| f32::from(u8::from(p == *place)))).collect()
    }

    fn rollout(&mut self, policy: &Policy, steps: usize) -> Rollout {
        let envs = self.states.len();
        let mut rollout = Rollout::new(envs, PLACES, 0, &SPACE);
        for _ in 0..steps {
            let obs = self.observe();
            let output = policy.forward(&[], &obs, envs).expect("finite");
            let mut tick = Tick::new(&SPACE);
            for (row, rng) in self.rngs.iter_mut().enumerate() {
                let (action, log_prob) = output.sample(row, rng);
                let (place, time) = &mut self.states[row];
                let is_right = action == ActionValue::Discrete((*place * *place % 3) as u32);
                *place = if is_right { *place + 1 } else { 0 };
                *time += 1;
                let is_open = *place == PLACES - 1;
                self.farthest = self.farthest.max(*place);
                self.opened += usize::from(is_open);
                tick.push(&action, log_prob, (f32::from(u8::from(is_open)), is_open, !is_open && *time == LIMIT));
            }
            tick.add_to(&mut rollout, (&obs).into(), &[], &output.values);
            let last = self.observe();
            for row in 0..envs {
                if tick.truncated[row] {
                    rollout.push_cut(row, &last[row * PLACES..(row + 1) * PLACES], &[]).expect("vectors");
                }
                if tick.is_done(row) {
                    self.states[row] = (0, 0);
                }
            }
        }
        rollout.ends.next_obs = self.observe().into();
        rollout.bootstrap(policy).expect("they fit");
        rollout
    }
}

fn curious(config: PpoConfig) -> PpoConfig {
    PpoConfig { curiosity: Curiosity::rnd(), ..config }
}

/// Returns the locks that were opened in a training, and the farthest place that was reached.
fn trained(config: PpoConfig, seed: u64) -> (usize, usize) {
    let spec = PolicySpec { obs: PLACES.into(), latent: 0, action_space: SPACE };
    let mut learner = PpoLearner::new(config, spec, seed, DeviceKind::Flex).expect("good settings");
    let mut locks = Locks::new(seed);
    for _ in 0..50 {
        let rollout = locks.rollout(&learner.policy(), 32);
        learner.update(&rollout).expect("finite");
    }
    (locks.opened, locks.farthest)
}

#[test]
fn a_curious_player_opens_a_lock_that_pays_at_the_end_only_and_another_does_not() {
    for seed in 1..=3 {
        let (plain, reached) = trained(config(), seed);
        assert!(plain == 0 && reached < PLACES - 1, "seed {seed}: PPO alone got to {reached} and opened {plain}");
        let (opened, reached) = trained(curious(config()), seed);
        assert!(opened > 500, "seed {seed}: a curious player got to {reached} and opened {opened}");
    }
}

fn toy_learner(config: PpoConfig, seed: u64) -> PpoLearner {
    let spec = PolicySpec { obs: toy::OBS.into(), latent: 0, action_space: toy::SPACE };
    PpoLearner::new(config, spec, seed, DeviceKind::Flex).expect("good settings")
}

#[test]
fn what_was_seen_often_is_predicted() {
    let mut learner = toy_learner(curious(config()), 1);
    let rollout = Driver::new(8, 1).rollout(&learner, 16);
    let loss = |learner: &mut PpoLearner| learner.update(&rollout).expect("finite").predictor_loss.expect("measured");
    let first = loss(&mut learner);
    let last = (0..60).map(|_| loss(&mut learner)).last().expect("some");
    assert!(first > 0.0 && last < 0.2 * first, "the error falls from {first} to {last}");
    let tags: Vec<_> = learner.learn(&rollout).expect("finite").scalars().collect();
    for tag in ["curiosity/intrinsic_reward", "curiosity/predictor_loss", "losses/intrinsic_value_loss"] {
        assert!(tags.iter().any(|(name, value)| *name == tag && *value > 0.0), "{tag} in {tags:?}");
    }
}

#[test]
fn a_curious_learner_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let [path, first, second] = ["saved", "first", "second"].map(|name| folder.path().join(name));
    let check = |mut learner: PpoLearner, play: &mut dyn FnMut(&PpoLearner) -> Rollout| {
        for _ in 0..2 {
            let rollout = play(&learner);
            learner.update(&rollout).expect("finite");
        }
        learner.save(&path).expect("written");
        let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
        assert_eq!(loaded.config(), learner.config());
        for _ in 0..2 {
            let rollout = play(&learner);
            let expected = learner.update(&rollout).expect("finite");
            assert!(expected.intrinsic_reward.expect("measured") > 0.0);
            assert_eq!(loaded.update(&rollout).expect("finite"), expected);
        }
        learner.save(&first).expect("written");
        loaded.save(&second).expect("written");
        let read = |path| std::fs::read(path).expect("readable");
        assert_eq!(read(&first), read(&second), "whole states are equal, byte for byte");
    };
    let mut driver = Driver::new(4, 1);
    check(toy_learner(curious(PpoConfig { norm_obs: true, ..config() }), 5), &mut |learner| {
        driver.rollout(learner, 16)
    });
    let with_skills = PpoLearner::with_skill(
        curious(config()),
        ScoreConfig { critic_clock: true, ..ScoreConfig::default() },
        &score::model(1),
        5,
        DeviceKind::Flex,
    );
    let mut driver = Driver::new(4, 1);
    check(with_skills.expect("good settings"), &mut |learner| driver.rollout(learner, 16));
    let mut driver = image_task::Driver::new(4, 1);
    check(pixels::ppo(curious(image_task::config()), 5), &mut |learner| driver.rollout(learner, 8));
    let mut driver = image_task::Driver::new(4, 1);
    let on_images = pixels::score(curious(image_task::config()), &image_task::model(1, 1), 5);
    check(on_images, &mut |learner| driver.rollout(learner, 8));
}

#[test]
fn learners_that_are_not_curious_have_nothing_of_it_in_their_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let holds = |config: PpoConfig, word: &str| {
        let mut learner = toy_learner(config, 1);
        learner.update(&Driver::new(4, 1).rollout(&learner, 16)).expect("finite");
        learner.save(&path).expect("written");
        String::from_utf8_lossy(&std::fs::read(&path).expect("readable")).contains(word)
    };
    for word in ["curiosity", "intrinsic", "predictor"] {
        assert!(!holds(config(), word) && holds(curious(config()), word), "{word}");
    }
}

#[test]
fn without_weight_for_what_is_new_the_policy_learns_as_if_it_were_not_curious() {
    let rollout = Driver::new(8, 1).rollout(&toy_learner(config(), 1), 16);
    let updated = |config: PpoConfig| {
        let mut learner = toy_learner(PpoConfig { max_grad_norm: 1e30, ..config }, 1);
        let metrics = learner.update(&rollout).expect("finite");
        (metrics.policy_loss, metrics.explained_variance, learner.updates())
    };
    let Curiosity::Rnd { gamma, share, lr, hidden, features, .. } = Curiosity::rnd() else { panic!("it is") };
    let weightless = Curiosity::Rnd { extrinsic: 1.0, intrinsic: 0.0, gamma, share, lr, hidden, features };
    // The second head shares hidden layers with the first, so that only the first step is the same.
    let one = PpoConfig { epochs: 1, minibatches: 1, ..config() };
    assert_eq!(updated(PpoConfig { curiosity: weightless, ..one.clone() }), updated(one.clone()));
    assert_ne!(updated(curious(one.clone())).0, updated(one).0);
}

#[test]
fn curiosity_begins_anew_or_goes_on_from_another_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let [curious_run, plain_run] = ["curious", "plain"].map(|name| folder.path().join(name));
    let rollout = Driver::new(4, 1).rollout(&toy_learner(config(), 1), 16);
    let saved = |config: PpoConfig, path: &std::path::Path| {
        let mut learner = toy_learner(config, 5);
        for _ in 0..20 {
            learner.update(&rollout).expect("finite");
        }
        learner.save(path).expect("written");
    };
    saved(curious(config()), &curious_run);
    saved(config(), &plain_run);
    let loss_from = |path: &std::path::Path| {
        let mut learner = toy_learner(curious(config()), 6);
        learner.start_from(&StartFrom::new(path)).expect("the same networks");
        learner.update(&rollout).expect("finite").predictor_loss.expect("measured")
    };
    let (gone_on, anew) = (loss_from(&curious_run), loss_from(&plain_run));
    assert!(gone_on < 0.8 * anew, "it knows what was seen before: {gone_on}, otherwise {anew}");
    let mut plain = toy_learner(config(), 6);
    plain.start_from(&StartFrom::new(&curious_run)).expect("the policy is the same");
    assert_eq!(plain.update(&rollout).expect("finite").predictor_loss, None);
    let small = Curiosity::Rnd {
        extrinsic: 2.0,
        intrinsic: 1.0,
        gamma: 0.99,
        share: 1.0,
        lr: 1e-3,
        hidden: vec![4],
        features: 2,
    };
    let mut other = toy_learner(PpoConfig { curiosity: small, ..config() }, 6);
    let report = other.start_from(&StartFrom::new(&curious_run)).expect("the policy is the same").to_string();
    assert!(report.contains("curiosity (another observation or network)"), "{report}");
}

#[test]
fn what_cannot_be_curious_says_so() {
    let mut learner = toy_learner(curious(config()), 1);
    let rollout = Driver::new(4, 1).rollout(&learner, 16);
    let lacking = Rollout { ends: EndStates::new(&toy::OBS.into()), ..rollout };
    let error = learner.update(&lacking).expect_err("no last states").to_string();
    assert!(error.contains("next_obs"), "{error}");
    let impossible = PpoConfig { curiosity: Curiosity::rnd(), lambda: 2.0, ..config() };
    assert!(impossible.validate().is_err());
}

#[test]
fn the_policy_that_plays_is_not_larger_than_that_of_a_learner_without_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = |config: PpoConfig| {
        let path = folder.path().join("policy.safetensors");
        let policy = toy_learner(config, 1).policy();
        let file = PolicyFile { metadata: PolicyMetadata::default(), policy, skills: None };
        file.save(&path, &[0.5; 3 * toy::OBS], &[], 3).expect("written");
        std::fs::read(path).expect("readable")
    };
    assert_eq!(bytes(curious(config())), bytes(config()));
}
