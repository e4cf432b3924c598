//! A task whose state is a picture, and a driver that plays it.

use crate::tick::Tick;
use playbot_learner::nn::CnnKind;
use playbot_learner::rng::{ChaCha8Rng, Streams, below, normal};
use playbot_learner::{
    ActionSpace, ActionValue, Actions, Dataset, DatasetEpisode, DeviceKind, ImageShape, Learner, ObsKind, Observations,
    PpoConfig, Rollout, SkillConfig, SkillDraw, SkillModel, SkillTrainer,
};
use std::ops::ControlFlow;

/// Steps until an episode is cut off.
const LIMIT: usize = 8;
/// Steps between two draws of a skill.
const SKILL_INTERVAL: usize = 4;

/// Rows of a picture, and its columns.
pub const SIDE: usize = 12;
pub const SHAPE: ImageShape = ImageShape { channels: 1, height: SIDE, width: SIDE };
pub const SPACE: ActionSpace = ActionSpace::Discrete(4);
/// Steps of a window of [`skill_config`].
pub const WINDOW: usize = 4;

pub fn cnn() -> CnnKind {
    CnnKind::Impala { channels: vec![4, 4], feature: 8 }
}

pub fn config() -> PpoConfig {
    PpoConfig {
        lr: 2e-3,
        num_steps: 16,
        minibatches: 4,
        epochs: 3,
        gamma: 0.9,
        hidden: vec![16],
        cnn: cnn(),
        ..PpoConfig::default()
    }
}

/// Returns the settings of a small skill model of such pictures, which learns within a dozen epochs.
pub fn skill_config() -> SkillConfig {
    SkillConfig {
        latent: 2,
        window: WINDOW,
        hidden: vec![32],
        gru_hidden: 16,
        cnn: CnnKind::Impala { channels: vec![4, 4], feature: 16 },
        lr: 1e-2,
        batch: 16,
        ..SkillConfig::default()
    }
}

/// Returns a dark image with a bright spot of 3×3 pixels in one of its quarters: top left, top right, bottom left,
/// bottom right.
pub fn image(quarter: u32, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut pixels: Vec<u8> = (0..SHAPE.numbers()).map(|_| below(rng, 40) as u8).collect();
    let mut corner = |far: bool| below(rng, SIDE as u64 / 2 - 2) as usize + if far { SIDE / 2 } else { 0 };
    let (column, row) = (corner(quarter % 2 == 1), corner(quarter / 2 == 1));
    for y in row..row + 3 {
        pixels[y * SIDE + column..][..3].fill(255);
    }
    pixels
}

/// Returns demonstrations that follow the picture six times in ten, and guess otherwise, with settings to learn from
/// them.
pub fn demonstrations(seed: u64) -> (SkillConfig, Dataset) {
    let config = SkillConfig { beta: 0.5, window: 3, hidden: vec![16], gru_hidden: 8, cnn: cnn(), ..skill_config() };
    let mut rng = Streams::new(seed).stream("demos", 0);
    let episodes = (0..80).map(|_| {
        let quarters: Vec<u32> = (0..9).map(|_| below(&mut rng, 4) as u32).collect();
        let pixels: Vec<u8> = quarters.iter().flat_map(|&quarter| image(quarter, &mut rng)).collect();
        let mut name = |quarter| if below(&mut rng, 10) < 6 { quarter } else { below(&mut rng, 4) as u32 };
        let named = quarters.iter().map(|&quarter| name(quarter)).collect();
        DatasetEpisode { observations: pixels.into(), actions: Actions::Discrete(named) }
    });
    (config, Dataset::new(SHAPE, SPACE, episodes.collect()).expect("consistent"))
}

/// Returns a skill model of these [`demonstrations`]. Not trained at all for 0 epochs.
pub fn model(epochs: usize, seed: u64) -> SkillModel {
    let (config, dataset) = demonstrations(seed);
    let mut trainer = SkillTrainer::new(config, dataset, seed, DeviceKind::Flex).expect("windows fit");
    for _ in 0..epochs {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer.into_model()
}

/// Several players who earn 1 for each step on which they name the quarter of a spot that jumps about; a wrong name
/// ends the episode.
pub struct Driver {
    players: Vec<Player>,
    skills: Vec<f32>,
    /// For each answer, true if it was right.
    pub hits: Vec<bool>,
}

struct Player {
    rng: ChaCha8Rng,
    quarter: u32,
    time: usize,
    pixels: Vec<u8>,
}

impl Player {
    fn draw_picture(&mut self) {
        self.quarter = below(&mut self.rng, 4) as u32;
        self.pixels = image(self.quarter, &mut self.rng);
    }
}

impl Driver {
    pub fn new(envs: usize, seed: u64) -> Self {
        let streams = Streams::new(seed);
        let player = |i| {
            let rng = streams.stream("play", i);
            let mut player = Player { rng, quarter: 0, time: 0, pixels: Vec::new() };
            player.draw_picture();
            player
        };
        Self { players: (0..envs as u64).map(player).collect(), skills: Vec::new(), hits: Vec::new() }
    }

    fn observe(&self) -> Observations {
        let mut all = Observations::empty(&ObsKind::Image(SHAPE));
        self.players.iter().for_each(|player| all.push(&player.pixels).expect("images"));
        all
    }

    /// Draws new skills in place of those that have run out (or for all).
    fn draw(&mut self, learner: &impl Learner, obs: &Observations) {
        let Some(prior) = learner.prior() else { return };
        let (n, all) = (self.players.len(), self.skills.is_empty());
        let mut next = |row: usize| normal(&mut self.players[row].rng);
        let fresh = prior.sample(obs, n, SkillDraw::Sample, &mut next).expect("finite");
        self.skills.resize(fresh.len(), 0.0);
        for (row, player) in self.players.iter().enumerate() {
            if all || player.time.is_multiple_of(SKILL_INTERVAL) {
                let range = row * prior.latent()..(row + 1) * prior.latent();
                self.skills[range.clone()].copy_from_slice(&fresh[range]);
            }
        }
    }

    /// Plays `steps` ticks with the learner's policy.
    pub fn rollout(&mut self, learner: &impl Learner, steps: usize) -> Rollout {
        let (envs, policy, latent) = (self.players.len(), learner.policy(), learner.rollout_latent());
        let mut rollout = Rollout::new(envs, SHAPE, latent, &SPACE);
        let mut obs = self.observe();
        self.draw(learner, &obs);
        for _ in 0..steps {
            let output = policy.forward(&self.skills, &obs, envs).expect("finite");
            let z = self.skills.clone();
            let mut tick = Tick::new(&SPACE);
            for (row, player) in self.players.iter_mut().enumerate() {
                let (action, log_prob) = output.sample(row, &mut player.rng);
                let hit = action == ActionValue::Discrete(player.quarter);
                player.time += 1;
                player.draw_picture();
                tick.push(&action, log_prob, (f32::from(u8::from(hit)), !hit, hit && player.time == LIMIT));
                self.hits.push(hit);
            }
            tick.add_to(&mut rollout, obs.as_slice(), &z, &output.values);
            for (row, player) in self.players.iter_mut().enumerate() {
                if tick.truncated[row] {
                    rollout.push_cut(row, &player.pixels, &z[row * latent..(row + 1) * latent]).expect("images");
                }
                if tick.is_done(row) {
                    player.time = 0;
                    player.draw_picture();
                }
            }
            obs = self.observe();
            self.draw(learner, &obs);
        }
        (rollout.ends.next_obs, rollout.ends.next_z) = (obs, self.skills.clone());
        rollout.bootstrap(&policy).expect("they fit");
        rollout
    }

    /// Returns the share of right answers among the last `n`.
    pub fn recent(&self, n: usize) -> f64 {
        let last = &self.hits[self.hits.len().saturating_sub(n)..];
        last.iter().filter(|hit| **hit).count() as f64 / last.len() as f64
    }
}
