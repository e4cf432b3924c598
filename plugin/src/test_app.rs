//! Helpers for tests of games that use the plugin. Plain functions and an extension trait, no macros: they work in any
//! test harness.

use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings, ScheduleLabel},
    prelude::*,
};

use crate::{
    agent::AgentOrder,
    control::Control,
    episode::EpisodeCount,
    fault::Fault,
    headless::{PlaybotAppExt, headless_app},
    state_hash::StateHash,
    systems::ObserveSchedule,
};

/// A headless app whose fixed schedules refuse systems in an ambiguous order, since such a game is not reproducible.
pub fn test_app() -> App {
    let mut app = headless_app();
    let strict = || ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() };
    for label in [FixedPreUpdate.intern(), FixedUpdate.intern(), FixedPostUpdate.intern(), ObserveSchedule.intern()] {
        app.edit_schedule(label, |schedule| {
            schedule.set_build_settings(strict());
        });
    }
    app
}

/// Questions that tests ask of an app with agents.
pub trait PlaybotTestExt {
    /// Ticks until every agent has finished at least `episodes` episodes or is idle.
    ///
    /// # Errors
    ///
    /// A fault of the game, or `limit` ticks without getting there.
    fn play_episodes(&mut self, episodes: u64, limit: u64) -> Result<u64, Fault>;

    /// Plays `ticks` ticks and returns the state hash of each agent after each tick: equal lists, equal games.
    ///
    /// # Errors
    ///
    /// A fault of the game.
    fn hash_trace(&mut self, ticks: u64) -> Result<Vec<u64>, Fault>;
}

impl PlaybotTestExt for App {
    fn play_episodes(&mut self, episodes: u64, limit: u64) -> Result<u64, Fault> {
        for tick in 0..limit {
            self.tick()?;
            let mut agents = self.world_mut().query::<(&Control, &EpisodeCount)>();
            let done = |(control, count): (&Control, &EpisodeCount)| count.finished >= episodes || !control.is_active();
            if agents.iter(self.world()).all(done) {
                return Ok(tick + 1);
            }
        }
        Err(Fault(format!("{limit} ticks were not enough for {episodes} episodes of every agent")))
    }

    fn hash_trace(&mut self, ticks: u64) -> Result<Vec<u64>, Fault> {
        let mut trace = Vec::new();
        for _ in 0..ticks {
            self.tick()?;
            let world = self.world();
            let agents = world.resource::<AgentOrder>().entities();
            trace.extend(agents.iter().filter_map(|&agent| world.get::<StateHash>(agent)).map(|hash| hash.0));
        }
        Ok(trace)
    }
}
