//! Detectors at work in a World in which testers play.

use std::{sync::Arc, time::Instant};

use bevy::prelude::*;
use bevy_playbot::{
    action::Action,
    episode::{Episode, EpisodeResult},
    fault::Fault,
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
};

use super::played::{EpisodeFinding, Watch as WatchOfTest};
use crate::{
    detector::{Detector, LevelAhead, Moment, Watch, WorldMoment, WorldWatch},
    detectors::{Ear, GameProofs, SlowTick, TickTime},
    game::Game,
};

/// A detector's watch of an agent, under the detector's name.
type NamedWatch = (&'static str, Box<dyn Watch>);
/// A detector's watch of a World, under the detector's name.
type NamedWorldWatch = (&'static str, Box<dyn WorldWatch>);

/// The watches of a World.
pub(super) struct Watched<'a> {
    game: &'a dyn Game,
    watch: &'a WatchOfTest<'a>,
    seats: Vec<WatchedSeat>,
    worlds: Vec<NamedWorldWatch>,
    ear: Option<Ear>,
    /// True if the World plays a single episode.
    is_alone: bool,
}

/// The watches of an agent's episode.
struct WatchedSeat {
    agent: Entity,
    /// `None` between two episodes.
    watches: Option<Vec<NamedWatch>>,
    found: Vec<EpisodeFinding>,
}

impl<'a> Watched<'a> {
    /// Makes the watches of the test's detectors for these agents.
    pub fn new(
        game: &'a dyn Game,
        watch: &'a WatchOfTest<'a>,
        agents: impl Iterator<Item = Entity>,
        is_alone: bool,
    ) -> Self {
        let detectors = &watch.detectors.ticks;
        let world = |detector: &Arc<dyn Detector>| detector.watch_world().map(|watch| (detector.name(), watch));
        let worlds: Vec<NamedWorldWatch> = detectors.iter().filter_map(world).collect();
        let ear = worlds.iter().any(|(_, watch)| watch.hears_errors()).then(Ear::new);
        let seat = |agent| WatchedSeat { agent, watches: None, found: Vec::new() };
        Self { game, watch, seats: agents.map(seat).collect(), worlds, ear, is_alone }
    }

    /// Lets the World do a tick, with its log and duration recorded if a detector needs them.
    pub fn tick(&self, world: &mut World, tick: impl FnOnce(&mut World) -> Result<(), Fault>) -> Result<(), Fault> {
        let clock = self.watch.detectors.clock();
        let begun = clock.map(|_| Instant::now());
        let ticked = match &self.ear {
            Some(ear) => ear.listen(|| tick(world)),
            None => tick(world),
        };
        if let (Some(clock), Some(begun)) = (clock, begun) {
            self.time(clock, begun, world);
        }
        ticked
    }

    fn time(&self, clock: &TickTime, begun: Instant, world: &World) {
        let took = begun.elapsed();
        if !clock.is_slow(took, self.seats.len(), self.game.tick_hz()) {
            return;
        }
        let episodes = self.seats.iter().filter_map(|seat| world.get::<Episode>(seat.agent));
        let (levels, ticks) = episodes.map(|episode| (episode.level, episode.tick)).unzip();
        let (detector, tester) = (TickTime::NAME, self.watch.tester.to_owned());
        clock.note(SlowTick { detector, tester, levels, ticks, milliseconds: took.as_secs_f64() * 1000.0 });
    }

    /// Inspects the tick that was just played. In a World with several episodes, returns a defect of the World, with
    /// the name of its detector.
    pub fn look(&mut self, world: &World, ended: &[(Entity, EpisodeResult)]) -> Option<(&'static str, String)> {
        let errors = self.ear.as_ref().map(Ear::take).unwrap_or_default();
        let moment = WorldMoment { world, errors: &errors };
        let mut wrong = Vec::new();
        self.worlds.retain_mut(|(detector, watch)| match watch.tick(&moment) {
            Some(message) => {
                wrong.push((*detector, message));
                false
            }
            None => true,
        });
        if !self.is_alone && !wrong.is_empty() {
            return wrong.into_iter().next();
        }
        for seat in &mut self.seats {
            let result = ended.iter().find(|(agent, _)| *agent == seat.agent).map(|(_, result)| *result);
            seat.look(self.game, self.watch, world, result);
        }
        if let Some(seat) = self.seats.first_mut() {
            let tick = world.get::<Episode>(seat.agent).map_or(0, |episode| episode.tick.saturating_sub(1));
            let finding = |(detector, message)| EpisodeFinding { detector, tick, message };
            seat.found.extend(wrong.into_iter().map(finding));
        }
        None
    }

    /// Returns the findings in the episode of an agent.
    pub fn take_found(&mut self, seat: usize) -> Vec<EpisodeFinding> {
        self.seats.get_mut(seat).map(|seat| std::mem::take(&mut seat.found)).unwrap_or_default()
    }
}

impl WatchedSeat {
    /// Inspects the episode's last tick; `result` is the episode's result if it is over.
    fn look(&mut self, game: &dyn Game, watch: &WatchOfTest, world: &World, result: Option<EpisodeResult>) {
        if watch.detectors.ticks.is_empty() {
            return;
        }
        let parts =
            (world.get::<Episode>(self.agent), world.get::<Action>(self.agent), world.get::<Reward>(self.agent));
        let (Some(episode), Some(action), Some(reward)) = parts else { return };
        if episode.tick == 0 || !(episode.is_running() || result.is_some()) {
            return;
        }
        let watches = self.watches.get_or_insert_with(|| begin(game, watch, episode.level));
        let observation = world.get::<Observation>(self.agent);
        let proofs = GameProofs { game, mode: watch.mode, level: episode.level, world, agent: self.agent };
        let moment = Moment {
            world,
            agent: self.agent,
            level: episode.level,
            tick: episode.tick - 1,
            action: &action.0,
            observation: observation.map_or(&[][..], |observation| observation.vector.as_slice()),
            state_hash: world.get::<StateHash>(self.agent).map_or(0, |hash| hash.0),
            reward: reward.get(),
            place: if watches.is_empty() { None } else { game.tools().state.position(world, self.agent) },
            is_success: result.map_or_else(|| episode.is_success(), |result| result.success),
            proofs: &proofs,
        };
        watches.retain_mut(|(detector, watch)| {
            let message = watch.tick(&moment).or_else(|| result.and_then(|result| watch.end(&moment, &result)));
            let is_silent = message.is_none();
            let finding = message.map(|message| EpisodeFinding { detector, tick: moment.tick, message });
            self.found.extend(finding);
            is_silent
        });
        if result.is_some() {
            self.watches = None;
        }
    }
}

/// Makes the watches of an episode on this level.
fn begin(game: &dyn Game, watch: &WatchOfTest, level: u64) -> Vec<NamedWatch> {
    let ahead = LevelAhead { level, plan: game.tools().levels.floor_plan(watch.mode, level) };
    let named = |detector: &Arc<dyn Detector>| detector.watch(&ahead).map(|watch| (detector.name(), watch));
    watch.detectors.ticks.iter().filter_map(named).collect()
}
