//! PPO and SAC bring a point to a goal in the plane.

use playbot_learner::rng::{ChaCha8Rng, Streams, unit};
use playbot_learner::{
    Action, ActionSpace, Actions, DeviceKind, EntropyCoef, Learner, ObsKind, PolicySpec, PpoConfig, PpoLearner,
    Rollout, RolloutStep, SacConfig, SacLearner, TimeLimit,
};

pub const OBS: usize = 4;
pub const SPACE: ActionSpace = ActionSpace::Continuous(2);
pub const SPEC: PolicySpec = PolicySpec { obs: ObsKind::Vector(OBS), latent: 0, action_space: SPACE };
/// How far a full action moves the point.
const SPEED: f32 = 0.2;
/// How near is there.
const NEAR: f32 = 0.15;
/// Steps until an episode is cut off.
const LIMIT: usize = 30;

/// A point at (x, y) in [-1, 1]² and its goal; the action is a velocity. Each step costs the distance that is left.
#[derive(Clone, Copy)]
struct Point {
    place: [f32; 2],
    goal: [f32; 2],
    time: usize,
}

impl Point {
    fn new(rng: &mut ChaCha8Rng) -> Self {
        let mut draw = || [(); 2].map(|()| 2.0 * unit(rng) as f32 - 1.0);
        Self { place: draw(), goal: draw(), time: 0 }
    }

    fn distance(&self) -> f32 {
        (self.place[0] - self.goal[0]).hypot(self.place[1] - self.goal[1])
    }

    /// Reward, terminated, truncated.
    fn step(&mut self, velocity: &[f32]) -> (f32, bool, bool) {
        self.time += 1;
        for (x, v) in self.place.iter_mut().zip(velocity) {
            *x = (*x + SPEED * v.clamp(-1.0, 1.0)).clamp(-1.0, 1.0);
        }
        (-self.distance(), self.distance() < NEAR, self.time == LIMIT)
    }
}

/// Several points at once, and how their episodes ended.
pub struct Field {
    points: Vec<Point>,
    rngs: Vec<ChaCha8Rng>,
    /// Whether each finished episode reached its goal.
    pub reached: Vec<bool>,
}

impl Field {
    pub fn new(envs: usize, seed: u64) -> Self {
        let streams = Streams::new(seed);
        let mut rngs: Vec<_> = (0..envs as u64).map(|i| streams.stream("point", i)).collect();
        Self { points: rngs.iter_mut().map(Point::new).collect(), rngs, reached: Vec::new() }
    }

    fn observe(&self) -> Vec<f32> {
        self.points.iter().flat_map(|p| [p.place[0], p.place[1], p.goal[0], p.goal[1]]).collect()
    }

    /// Plays `steps` ticks with the learner's policy.
    pub fn rollout(&mut self, learner: &impl Learner, steps: usize) -> Rollout {
        let (envs, policy) = (self.points.len(), learner.policy());
        let mut rollout = Rollout::new(envs, OBS, 0, &SPACE);
        let mut obs = self.observe();
        for _ in 0..steps {
            let output = policy.forward(&[], &obs, envs).expect("finite");
            let (mut actions, mut log_probs) = (Actions::empty(&SPACE), Vec::new());
            let (mut rewards, mut terminated, mut truncated) = (Vec::new(), Vec::new(), Vec::new());
            for (row, point) in self.points.iter_mut().enumerate() {
                let (action, log_prob) = output.sample(row, &mut self.rngs[row]);
                actions.push(&action).expect("continuous");
                let Action::Continuous(velocity) = action else { panic!("continuous") };
                let (reward, end, cut) = point.step(&velocity);
                log_probs.push(log_prob);
                rewards.push(reward);
                terminated.push(end);
                truncated.push(cut);
            }
            let last = self.observe();
            let step = RolloutStep {
                obs: (&obs).into(),
                z: &[],
                actions: &actions,
                log_probs: &log_probs,
                values: &output.values,
                rewards: &rewards,
                terminated: &terminated,
                truncated: &truncated,
                final_values: &policy.values(&[], &last, envs).expect("finite"),
            };
            rollout.push_step(step).expect("continuous");
            for row in 0..envs {
                if truncated[row] && !terminated[row] {
                    rollout.push_cut(row, &last[row * OBS..(row + 1) * OBS], &[]).expect("vectors");
                }
                if truncated[row] || terminated[row] {
                    self.reached.push(terminated[row]);
                    self.points[row] = Point::new(&mut self.rngs[row]);
                }
            }
            obs = self.observe();
        }
        rollout.next_values = policy.values(&[], &obs, envs).expect("finite");
        rollout.ends.next_obs = obs.into();
        rollout
    }

    /// Share of the episodes of `ticks` ticks of play that reach their goals.
    pub fn success(learner: &impl Learner, ticks: usize) -> f64 {
        let mut field = Self::new(32, 99);
        field.rollout(learner, ticks);
        field.reached.iter().filter(|reached| **reached).count() as f64 / field.reached.len() as f64
    }
}

/// Episodes of points that go straight to their goals, as rollouts of one environment each.
pub fn recordings(episodes: u64) -> Vec<Rollout> {
    let streams = Streams::new(21);
    let episode = |i| {
        let mut point = Point::new(&mut streams.stream("recorded", i));
        let mut rollout = Rollout::new(1, OBS, 0, &SPACE);
        loop {
            let Point { place: [x, y], goal: [to_x, to_y], .. } = point;
            let velocity = [to_x - x, to_y - y].map(|way| (5.0 * way).clamp(-1.0, 1.0));
            let obs = [x, y, to_x, to_y];
            let (reward, end, cut) = point.step(&velocity);
            let step = RolloutStep {
                obs: (&obs).into(),
                z: &[],
                actions: &Actions::Continuous { dim: 2, values: velocity.to_vec() },
                log_probs: &[0.0],
                values: &[0.0],
                rewards: &[reward],
                terminated: &[end],
                truncated: &[cut],
                final_values: &[0.0],
            };
            rollout.push_step(step).expect("continuous");
            if end || cut {
                rollout.next_values = vec![0.0];
                rollout.ends.next_obs = vec![0.0; OBS].into();
                return rollout;
            }
        }
    };
    (0..episodes).map(episode).filter(|rollout| rollout.terminated.last() == Some(&true)).collect()
}

pub fn sac_config() -> SacConfig {
    SacConfig {
        actor_lr: 2e-3,
        critic_lr: 2e-3,
        temperature_lr: 2e-3,
        batch: 64,
        buffer: 10_000,
        learning_starts: 256,
        num_steps: 8,
        actor_every: 1,
        tau: 0.02,
        gamma: 0.95,
        entropy: EntropyCoef::Auto { initial: 0.2, target_scale: None },
        hidden: vec![32, 32],
        ..SacConfig::default()
    }
}

/// Success after 2000 steps.
fn sac(config: SacConfig, seed: u64, device: DeviceKind) -> f64 {
    let steps = config.num_steps;
    let mut learner = SacLearner::new(config, SPEC, seed, device).expect("good settings");
    let mut field = Field::new(8, seed);
    while learner.transitions() < 2000 {
        learner.update(&field.rollout(&learner, steps)).expect("finite");
    }
    Field::success(&learner, 60)
}

#[test]
fn sac_reaches_the_goal() {
    let untrained = SacLearner::new(SacConfig { learning_starts: 0, ..sac_config() }, SPEC, 1, DeviceKind::Flex);
    let before = Field::success(&untrained.expect("good settings"), 60);
    assert!(before < 0.4, "without training {before} of the episodes succeed");
    for (seed, device) in [(1, DeviceKind::Flex), (2, DeviceKind::Flex), (1, DeviceKind::Ndarray)] {
        let after = sac(sac_config(), seed, device);
        assert!(after > 0.9, "seed {seed} on {device}: {after}");
    }
}

#[test]
fn sac_learns_from_normalised_numbers_and_with_a_fixed_temperature_too() {
    let normalised = SacConfig { norm_obs: true, norm_reward: true, ..sac_config() };
    let after = sac(normalised, 1, DeviceKind::Flex);
    assert!(after > 0.9, "normalised: {after}");
    let fixed =
        SacConfig { entropy: EntropyCoef::Fixed(0.02), actor_every: 2, time_limit: TimeLimit::Legacy, ..sac_config() };
    let after = sac(fixed, 1, DeviceKind::Flex);
    assert!(after > 0.9, "with a fixed temperature: {after}");
}

#[test]
fn ppo_reaches_the_goal() {
    let config = PpoConfig {
        lr: 3e-3,
        num_steps: 32,
        minibatches: 4,
        epochs: 8,
        gamma: 0.95,
        ent_coef: 0.0,
        hidden: vec![32, 32],
        ..PpoConfig::default()
    };
    let steps = config.num_steps;
    let mut learner = PpoLearner::new(config, SPEC, 1, DeviceKind::Flex).expect("good settings");
    let before = Field::success(&learner, 60);
    assert!(before < 0.5, "without training {before} of the episodes succeed");
    let mut field = Field::new(16, 1);
    for _ in 0..60 {
        learner.update(&field.rollout(&learner, steps)).expect("finite");
    }
    let after = Field::success(&learner, 60);
    assert!(after > 0.9, "{after}");
}
