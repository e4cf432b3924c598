//! Entities that pile up from episode to episode.

use crate::detectors::{LevelDefect, LevelDetector, ShownBy, TestedLevel};
use bevy::prelude::*;
use bevy_playbot::{
    agent::Control,
    bot::BlindBot,
    engine::{EpisodeSeeds, panics::PanicReports, tick_world},
    episode::{Episode, EpisodeCount},
    fault::Fault,
    level::LevelQueue,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{detector::DetectorSetting, eval::Player, game::Game, worlds::build_observing_world};

/// A finding for levels on which each episode leaves entities behind. Some levels are played a few times, each time up
/// to the same tick, and the entities in the World are counted.
pub struct EntityLeak {
    every: f64,
    ticks: f64,
    episodes: f64,
}

/// First episodes that may create permanent entities, such as pools.
const FIRST: usize = 2;

/// Most ticks of the World for each tick of an episode, for levels that take long to load.
const MOST_TRIES: u32 = 20;

impl Default for EntityLeak {
    fn default() -> Self {
        Self { every: 1000.0, ticks: 20.0, episodes: 6.0 }
    }
}

impl EntityLeak {
    /// Returns the number of entities after each episode; fewer numbers if the game panics.
    fn counts(&self, game: &dyn Game, mode: &str, level: u64, stop: &dyn Fn() -> bool) -> Vec<u32> {
        let (episodes, ticks) = (self.episodes as usize, self.ticks as u32);
        let player = Player::Blind(BlindBot::Uniform);
        let seeds = vec![0; episodes];
        let mut counts = Vec::new();
        let config = ObservationConfig::default();
        let Ok(probe) = Probe::new(game, mode, level, &player, &config, seeds) else {
            return counts;
        };
        let mut probe = probe.until(stop);
        for _ in 0..episodes {
            let finished =
                |probe: &Probe<'_>| probe.world.get::<EpisodeCount>(probe.agent).map_or(0, |count| count.finished);
            let before = finished(&probe);
            for _ in 0..ticks.saturating_mul(MOST_TRIES) {
                // Other detectors report a panic.
                if probe.tick().is_err() {
                    return counts;
                }
                let tick = probe.world.get::<Episode>(probe.agent).map_or(ticks, |episode| episode.tick);
                if tick >= ticks || finished(&probe) > before {
                    break;
                }
            }
            counts.push(probe.world.entity_count());
            if let Some(mut episode) = probe.world.get_mut::<Episode>(probe.agent) {
                episode.abandon();
            }
        }
        counts
    }

    /// Returns the message about a leak of a level, if there is one.
    fn leak(&self, game: &dyn Game, mode: &str, level: u64, stop: &dyn Fn() -> bool) -> Option<String> {
        // A World that is rebuilt has no entities left.
        if game.built_anew().is_some() {
            return None;
        }
        grows(&self.counts(game, mode, level, stop))
    }
}

impl LevelDetector for EntityLeak {
    fn name(&self) -> &'static str {
        "entity-leak"
    }

    fn describe(&self) -> &'static str {
        "every episode leaves entities behind"
    }

    fn is_default(&self) -> bool {
        true
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("every", &mut self.every, "look at every n-th level of the range").at_least(1.0),
            DetectorSetting::new("ticks", &mut self.ticks, "ticks of an episode").at_least(1.0),
            DetectorSetting::new("episodes", &mut self.episodes, "episodes on a level").at_least(4.0),
        ]
    }

    fn depends_on_testers(&self) -> bool {
        false
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        if !level.is_sample(self.every) {
            return Vec::new();
        }
        let leak = self.leak(level.game, level.mode, level.level, level.stop);
        leak.map(|message| LevelDefect { message, ..LevelDefect::default() }).into_iter().collect()
    }

    fn shown_by(&self) -> ShownBy {
        ShownBy::Level
    }

    fn is_in_level(&self, game: &dyn Game, mode: &str, level: u64) -> bool {
        self.leak(game, mode, level, &|| false).is_some()
    }
}

/// Returns the message if the count grows each time.
fn grows(counts: &[u32]) -> Option<String> {
    let later = counts.get(FIRST..).filter(|later| later.len() > 1)?;
    let leaks = later.windows(2).all(|pair| pair[0] < pair[1]);
    leaks.then(|| {
        let counts: Vec<String> = counts.iter().map(u32::to_string).collect();
        format!("there are more entities after each episode of the level: {}", counts.join(", "))
    })
}

/// A World with one agent that plays one level again and again, each time from the same seed.
pub struct Probe<'a> {
    /// The World.
    pub world: World,
    /// The agent.
    pub agent: Entity,
    stop: &'a dyn Fn() -> bool,
    /// Episodes that were over before the present ones.
    finished: u64,
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
        Ok(Self { world, agent, stop: &|| false, finished: 0 })
    }

    /// Makes the agent begin a level anew with the next tick, wherever it is, for one episode that the caller leads.
    pub fn begin_again(&mut self, level: u64, seed: u64) {
        let mut agent = self.world.entity_mut(self.agent);
        agent.insert((Control::Bot, LevelQueue::list([level]), EpisodeSeeds::new([seed])));
        self.finished = agent.get::<EpisodeCount>().map_or(0, |count| count.finished);
        if let Some(mut episode) = agent.get_mut::<Episode>() {
            episode.abandon();
            episode.tick = 0;
        }
    }

    /// Makes the probe stop when `stop` returns true.
    #[must_use]
    pub fn until(self, stop: &'a dyn Fn() -> bool) -> Self {
        Self { stop, ..self }
    }

    /// Returns whether an episode is over.
    pub fn is_over(&self) -> bool {
        self.world.get::<EpisodeCount>(self.agent).is_some_and(|count| count.finished > self.finished)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grows_each_time_leaks_and_what_comes_to_rest_does_not() {
        assert!(grows(&[10, 14, 18, 22, 26, 30]).is_some_and(|words| words.contains("10, 14, 18")));
        assert_eq!(grows(&[10, 14, 18, 18, 18, 18]), None, "a pool was filled");
        assert_eq!(grows(&[10, 14, 18, 16, 20, 24]), None);
        assert_eq!(grows(&[10, 20]), None, "too few to say anything");
    }
}
