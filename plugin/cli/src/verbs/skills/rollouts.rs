//! The state, and the rollout of a skill from it.

use crate::{
    error::CliError,
    pictures::{
        Film,
        caption::{NumberBars, Reach},
        episode_world::EpisodeWorld,
    },
    verbs::skills::SkillNames,
};
use bevy_playbot::{episode::EpisodeEnd, vision::ObservationConfig};
use playbot_harness::{eval::Player, game::Game};
use playbot_learner::{SkillDraw, rng};
use serde_json::{Value, json};

/// Rollouts of skills from one state. Each begins at the start of the level, so that all share the same state.
pub(super) struct Rollouts<'a> {
    pub game: &'a dyn Game,
    pub mode: &'a str,
    pub level: u64,
    pub seed: u64,
    pub player: &'a Player,
    pub observation_config: ObservationConfig,
    /// Tick at which a skill begins.
    pub tick: u32,
    /// Ticks for which it is followed.
    pub ticks: u32,
    pub scale: u32,
}

/// What a skill does.
pub(super) struct Rollout {
    /// An animated PNG.
    pub picture: Vec<u8>,
    /// Sum of rewards, from the state on.
    pub sum: f64,
    /// Ticks that were played from the state on.
    pub ticks: u32,
    /// The end, if the episode ended.
    pub end: Option<EpisodeEnd>,
    /// Positions of the agent, if the game reports them.
    pub path: Vec<[f32; 2]>,
}

impl Rollouts<'_> {
    /// Returns the number of values of a skill.
    pub fn latent(&self) -> usize {
        match self.player {
            Player::Policy { prior: Some(prior), .. } => prior.prior.latent(),
            _ => 0,
        }
    }

    /// Plays up to the state.
    fn state(&self) -> Result<EpisodeWorld, CliError> {
        let Self { game, mode, level, seed, player, .. } = *self;
        let mut world = EpisodeWorld::playing(game, mode, &self.observation_config, level, player, seed)?;
        while world.ticks() < self.tick {
            if world.next()?.is_none() {
                return Err(CliError::Usage(format!(
                    "there is no tick {}: the policy ends level {level} after {} ticks",
                    self.tick,
                    world.ticks()
                )));
            }
        }
        Ok(world)
    }

    /// Follows a skill from the state on.
    pub fn of(&mut self, z: &[f32], names: &SkillNames) -> Result<Rollout, CliError> {
        let mut world = self.state()?;
        world.name_skills(names.regions.clone());
        world.follow(z);
        let (mut steps, mut reach, mut path) = (Vec::new(), Reach::default(), Vec::new());
        // Before the first tick there is no level, and the agent has no position in it.
        let start = if self.tick > 0 { world.position(self.game) } else { None };
        path.extend(start.map(|position| position.to_array()));
        while (steps.len() as u32) < self.ticks {
            let Some(step) = world.next()? else { break };
            reach.include(&step.vector);
            path.extend(world.position(self.game).map(|position| position.to_array()));
            steps.push(step);
        }
        let film = if self.observation_config.is_image() {
            Film::new(self.observation_config.image, self.scale, self.game.tick_hz())?
        } else {
            Film::of_numbers(NumberBars::new(self.game.observation().names, self.scale, &reach), self.game.tick_hz())
        };
        let (picture, _) = film.animated(&steps, || {})?;
        let sum = steps.iter().map(|step| f64::from(step.reward)).sum();
        Ok(Rollout { picture, sum, ticks: steps.len() as u32, end: world.end().map(|end| end.result.end), path })
    }

    /// Draws skills from the prior at the state.
    pub fn draws(&mut self, count: usize) -> Result<Vec<Vec<f32>>, CliError> {
        let Player::Policy { prior: Some(prior), .. } = self.player else { return Ok(Vec::new()) };
        let mut draws = Vec::new();
        for index in 0..count {
            // The state's own observation is made in its first tick.
            let mut world = self.state()?;
            let mut stream = rng::Streams::new(self.seed).stream("skills", index as u64);
            draws.push(world.draw_skill(prior, SkillDraw::Sample, &mut || rng::normal(&mut stream))?);
        }
        Ok(draws)
    }
}

impl Rollout {
    fn end_words(&self) -> &'static str {
        match self.end {
            Some(EpisodeEnd::Terminated { success: true }) => "won",
            Some(EpisodeEnd::Terminated { success: false }) => "lost",
            Some(EpisodeEnd::Truncated) => "out of time",
            None => "goes on",
        }
    }

    /// Returns all but the picture.
    pub fn as_json(&self, z: &[f32], names: &SkillNames) -> Value {
        json!({
            "z": z, "return": self.sum, "ticks": self.ticks, "end": self.end_words(), "name": names.of(z),
            "path": self.path,
        })
    }

    /// Returns all, with the picture as a `data:` address.
    pub fn with_picture(&self, z: &[f32], names: &SkillNames) -> Value {
        let mut value = self.as_json(z, names);
        value["picture"] = format!("data:image/png;base64,{}", playbot_report::base64(&self.picture)).into();
        value
    }
}
