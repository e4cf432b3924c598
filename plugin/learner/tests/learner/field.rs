//! Points with goals in the plane, and a driver that plays them, with skills or without.

use crate::tick::Tick;
use playbot_learner::rng::{ChaCha8Rng, Streams, normal, unit};
use playbot_learner::{ActionSpace, ActionValue, Learner, Rollout, SkillSource};

pub const OBS: usize = 4;
pub const SPACE: ActionSpace = ActionSpace::Continuous(2);

/// Rules of motion, arrival and reward.
#[derive(Debug)]
pub struct Rules {
    /// Distance of a full action.
    pub speed: f32,
    /// Distance from the goal that counts as arrived.
    pub near: f32,
    /// Steps until an episode is cut off.
    pub limit: usize,
    /// Steps at the beginning of an episode in which the goal is seen.
    pub shown: usize,
    /// Place and goal of every episode; `None` to draw them.
    pub route: Option<[[f32; 2]; 2]>,
    /// Reward of a step, by the distances before and after it.
    pub reward: fn(f32, f32) -> f32,
}

/// Each step costs the remaining distance.
pub static HURRY: Rules =
    Rules { speed: 0.2, near: 0.15, limit: 30, shown: usize::MAX, route: None, reward: |_, after| -after };
/// Coming nearer is rewarded.
pub static WALK: Rules =
    Rules { speed: 0.1, near: 0.25, limit: 40, shown: usize::MAX, route: None, reward: |before, after| before - after };
/// The same, with a goal that is seen once.
pub static RECALL: Rules = Rules { shown: 1, ..WALK };
/// A goal that is not seen, in the opposite corner, and pays when it is reached.
pub static FAR: Rules = Rules {
    speed: 0.07,
    near: 0.4,
    limit: 60,
    shown: 0,
    route: Some([[-0.9, -0.9], [0.9, 0.9]]),
    reward: |_, after| if after < 0.4 { 1.0 } else { 0.0 },
};

/// A point at (x, y) in [-1, 1]² and its goal; the action is a velocity.
#[derive(Clone, Copy)]
pub struct Point {
    pub place: [f32; 2],
    pub goal: [f32; 2],
    time: usize,
}

impl Point {
    pub fn new(rng: &mut ChaCha8Rng) -> Self {
        let mut draw = || [(); 2].map(|()| 2.0 * unit(rng) as f32 - 1.0);
        Self { place: draw(), goal: draw(), time: 0 }
    }

    /// Begins an episode of these rules.
    fn begin(rules: &Rules, rng: &mut ChaCha8Rng) -> Self {
        match rules.route {
            Some([place, goal]) => Self { place, goal, time: 0 },
            None => Self::new(rng),
        }
    }

    pub fn observe(&self) -> [f32; OBS] {
        [self.place[0], self.place[1], self.goal[0], self.goal[1]]
    }

    /// Returns what these rules let a player see.
    fn seen(&self, rules: &Rules) -> [f32; OBS] {
        let [x, y, ..] = self.observe();
        if self.time < rules.shown { self.observe() } else { [x, y, 0.0, 0.0] }
    }

    fn distance(&self) -> f32 {
        (self.place[0] - self.goal[0]).hypot(self.place[1] - self.goal[1])
    }

    /// Steps the point and returns reward, terminated, truncated.
    pub fn step(&mut self, rules: &Rules, velocity: &[f32]) -> (f32, bool, bool) {
        self.time += 1;
        let before = self.distance();
        for (x, v) in self.place.iter_mut().zip(velocity) {
            *x = (*x + rules.speed * v.clamp(-1.0, 1.0)).clamp(-1.0, 1.0);
        }
        let after = self.distance();
        ((rules.reward)(before, after), after < rules.near, self.time == rules.limit)
    }
}

/// The skill that a point plays; empty without skills.
#[derive(Clone, Default)]
struct Held {
    z: Vec<f32>,
    left: usize,
    /// What the policy over skills remembered before it was drawn, and after; empty without memory.
    before: Vec<f32>,
    now: Vec<f32>,
}

/// Several points at once, each with a skill of its own if there are any, and the results of their episodes.
pub struct Field {
    rules: &'static Rules,
    points: Vec<Point>,
    rngs: Vec<ChaCha8Rng>,
    skills: Vec<Held>,
    /// For each finished episode, true if it reached its goal.
    pub reached: Vec<bool>,
}

impl Field {
    pub fn new(rules: &'static Rules, envs: usize, seed: u64) -> Self {
        let streams = Streams::new(seed);
        let mut rngs: Vec<_> = (0..envs as u64).map(|i| streams.stream("point", i)).collect();
        let points = rngs.iter_mut().map(|rng| Point::begin(rules, rng)).collect();
        Self { rules, points, rngs, skills: vec![Held::default(); envs], reached: Vec::new() }
    }

    fn observe(&self) -> Vec<f32> {
        self.points.iter().flat_map(|point| point.seen(self.rules)).collect()
    }

    fn z(&self) -> Vec<f32> {
        self.skills.iter().flat_map(|held| held.z.iter().copied()).collect()
    }

    /// Draws new skills in place of those that have run out.
    fn draw(&mut self, source: &SkillSource) {
        for ((held, point), rng) in self.skills.iter_mut().zip(&self.points).zip(&mut self.rngs) {
            if held.left == 0 {
                let noise = &mut |_| normal(rng);
                let seen = point.seen(self.rules);
                held.before = std::mem::take(&mut held.now);
                held.before.resize(source.prior.memory(), 0.0);
                (held.z, held.now) =
                    (source.prior).sample_remembering(&seen, &held.before, 1, source.draw, noise).expect("finite");
                held.left = source.skill_interval;
            }
        }
    }

    /// Returns the remaining share of each skill.
    fn shares_left(&self, source: &SkillSource) -> Vec<f32> {
        let share = |held: &Held| if held.left == 0 { 1.0 } else { held.left as f32 / source.skill_interval as f32 };
        self.skills.iter().map(share).collect()
    }

    /// Plays `ticks` ticks with the learner's policy, and its skills if it has any.
    pub fn rollout(&mut self, learner: &impl Learner, ticks: usize) -> Rollout {
        let (envs, policy, source) = (self.points.len(), learner.policy(), learner.skills());
        let mut rollout = Rollout::new(envs, OBS, learner.rollout_latent(), &SPACE);
        for _ in 0..ticks {
            if let Some(source) = &source {
                self.draw(source);
                rollout.push_left(&self.shares_left(source));
                rollout.push_memory(&self.skills.iter().flat_map(|held| held.before.clone()).collect::<Vec<_>>());
            }
            let (obs, z) = (self.observe(), self.z());
            let output = policy.forward(&z, &obs, envs).expect("finite");
            let mut tick = Tick::new(&SPACE);
            for (row, point) in self.points.iter_mut().enumerate() {
                let (action, log_prob) = output.sample(row, &mut self.rngs[row]);
                let ActionValue::Continuous(velocity) = &action else { panic!("continuous") };
                tick.push(&action, log_prob, point.step(self.rules, velocity));
                self.skills[row].left = self.skills[row].left.saturating_sub(1);
            }
            let last = self.observe();
            tick.add_to(&mut rollout, (&obs).into(), &z, &output.values);
            for row in 0..envs {
                if tick.truncated[row] && !tick.terminated[row] {
                    let obs = &last[row * OBS..(row + 1) * OBS];
                    rollout.push_cut(row, obs, &self.skills[row].z).expect("vectors");
                    rollout.ends.cut_memory.extend_from_slice(&self.skills[row].now);
                }
                if tick.is_done(row) {
                    self.reached.push(tick.terminated[row]);
                    self.points[row] = Point::begin(self.rules, &mut self.rngs[row]);
                    (self.skills[row].left, self.skills[row].now) = (0, Vec::new());
                }
            }
        }
        if let Some(source) = &source {
            rollout.ends.next_left = self.shares_left(source);
            rollout.ends.cut_left = vec![1.0; rollout.ends.cut_rows.len()];
            for held in &self.skills {
                let (memory, end) = (&mut rollout.ends.next_memory, source.prior.memory());
                let all = memory.len() + end;
                memory.extend_from_slice(&held.now);
                memory.resize(all, 0.0);
            }
        }
        (rollout.ends.next_obs, rollout.ends.next_z) = (self.observe().into(), self.z());
        rollout.bootstrap(&policy).expect("they fit");
        rollout
    }

    /// Returns the share of the episodes of `ticks` ticks of play that reach their goals.
    pub fn success(mut self, learner: &impl Learner, ticks: usize) -> f64 {
        self.rollout(learner, ticks);
        self.reached.iter().filter(|reached| **reached).count() as f64 / self.reached.len() as f64
    }
}
