//! Helpers for tests of games that use the plugin: plain functions and an extension trait that work
//! in any test harness.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{prelude::*, test_app::{PlaybotTestExt, test_app}};
//!
//! /// The game: an episode is won after three ticks.
//! fn play(mut agents: Query<(&mut Episode, &mut StateHash)>) {
//!     for (mut episode, mut hash) in &mut agents {
//!         *hash = StateHash::of([episode.tick.into()]);
//!         if episode.tick == 2 {
//!             episode.terminate(true);
//!         }
//!     }
//! }
//!
//! let mut app = test_app();
//! app.add_systems(FixedUpdate, play);
//! app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Bot, BlindBot::Uniform));
//! assert_eq!(app.play_episodes(2, 100), Ok(6));
//! let trace = app.hash_trace(6).expect("no agent broke its contract");
//! assert_eq!(trace[..3], trace[3..], "each episode is the same");
//! // Systems of the game are those of its crate, by name.
//! assert_eq!(app.ambiguous_orders(&[module_path!()]), [""; 0]);
//! ```

use crate::{
    agent::{AgentOrder, Control},
    episode::EpisodeCount,
    fault::Fault,
    headless::{PlaybotAppExt, headless_app},
    state_hash::StateHash,
    systems::ObserveSchedule,
};
use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings, ScheduleLabel, Schedules},
    prelude::*,
};
use std::collections::BTreeMap;

/// Creates a headless app whose fixed schedules refuse ambiguous systems, since such a game is not
/// reproducible.
///
/// Schedules that Bevy's own systems share, such as `PreUpdate` and `Last`, cannot refuse
/// ambiguity, because Bevy's own systems are ambiguous there. Check yours with
/// [`ambiguous_orders`](PlaybotTestExt::ambiguous_orders).
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

/// Methods for tests of an app or a World with agents.
pub trait PlaybotTestExt {
    /// Ticks until every agent has finished at least `episodes` episodes or is idle.
    ///
    /// # Errors
    ///
    /// A fault of the game, or `limit` ticks without finishing.
    fn play_episodes(&mut self, episodes: u64, limit: u64) -> Result<u64, Fault>;

    /// Plays `ticks` ticks and returns the state hash of each agent after each tick. Equal lists
    /// mean equal games.
    ///
    /// # Errors
    ///
    /// A fault of the game.
    fn hash_trace(&mut self, ticks: u64) -> Result<Vec<u64>, Fault>;

    /// Returns pairs of systems without an order although one writes data that the other uses, for
    /// every schedule that has run. Each entry names the schedule, the systems and the shared data.
    /// At least one of the two belongs to these crates, by the path of its name. Systems with
    /// exclusive access to the World are compared only with those of these crates, since their
    /// accesses are unknown.
    ///
    /// Systems have names if Bevy is built with its feature `debug`.
    fn ambiguous_orders(&self, crates: &[&str]) -> Vec<String>;
}

impl PlaybotTestExt for World {
    fn play_episodes(&mut self, episodes: u64, limit: u64) -> Result<u64, Fault> {
        for tick in 0..limit {
            self.tick()?;
            let mut agents = self.query::<(&Control, &EpisodeCount)>();
            let done = |(control, count): (&Control, &EpisodeCount)| count.finished >= episodes || !control.is_active();
            if agents.iter(self).all(done) {
                return Ok(tick + 1);
            }
        }
        Err(Fault(format!("{limit} ticks were not enough for {episodes} episodes of every agent")))
    }

    fn hash_trace(&mut self, ticks: u64) -> Result<Vec<u64>, Fault> {
        let mut trace = Vec::new();
        for _ in 0..ticks {
            self.tick()?;
            let agents = self.resource::<AgentOrder>().entities();
            trace.extend(agents.iter().filter_map(|&agent| self.get::<StateHash>(agent)).map(|hash| hash.0));
        }
        Ok(trace)
    }

    fn ambiguous_orders(&self, crates: &[&str]) -> Vec<String> {
        let is_of = |name: &str| {
            let is_in = |path: &&str| name.strip_prefix(*path).is_some_and(|rest| rest.starts_with("::"));
            crates.iter().any(is_in)
        };
        let mut found = Vec::new();
        for (label, schedule) in self.resource::<Schedules>().iter() {
            // A schedule that has not run is not built yet.
            let Ok(systems) = schedule.systems() else { continue };
            let names: BTreeMap<_, _> = systems.map(|(key, system)| (key, system.name().to_string())).collect();
            for (one, other, shared) in schedule.graph().conflicting_systems().iter() {
                let (Some(one), Some(other)) = (names.get(one), names.get(other)) else { continue };
                let ours = [one, other].into_iter().filter(|name| is_of(name)).count();
                if ours == 0 || (shared.is_empty() && ours == 1) {
                    continue;
                }
                let shared: Vec<String> =
                    shared.iter().filter_map(|&id| self.components().get_name(id)).map(|it| it.to_string()).collect();
                let what = if shared.is_empty() { "the whole World".to_owned() } else { shared.join(", ") };
                found.push(format!("{label:?}: `{one}` and `{other}` share {what}"));
            }
        }
        found.sort();
        found
    }
}

impl PlaybotTestExt for App {
    fn play_episodes(&mut self, episodes: u64, limit: u64) -> Result<u64, Fault> {
        self.world_mut().play_episodes(episodes, limit)
    }

    fn hash_trace(&mut self, ticks: u64) -> Result<Vec<u64>, Fault> {
        self.world_mut().hash_trace(ticks)
    }

    fn ambiguous_orders(&self, crates: &[&str]) -> Vec<String> {
        self.world().ambiguous_orders(crates)
    }
}
