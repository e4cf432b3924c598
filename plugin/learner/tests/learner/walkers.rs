//! Walkers in the plane, and skills of walking straight on that know of no goal.

use playbot_learner::rng::{ChaCha8Rng, Streams, normal, unit};
use playbot_learner::{
    Action, ActionSpace, Actions, Dataset, DemoEpisode, DeviceKind, Learner, Rollout, RolloutStep, SkillConfig,
    SkillModel, SkillSource, SkillTrainer,
};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

const OBS: usize = 4;
pub const SPACE: ActionSpace = ActionSpace::Continuous(2);
const SPEED: f32 = 0.1;
const NEAR: f32 = 0.25;
const LIMIT: usize = 40;

/// Somebody at a place in [-1, 1]² with a goal; the action is a velocity. Coming nearer pays.
#[derive(Clone, Copy)]
struct Walker {
    place: [f32; 2],
    goal: [f32; 2],
    time: usize,
}

impl Walker {
    fn new(rng: &mut ChaCha8Rng) -> Self {
        let mut draw = || [(); 2].map(|()| 2.0 * unit(rng) as f32 - 1.0);
        Self { place: draw(), goal: draw(), time: 0 }
    }

    fn observe(&self) -> [f32; OBS] {
        [self.place[0], self.place[1], self.goal[0], self.goal[1]]
    }

    fn distance(&self) -> f32 {
        (self.place[0] - self.goal[0]).hypot(self.place[1] - self.goal[1])
    }

    /// Reward, terminated, truncated.
    fn step(&mut self, velocity: &[f32]) -> (f32, bool, bool) {
        self.time += 1;
        let before = self.distance();
        for (x, v) in self.place.iter_mut().zip(velocity) {
            *x = (*x + SPEED * v.clamp(-1.0, 1.0)).clamp(-1.0, 1.0);
        }
        (before - self.distance(), self.distance() < NEAR, self.time == LIMIT)
    }
}

/// A skill model of walks in directions that change every ten ticks and have nothing to do with the goal.
pub fn skills_of_directions() -> SkillModel {
    let mut rng = Streams::new(5).stream("walks", 0);
    let episodes = (0..60).map(|_| {
        let mut walker = Walker::new(&mut rng);
        let (mut obs, mut actions) = (Vec::new(), Vec::new());
        for tick in 0..30 {
            let angle = if tick % 10 == 0 { TAU * unit(&mut rng) } else { f64::NAN };
            if angle.is_finite() {
                walker.goal = [angle.cos() as f32, angle.sin() as f32];
            }
            let mut noisy = |x: f32| 0.8 * x + 0.1 * normal(&mut rng);
            let action = [noisy(walker.goal[0]), noisy(walker.goal[1])];
            // What it heads for is not in what it sees.
            let [x, y, ..] = walker.observe();
            obs.extend([x, y, 2.0 * unit(&mut rng) as f32 - 1.0, 2.0 * unit(&mut rng) as f32 - 1.0]);
            walker.step(&action);
            actions.extend(action);
        }
        DemoEpisode { observations: obs.into(), actions: Actions::Continuous { dim: 2, values: actions } }
    });
    let dataset = Dataset::new(OBS, SPACE, episodes.collect()).expect("consistent");
    let config = SkillConfig {
        latent: 2,
        window: 5,
        beta: 0.02,
        hidden: vec![32],
        encoder_hidden: 32,
        gru_hidden: 32,
        gru_layers: 1,
        lr: 5e-3,
        batch: 32,
        ..SkillConfig::default()
    };
    let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("windows fit");
    for _ in 0..40 {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer.into_model()
}

/// Several walkers, each with a skill of its own.
pub struct Walkers {
    walkers: Vec<Walker>,
    rngs: Vec<ChaCha8Rng>,
    skills: Vec<Vec<f32>>,
    left: Vec<usize>,
    horizon: usize,
    reached: Vec<bool>,
}

impl Walkers {
    pub fn new(envs: usize, horizon: usize, seed: u64) -> Self {
        let streams = Streams::new(seed);
        let mut rngs: Vec<_> = (0..envs as u64).map(|i| streams.stream("walker", i)).collect();
        let walkers = rngs.iter_mut().map(Walker::new).collect();
        Self { walkers, rngs, skills: vec![Vec::new(); envs], left: vec![0; envs], horizon, reached: Vec::new() }
    }

    fn observe(&self) -> Vec<f32> {
        self.walkers.iter().flat_map(Walker::observe).collect()
    }

    /// New skills for those whose have run out.
    fn draw(&mut self, source: &SkillSource) {
        for (row, walker) in self.walkers.iter().enumerate() {
            if self.left[row] > 0 {
                continue;
            }
            let rng = &mut self.rngs[row];
            let z = source.prior.sample(&walker.observe(), 1, source.draw, &mut |_| normal(rng)).expect("finite");
            (self.skills[row], self.left[row]) = (z, self.horizon);
        }
    }

    fn shares_left(&self) -> Vec<f32> {
        self.left.iter().map(|&left| if left == 0 { 1.0 } else { left as f32 / self.horizon as f32 }).collect()
    }

    /// Plays `ticks` ticks with the learner's policy and its skills.
    pub fn rollout(&mut self, learner: &impl Learner, ticks: usize) -> Rollout {
        let (envs, policy, source) = (self.walkers.len(), learner.policy(), learner.skills().expect("it has skills"));
        let latent = learner.rollout_latent();
        let mut rollout = Rollout::new(envs, OBS, latent, &SPACE);
        for _ in 0..ticks {
            self.draw(&source);
            let (obs, z) = (self.observe(), self.skills.concat());
            let output = policy.forward(&z, &obs, envs).expect("finite");
            let (mut actions, mut log_probs) = (Actions::empty(&SPACE), Vec::new());
            let (mut rewards, mut terminated, mut truncated) = (Vec::new(), Vec::new(), Vec::new());
            let left = self.shares_left();
            for (row, walker) in self.walkers.iter_mut().enumerate() {
                let (action, log_prob) = output.sample(row, &mut self.rngs[row]);
                actions.push(&action).expect("continuous");
                let Action::Continuous(velocity) = action else { panic!("continuous") };
                let (reward, end, cut) = walker.step(&velocity);
                log_probs.push(log_prob);
                rewards.push(reward);
                terminated.push(end);
                truncated.push(cut);
                self.left[row] -= 1;
            }
            let last = self.observe();
            let step = RolloutStep {
                obs: (&obs).into(),
                z: &z,
                actions: &actions,
                log_probs: &log_probs,
                values: &output.values,
                rewards: &rewards,
                terminated: &terminated,
                truncated: &truncated,
                final_values: &policy.values(&z, &last, envs).expect("finite"),
            };
            rollout.push_step(step).expect("continuous");
            rollout.push_left(&left);
            for row in 0..envs {
                if truncated[row] && !terminated[row] {
                    rollout.push_cut(row, &last[row * OBS..(row + 1) * OBS], &self.skills[row]).expect("vectors");
                }
                if truncated[row] || terminated[row] {
                    self.reached.push(terminated[row]);
                    (self.walkers[row], self.left[row]) = (Walker::new(&mut self.rngs[row]), 0);
                }
            }
        }
        let (obs, z) = (self.observe(), self.skills.concat());
        rollout.next_values = policy.values(&z, &obs, envs).expect("finite");
        rollout.ends.next_left = self.shares_left();
        rollout.ends.cut_left = vec![1.0; rollout.ends.cut_rows.len()];
        (rollout.ends.next_obs, rollout.ends.next_z) = (obs.into(), z);
        rollout
    }

    /// Share of the episodes of `ticks` ticks of play that reach their goals.
    pub fn success(&mut self, learner: &impl Learner, ticks: usize) -> f64 {
        self.rollout(learner, ticks);
        self.reached.iter().filter(|reached| **reached).count() as f64 / self.reached.len() as f64
    }
}
