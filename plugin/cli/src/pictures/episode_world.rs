//! The World of the shown episode.

use crate::error::CliError;
use bevy::prelude::*;
use bevy_playbot::{
    demo::{file::DemoEpisode, replay::Divergence},
    engine::{Renewal, panics::PanicReports},
    policy::Decision,
    skill_prior::NamedSkill,
    vision::ObservationConfig,
};
use playbot_harness::{eval::Player, game::Game, prelude::*, worlds::build_observing_world};
use playbot_learner::{ObsKind, Observations, SkillDraw};
use std::sync::Arc;

/// Observation and action of an agent in one tick.
pub struct EpisodeStep {
    /// Tick of the episode, from 0.
    pub tick: u32,
    /// Its observation, as in [`Observation::image`].
    pub image: Vec<u8>,
    /// Its observation in numbers.
    pub vector: Vec<f32>,
    /// Its action, in words.
    pub action: String,
    /// Return that its policy expected, if it has a critic.
    pub value: Option<f32>,
    /// Its skill; empty if there is none.
    pub skill: Vec<f32>,
    /// Name of the region in which the skill lies, if it has one.
    pub skill_name: Option<String>,
    /// Its reward.
    pub reward: f32,
}

/// One agent in one episode.
pub struct EpisodeWorld {
    world: World,
    agent: Entity,
    action_names: Vec<String>,
    skill_names: Vec<NamedSkill>,
    level: u64,
    ticks: u32,
    over: bool,
}

#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
struct End(Option<EpisodeEnded>);

impl EpisodeWorld {
    /// Makes a World in which a player plays a level; `seed` is the random seed.
    ///
    /// # Errors
    ///
    /// The pictures cannot be made.
    pub fn playing(
        game: &dyn Game,
        mode: &str,
        observation_config: &ObservationConfig,
        level: u64,
        player: &Player,
        seed: u64,
    ) -> Result<Self, CliError> {
        let mut new = Self::new(game, mode, observation_config, level, seed)?;
        let control = player.seat(game, &mut new.world, new.agent);
        player.install(&mut new.world);
        new.world.entity_mut(new.agent).insert(control);
        Ok(new)
    }

    /// Makes a World that replays a recorded episode.
    ///
    /// # Errors
    ///
    /// The pictures cannot be made.
    pub fn replaying(
        game: &dyn Game,
        mode: &str,
        observation_config: &ObservationConfig,
        episode: DemoEpisode,
    ) -> Result<Self, CliError> {
        let mut new = Self::new(game, mode, observation_config, episode.level_seed, 0)?;
        new.over = episode.is_empty();
        Replay::begin(Arc::new(episode), &mut new.world.entity_mut(new.agent));
        Ok(new)
    }

    /// Writes no recording if the game panics: the caller has one.
    pub fn keep_no_panic_files(&mut self) {
        if let Some(mut reports) = self.world.get_resource_mut::<PanicReports>() {
            reports.keep_no_files();
        }
    }

    fn new(
        game: &dyn Game,
        mode: &str,
        observation_config: &ObservationConfig,
        level: u64,
        seed: u64,
    ) -> Result<Self, CliError> {
        let (mut world, agents) = build_observing_world(game, mode, observation_config, seed, 0, 1)?;
        let agent = agents[0];
        Renewal::set_up(&mut world, move |world| {
            world.init_resource::<End>();
            world.add_observer(move |ended: On<EpisodeEnded>, mut end: ResMut<End>| {
                if ended.entity == agent {
                    end.0 = Some(*ended);
                }
            });
        });
        Renewal::carry_resource::<End>(&mut world);
        // The sensor for pictures has replaced the vector, which a player may read.
        let vector = VectorSensor::new(game.observation().names);
        world.entity_mut(agent).insert((vector, LevelQueue::Always(level)));
        Ok(Self {
            world,
            agent,
            action_names: game.tools().input.action_names(),
            skill_names: Vec::new(),
            level,
            ticks: 0,
            over: false,
        })
    }

    /// Plays one tick; `None` after the end.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or the pictures fail.
    #[allow(clippy::should_implement_trait, reason = "`?` ends the loop at a failure")]
    pub fn next(&mut self) -> Result<Option<EpisodeStep>, CliError> {
        if self.over {
            return Ok(None);
        }
        self.world.tick()?;
        let step = self.step();
        self.ticks += 1;
        let replayed = self.world.get::<Replay>(self.agent).is_some_and(Replay::is_finished);
        self.over = replayed || self.end().is_some();
        Ok(Some(step))
    }

    /// Names regions of skills.
    pub fn name_skills(&mut self, regions: Vec<NamedSkill>) {
        self.skill_names = regions;
    }

    /// Follows a skill from the next tick on, to the end of the episode.
    pub fn follow(&mut self, z: &[f32]) {
        // The episode may begin in that tick, which ends skills that are not held.
        self.world.entity_mut(self.agent).insert(ActiveSkill { z: z.to_vec(), ticks_left: ActiveSkill::HELD });
    }

    /// Draws a skill from a prior, as it would be drawn in the next tick, which is played.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or the prior was made for other observations.
    pub fn draw_skill(
        &mut self,
        prior: &SkillPrior,
        draw: SkillDraw,
        normal: &mut dyn FnMut() -> f32,
    ) -> Result<Vec<f32>, CliError> {
        self.world.tick()?;
        let kind = prior.prior.observation().unwrap_or(ObsKind::Vector(0));
        let mut observations = Observations::empty(&kind);
        if let Some(observation) = self.world.get::<Observation>(self.agent) {
            observation.push_to(&mut observations);
        }
        Ok(prior.prior.sample(&observations, 1, draw, &mut |_| normal())?)
    }

    /// Returns the step after a tick, in which an agent still carries the observation that it acted on.
    fn step(&self) -> EpisodeStep {
        let agent = self.world.entity(self.agent);
        let by_policy = agent.get::<Control>() == Some(&Control::Policy);
        let decided = agent.get::<Decision>().filter(|_| by_policy);
        let skill = agent.get::<ActiveSkill>().map(|skill| skill.z.clone()).unwrap_or_default();
        EpisodeStep {
            tick: self.ticks,
            image: agent.get::<Observation>().map(|seen| seen.image.clone()).unwrap_or_default(),
            vector: agent.get::<Observation>().map(|seen| seen.vector.clone()).unwrap_or_default(),
            action: agent.get::<Action>().map(|action| self.describe(&action.0)).unwrap_or_default(),
            // A policy without a critic has the value 0 everywhere.
            value: decided.map(|decision| decision.value).filter(|value| *value != 0.0),
            skill_name: NamedSkill::name_of(&self.skill_names, &skill).map(str::to_owned),
            skill,
            reward: agent.get::<Reward>().map_or(0.0, Reward::get),
        }
    }

    fn describe(&self, action: &ActionValue) -> String {
        match action {
            ActionValue::Discrete(index) => match self.action_names.get(*index as usize) {
                Some(name) => name.clone(),
                None => format!("action {index}"),
            },
            ActionValue::Continuous(values) => {
                values.iter().map(|value| format!("{value:+.2}")).collect::<Vec<_>>().join(" ")
            }
            ActionValue::Mixed { choices, numbers } => {
                let options = choices.iter().map(u32::to_string);
                options.chain(numbers.iter().map(|value| format!("{value:+.2}"))).collect::<Vec<_>>().join(" ")
            }
        }
    }

    /// Returns the position of the agent, if the game reports it.
    pub fn position(&self, game: &dyn Game) -> Option<Vec2> {
        game.tools().state.position(&self.world, self.agent).filter(|position| position.is_finite())
    }

    /// Returns the number of entities in the World.
    pub fn entities(&self) -> u32 {
        self.world.entity_count()
    }

    /// Returns the level.
    pub fn level(&self) -> u64 {
        self.level
    }

    /// Returns the ticks played so far.
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Returns the end of the episode, once it has ended.
    pub fn end(&self) -> Option<EpisodeEnded> {
        self.world.resource::<End>().0
    }

    /// Returns the first difference of a recording from the game.
    pub fn divergence(&self) -> Option<&Divergence> {
        self.world.get::<Replay>(self.agent)?.divergence()
    }
}
