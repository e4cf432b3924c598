//! A corridor, and a driver that plays it.

use playbot_learner::rng::{ChaCha8Rng, Streams, normal};
use playbot_learner::{ActionSpace, ActionValue, Actions, Learner, PolicyOutput, Rollout, RolloutStep, SkillDraw};

/// Steps until an episode is cut off.
const LIMIT: usize = 40;
/// Position of the goal; 0 is the start.
const GOAL: usize = 6;
/// Steps between two draws of a skill.
const SKILL_INTERVAL: usize = 4;

pub const OBS: usize = GOAL + 2;
pub const SPACE: ActionSpace = ActionSpace::Discrete(3);

/// One walker in a corridor. Action 1 leads forward, 0 back, 2 nowhere; at odd positions 0 and 1 change roles. Each
/// step costs 0.01, the goal gives 1.
#[derive(Clone, Default)]
pub struct Corridor {
    place: usize,
    time: usize,
}

impl Corridor {
    /// Writes the one-hot position, and a constant.
    pub fn observe(&self, out: &mut Vec<f32>) {
        out.extend((0..=GOAL).map(|p| if p == self.place { 1.0 } else { 0.0 }));
        out.push(1.0);
    }

    /// Returns its position; [`BEST`] is the goal.
    pub fn place(&self) -> usize {
        self.place
    }

    /// Returns the action that leads to the goal.
    pub fn best(&self) -> u32 {
        if self.place % 2 == 1 { 0 } else { 1 }
    }

    /// Steps the walker and returns reward, terminated, truncated.
    pub fn step(&mut self, action: u32) -> (f32, bool, bool) {
        self.time += 1;
        if action == self.best() {
            self.place += 1;
        } else if action != 2 {
            self.place = self.place.saturating_sub(1);
        }
        if self.place == GOAL { (1.0, true, false) } else { (-0.01, false, self.time == LIMIT) }
    }
}

/// Plays several corridors for a learner.
pub struct Driver {
    corridors: Vec<Corridor>,
    skills: Vec<f32>,
    rngs: Vec<ChaCha8Rng>,
    /// Length of each finished episode.
    pub lengths: Vec<usize>,
}

impl Driver {
    pub fn new(envs: usize, seed: u64) -> Self {
        let streams = Streams::new(seed);
        Self {
            corridors: vec![Corridor::default(); envs],
            skills: Vec::new(),
            rngs: (0..envs as u64).map(|i| streams.stream("play", i)).collect(),
            lengths: Vec::new(),
        }
    }

    fn observe(&self) -> Vec<f32> {
        let mut obs = Vec::new();
        self.corridors.iter().for_each(|c| c.observe(&mut obs));
        obs
    }

    /// Draws new skills in place of those that have run out (or for all).
    fn draw(&mut self, learner: &impl Learner, obs: &[f32], all: bool) {
        let Some(prior) = learner.prior() else { return };
        let rngs = &mut self.rngs;
        let fresh = prior
            .sample(obs, self.corridors.len(), SkillDraw::Sample, &mut |row| normal(&mut rngs[row]))
            .expect("a prior for these observations");
        let width = prior.latent();
        self.skills.resize(fresh.len(), 0.0);
        for (row, corridor) in self.corridors.iter().enumerate() {
            if all || corridor.time % SKILL_INTERVAL == 0 {
                let range = row * width..(row + 1) * width;
                self.skills[range.clone()].copy_from_slice(&fresh[range]);
            }
        }
    }

    /// Plays `steps` ticks with the learner's policy.
    pub fn rollout(&mut self, learner: &impl Learner, steps: usize) -> Rollout {
        let envs = self.corridors.len();
        let policy = learner.policy();
        let latent = learner.rollout_latent();
        let mut rollout = Rollout::new(envs, OBS, latent, &SPACE);
        let mut obs = self.observe();
        self.draw(learner, &obs, self.skills.is_empty());
        for _ in 0..steps {
            let output = policy.forward(&self.skills, &obs, envs).expect("finite");
            let (actions, log_probs) = self.act(&output);
            let z = self.skills.clone();
            let mut rewards = Vec::new();
            let (mut terminated, mut truncated) = (Vec::new(), Vec::new());
            for (corridor, &action) in self.corridors.iter_mut().zip(&actions) {
                let (reward, end, cut) = corridor.step(action);
                rewards.push(reward);
                terminated.push(end);
                truncated.push(cut);
            }
            let last = self.observe();
            let final_values = policy.values(&self.skills, &last, envs).expect("finite");
            for (row, corridor) in self.corridors.iter_mut().enumerate() {
                if terminated[row] || truncated[row] {
                    self.lengths.push(corridor.time);
                    *corridor = Corridor::default();
                }
            }
            let step = RolloutStep {
                obs: (&obs).into(),
                z: &z,
                actions: &Actions::Discrete(actions),
                log_probs: &log_probs,
                values: &output.values,
                rewards: &rewards,
                terminated: &terminated,
                truncated: &truncated,
                final_values: &final_values,
            };
            rollout.push_step(step).expect("discrete");
            for row in (0..envs).filter(|&row| truncated[row] && !terminated[row]) {
                let skill = &z[row * latent..(row + 1) * latent];
                rollout.push_cut(row, &last[row * OBS..(row + 1) * OBS], skill).expect("vectors");
            }
            obs = self.observe();
            self.draw(learner, &obs, false);
        }
        rollout.next_values = policy.values(&self.skills, &obs, envs).expect("finite");
        rollout.ends.next_z = self.skills.clone();
        rollout.ends.next_obs = obs.into();
        rollout
    }

    fn act(&mut self, output: &PolicyOutput) -> (Vec<u32>, Vec<f32>) {
        let rows = self.rngs.iter_mut().enumerate().map(|(row, rng)| output.sample(row, rng));
        rows.map(|(action, log_prob)| match action {
            ActionValue::Discrete(action) => (action, log_prob),
            ActionValue::Continuous(_) | ActionValue::Mixed { .. } => panic!("the corridor is discrete"),
        })
        .unzip()
    }

    /// Returns the mean length of the last `n` episodes.
    pub fn recent(&self, n: usize) -> f64 {
        let last = &self.lengths[self.lengths.len().saturating_sub(n)..];
        last.iter().sum::<usize>() as f64 / last.len() as f64
    }
}

/// The shortest possible episode.
pub const BEST: f64 = GOAL as f64;
