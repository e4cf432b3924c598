//! Worlds for detectors that play.

use bevy::prelude::*;
use bevy_playbot::{
    control::Control,
    episode::EpisodeCount,
    fault::Fault,
    headless::tick_world,
    level::LevelQueue,
    panics::PanicReports,
    streams::EpisodeSeeds,
    vision::{ObservationConfig, VisionError},
};

use crate::{eval::Player, game::Game, worlds::build_observing_world};

/// A World with one agent that plays one level again and again, each time from the same seed.
pub struct Probe<'a> {
    /// The World.
    pub world: World,
    /// The agent.
    pub agent: Entity,
    stop: &'a dyn Fn() -> bool,
}

impl<'a> Probe<'a> {
    /// Builds a World for this many episodes.
    ///
    /// # Errors
    ///
    /// The pictures that the player needs cannot be drawn.
    pub fn new(
        game: &dyn Game,
        mode: &str,
        level: u64,
        player: &Player,
        observation_config: &ObservationConfig,
        seeds: Vec<u64>,
    ) -> Result<Self, VisionError> {
        let mut probe = Self::empty(game, mode, level, observation_config, seeds)?;
        let control = player.seat(game, &mut probe.world, probe.agent);
        probe.world.entity_mut(probe.agent).insert(control);
        player.install(&mut probe.world);
        Ok(probe)
    }

    /// Builds a World for one episode, in which the caller sets the agent's action before each tick.
    ///
    /// # Errors
    ///
    /// The World cannot be built.
    pub fn led(game: &dyn Game, mode: &str, level: u64, seed: u64) -> Result<Self, VisionError> {
        let mut probe = Self::empty(game, mode, level, &ObservationConfig::default(), vec![seed])?;
        probe.world.entity_mut(probe.agent).insert(Control::Bot);
        Ok(probe)
    }

    fn empty(
        game: &dyn Game,
        mode: &str,
        level: u64,
        observation_config: &ObservationConfig,
        seeds: Vec<u64>,
    ) -> Result<Self, VisionError> {
        let (mut world, agents) = build_observing_world(game, mode, observation_config, 0, 0, 1)?;
        if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
            // The detector's findings name their own reproduction.
            reports.keep_no_files();
        }
        let agent = agents.into_iter().next().expect("one agent was asked for");
        let queue = LevelQueue::list(vec![level; seeds.len()]);
        world.entity_mut(agent).insert((queue, EpisodeSeeds::new(seeds)));
        Ok(Self { world, agent, stop: &|| false })
    }

    /// Makes the probe stop when `stop` returns true.
    #[must_use]
    pub fn until(self, stop: &'a dyn Fn() -> bool) -> Self {
        Self { stop, ..self }
    }

    /// Returns whether an episode is over.
    pub fn is_over(&self) -> bool {
        self.world.get::<EpisodeCount>(self.agent).is_some_and(|count| count.finished > 0)
    }

    /// Plays a tick. Returns whether the agent is still playing.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or `stop` returned true.
    pub fn tick(&mut self) -> Result<bool, Fault> {
        if (self.stop)() {
            return Err(Fault("the test was stopped".to_owned()));
        }
        tick_world(&mut self.world)?;
        Ok(Control::of(&self.world, self.agent).is_active())
    }
}
