//! Worlds in which detectors play themselves.

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

/// A World with one agent, who plays one level again and again, each time from the same seed.
pub struct Probe<'a> {
    /// The World.
    pub world: World,
    /// The agent.
    pub agent: Entity,
    stop: &'a dyn Fn() -> bool,
}

impl<'a> Probe<'a> {
    /// A World for so many episodes.
    ///
    /// # Errors
    ///
    /// The pictures that the player needs cannot be made.
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

    /// A World for one episode, in which the caller writes what the agent does before each tick.
    ///
    /// # Errors
    ///
    /// Its World cannot be made.
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
            // The detector's findings say how to see it again.
            reports.keep_no_files();
        }
        let agent = agents.into_iter().next().expect("one agent was asked for");
        let queue = LevelQueue::list(vec![level; seeds.len()]);
        world.entity_mut(agent).insert((queue, EpisodeSeeds::new(seeds)));
        Ok(Self { world, agent, stop: &|| false })
    }

    /// The same, for as long as nobody asks to stop.
    #[must_use]
    pub fn until(self, stop: &'a dyn Fn() -> bool) -> Self {
        Self { stop, ..self }
    }

    /// Whether an episode is over.
    pub fn is_over(&self) -> bool {
        self.world.get::<EpisodeCount>(self.agent).is_some_and(|count| count.finished > 0)
    }

    /// Plays a tick. Whether the agent is still playing.
    ///
    /// # Errors
    ///
    /// The game broke, or somebody asked to stop.
    pub fn tick(&mut self) -> Result<bool, Fault> {
        if (self.stop)() {
            return Err(Fault("somebody asked to stop".to_owned()));
        }
        tick_world(&mut self.world)?;
        Ok(Control::of(&self.world, self.agent).is_active())
    }
}
