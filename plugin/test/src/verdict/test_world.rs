//! Worlds in which testers play their episodes.

use crate::{
    detectors::{Detectors, ErrorLogReader, GameProofs, SlowTick, TickTime},
    findings::detector_of,
    verdict::{
        plan::Tester,
        played::{EpisodeFinding, Played, PlayedEnd, Task, Track, TrackCounter},
        walk::{Walk, WalkCounter},
    },
};
use bevy::prelude::*;
use bevy_playbot::{
    agent::{Agent, Control},
    engine::{EpisodeSeeds, panics::PanicReports, tick_world},
    episode::{Episode, EpisodeResult},
    fault::Fault,
    level::LevelQueue,
    streams::AgentStreams,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{
    detector::{Detector, DetectorTick, EpisodeWatcher, LevelAhead, WorldTick, WorldWatcher},
    eval::Player,
    game::Game,
    worlds::{EndedEpisodes, at_most, build_observing_world},
};
use std::{sync::Arc, time::Instant};

/// Ticks after which an episode counts as endless: more than four hours at 60 a second.
const MOST_TICKS: u32 = 1_000_000;

/// Text before the message of a game's panic, after its position.
const PANICKED: &str = "the game panicked: ";

/// Plays episodes and returns their results in order; `None` if `stop` returned true.
///
/// Many are played in one World. If it breaks, its current episodes are played again, each alone in a World of its
/// own. An episode that breaks its World again is the broken one; all others are played as if nothing had happened.
///
/// If no episode does, the break depends on state that other episodes left in the World. It is then a finding of the
/// episode in which it occurred.
///
/// # Errors
///
/// The game does not support the tester's observations.
pub(super) fn play_tasks(
    game: &dyn Game,
    mode: &str,
    tester: &Tester,
    tasks: &[Task],
    watch: &EpisodeObserver,
) -> Result<Option<Vec<Played>>, VisionError> {
    let mut played: Vec<Option<Played>> = vec![None; tasks.len()];
    let mut waiting: Vec<usize> = (0..tasks.len()).collect();
    while !waiting.is_empty() {
        let mut test_world = TestWorld::build(game, mode, tester, tasks, &waiting, watch.arenas)?;
        match test_world.play_out(game, &mut played, watch) {
            Ok(()) => {}
            Err(Interruption::Stopped) => return Ok(None),
            Err(Interruption::Broken { detector, message }) => {
                let mut is_seen = false;
                for suspect in test_world.suspects() {
                    let Some(alone) = play_alone(game, mode, tester, tasks[suspect], watch)? else { return Ok(None) };
                    is_seen |= alone.shows(detector);
                    played[suspect] = Some(alone);
                }
                if let Some((suspect, finding)) = test_world.left_behind(detector, &message).filter(|_| !is_seen)
                    && let Some(played) = &mut played[suspect]
                {
                    played.found.push(finding);
                }
            }
        }
        waiting.retain(|&task| played[task].is_none());
    }
    Ok(Some(played.into_iter().flatten().collect()))
}

/// Plays one episode in a World of its own.
fn play_alone(
    game: &dyn Game,
    mode: &str,
    tester: &Tester,
    task: Task,
    watch: &EpisodeObserver,
) -> Result<Option<Played>, VisionError> {
    let mut test_world = TestWorld::build(game, mode, tester, &[task], &[0], 1)?;
    let mut played = [None];
    let end = match test_world.play_out(game, &mut played, watch) {
        Ok(()) => return Ok(played[0].take()),
        Err(Interruption::Stopped) => return Ok(None),
        Err(Interruption::Broken { detector, message }) => {
            (watch.progress)(1);
            let (tick, message) = test_world.without_moment(&message);
            PlayedEnd::Broken { detector, tick, message }
        }
    };
    let found = std::mem::take(&mut test_world.found);
    let walk = test_world.take_walk(0);
    let exact = test_world.is_untouched(0, task.seed);
    Ok(Some(Played { end, exact, found, walk, track: Track::default() }))
}

/// Observers of an episode during play.
pub(super) struct EpisodeObserver<'a> {
    /// Called with the number of newly finished episodes.
    pub progress: &'a (dyn Fn(u64) + Sync),
    /// Returns whether to stop.
    pub stop: &'a (dyn Fn() -> bool + Sync),
    /// The detectors at work.
    pub detectors: &'a Detectors,
    /// Mode of the levels.
    pub mode: &'a str,
    /// Name of the tester.
    pub tester: &'a str,
    /// Largest number of arenas of a World. It does not change the results of a game that keeps no state between
    /// episodes.
    pub arenas: usize,
}

/// A World and the agents in it.
pub(super) struct TestWorld {
    world: World,
    seats: Vec<Seat>,
    /// Findings in the only episode, if it broke the World.
    pub found: Vec<EpisodeFinding>,
}

impl TestWorld {
    /// Builds a World for the waiting tasks, shared out evenly over its agents, at most this many.
    pub fn build(
        game: &dyn Game,
        mode: &str,
        tester: &Tester,
        tasks: &[Task],
        waiting: &[usize],
        arenas: usize,
    ) -> Result<Self, VisionError> {
        let player = &tester.player;
        let sees = matches!(player, Player::Policy { .. });
        let observation_config = if sees { tester.observation_config } else { ObservationConfig::default() };
        let count = at_most(game, arenas.min(waiting.len()));
        // Agents have the seeds of their episodes; the seed of the World is for the game, and always the same.
        let (mut world, agents) = build_observing_world(game, mode, &observation_config, 0, 0, count as u32)?;
        EndedEpisodes::note_in(&mut world);
        if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
            // The episode can be played again by its level and its seed.
            reports.keep_no_files();
        }
        let mut seats = Vec::new();
        for (offset, agent) in agents.into_iter().enumerate() {
            let own = waiting.iter().skip(offset).step_by(count).map(|&task| (task, tasks[task].seed));
            let own: Vec<(usize, u64)> = own.collect();
            let levels: Vec<u64> = own.iter().map(|(task, _)| tasks[*task].level).collect();
            let seeds: Vec<u64> = own.iter().map(|(_, seed)| *seed).collect();
            world.entity_mut(agent).insert((LevelQueue::list(levels), EpisodeSeeds::new(seeds)));
            let control = player.seat(game, &mut world, agent);
            world.entity_mut(agent).insert(control);
            let walk = WalkCounter::new(agent, game.tick_hz(), tester.record.regions().to_vec());
            let track = TrackCounter::new(agent);
            seats.push(Seat { agent, tasks: own, done: 0, walk, track });
        }
        player.install(&mut world);
        Ok(Self { world, seats, found: Vec::new() })
    }

    /// Ticks until all tasks are played, and notes their results.
    pub fn play_out(
        &mut self,
        game: &dyn Game,
        played: &mut [Option<Played>],
        watch: &EpisodeObserver,
    ) -> Result<(), Interruption> {
        let is_alone = self.seats.iter().map(|seat| seat.tasks.len()).sum::<usize>() <= 1;
        let mut watched = EpisodeWatchers::new(game, watch, self.seats.iter().map(|seat| seat.agent), is_alone);
        while self.seats.iter().any(|seat| Control::of(&self.world, seat.agent).is_active()) {
            if (watch.stop)() {
                return Err(Interruption::Stopped);
            }
            if let Err(fault) = watched.tick(&mut self.world, tick_world) {
                let message = fault.to_string();
                let detector = detector_of(&message);
                self.found = watched.take_found(0);
                return Err(Interruption::Broken { detector, message });
            }
            // Play of each episode alone shows which episode it belongs to.
            if let Some((detector, message)) = watched.look(&self.world, EndedEpisodes::of(&self.world)) {
                return Err(Interruption::Broken { detector, message });
            }
            self.count_places(game, watch);
            self.note_ends(game, played, watch, &mut watched);
            if self.longest() >= MOST_TICKS {
                self.found = watched.take_found(0);
                let message = format!("the episode has not ended after {MOST_TICKS} ticks: give the game a time limit");
                return Err(Interruption::Broken { detector: "endless", message });
            }
        }
        Ok(())
    }

    /// Counts the positions of the agents after this tick.
    fn count_places(&mut self, game: &dyn Game, watch: &EpisodeObserver) {
        let ended = EndedEpisodes::of(&self.world);
        for seat in &mut self.seats {
            let result = ended.iter().find(|(agent, _)| *agent == seat.agent).map(|(_, result)| result);
            seat.walk.tick(game, watch.mode, &self.world, result.is_some());
            seat.track.tick(game, &self.world, result);
        }
    }

    /// Returns the walk of an agent in the episode that is over.
    pub fn take_walk(&mut self, seat: usize) -> Option<Walk> {
        self.seats.get_mut(seat)?.walk.take()
    }

    fn note_ends(
        &mut self,
        game: &dyn Game,
        played: &mut [Option<Played>],
        watch: &EpisodeObserver,
        watched: &mut EpisodeWatchers,
    ) {
        let ended = EndedEpisodes::take(&mut self.world);
        for (agent, result) in ended {
            let Some(seat) = self.seats.iter().position(|seat| seat.agent == agent) else { continue };
            let walk = self.take_walk(seat);
            let mut track = self.seats[seat].track.take();
            if walk.is_some() {
                // A map has more than these.
                track.cells = None;
            }
            let Some((task, seed)) = self.seats[seat].current() else { continue };
            let position = game.tools().state.position(&self.world, agent);
            let cause = if result.success { None } else { game.tools().state.end_cause(&self.world, agent) };
            let exact = self.is_untouched(seat, seed);
            let found = watched.take_found(seat);
            let end = PlayedEnd::Ended { result, position, cause };
            played[task] = Some(Played { end, exact, found, walk, track });
            self.seats[seat].done += 1;
            (watch.progress)(1);
        }
    }

    /// Returns the ticks of the longest current episode.
    fn longest(&self) -> u32 {
        let ticks = |seat: &Seat| self.world.get::<Episode>(seat.agent).map_or(0, |episode| episode.tick);
        let playing = self.seats.iter().filter(|seat| is_playing(&self.world, seat.agent));
        playing.map(ticks).max().unwrap_or(0)
    }

    /// Returns the tasks that may have broken the World: those that were being played or have just ended, or else the
    /// next ones.
    pub fn suspects(&self) -> Vec<usize> {
        self.suspected().into_iter().map(|(_, task)| task).collect()
    }

    fn suspected(&self) -> Vec<(&Seat, usize)> {
        let ended = EndedEpisodes::of(&self.world);
        let is_begun =
            |seat: &Seat| is_playing(&self.world, seat.agent) || ended.iter().any(|(agent, _)| *agent == seat.agent);
        let seats = || self.seats.iter().filter_map(|seat| seat.current().map(|(task, _)| (seat, task)));
        let begun: Vec<(&Seat, usize)> = seats().filter(|(seat, _)| is_begun(seat)).collect();
        if begun.is_empty() { seats().collect() } else { begun }
    }

    /// Returns the message about a broken World that no episode breaks alone. It is a finding of the suspect whose
    /// agent the game names, or else of the first one.
    pub fn left_behind(&self, detector: &'static str, message: &str) -> Option<(usize, EpisodeFinding)> {
        let reported = |seat: &Seat| {
            let (agent, episode) = (self.world.get::<Agent>(seat.agent)?, self.world.get::<Episode>(seat.agent)?);
            reported_tick(message, agent.index, episode.level)
        };
        let (seat, task) = self.suspected().into_iter().min_by_key(|(seat, _)| reported(seat).is_none())?;
        let played = || self.world.get::<Episode>(seat.agent).map_or(0, |episode| episode.tick.saturating_sub(1));
        let (tick, words) = reported(seat).unwrap_or_else(|| (played(), message));
        let words = words.strip_prefix(PANICKED).unwrap_or(words);
        // A World with a single episode breaks by that episode.
        let is_shared = self.seats.iter().map(|seat| seat.tasks.len()).sum::<usize>() > 1;
        let when = if is_shared {
            "not when the episode is played alone: other episodes in the same World may have left state behind"
        } else {
            "not when the episode is played again: the game is not deterministic"
        };
        Some((task, EpisodeFinding { detector, tick, message: format!("{words} ({when})") }))
    }

    /// Returns whether nothing was drawn from a player's streams in the episode with this seed.
    pub fn is_untouched(&self, seat: usize, seed: u64) -> bool {
        let streams = self.seats.get(seat).and_then(|seat| self.world.get::<AgentStreams>(seat.agent));
        streams.is_some_and(|streams| *streams == EpisodeSeeds::streams(seed))
    }

    /// Returns the tick in which the only agent broke the World, and the game's message without its position: reports
    /// of a level name that anyway.
    pub fn without_moment(&self, message: &str) -> (Option<u32>, String) {
        let agent = self.seats.first().map(|seat| seat.agent);
        let parts = agent.and_then(|agent| Some((self.world.get::<Agent>(agent)?, self.world.get::<Episode>(agent)?)));
        let Some((agent, episode)) = parts else { return (None, message.to_owned()) };
        let reported = reported_tick(message, agent.index, episode.level);
        let is_begun = episode.is_running() || episode.is_loading();
        let (tick, rest) =
            reported.map_or((is_begun.then_some(episode.tick), message), |(tick, rest)| (Some(tick), rest));
        (tick, rest.strip_prefix(PANICKED).unwrap_or(rest).to_owned())
    }
}

/// Interruption of the episodes of a World.
pub(super) enum Interruption {
    /// `stop` returned true.
    Stopped,
    /// The World cannot go on.
    Broken {
        /// `panic`, `fault` or `endless`.
        detector: &'static str,
        /// The game's message.
        message: String,
    },
}

/// An agent and its tasks, in order.
struct Seat {
    agent: Entity,
    /// Indices of its tasks, with the seeds of their episodes.
    tasks: Vec<(usize, u64)>,
    done: usize,
    /// Walk of the agent.
    walk: WalkCounter,
    /// Progress of the agent.
    track: TrackCounter,
}

impl Seat {
    /// Returns the present or next task, and the seed of its episode.
    fn current(&self) -> Option<(usize, u64)> {
        self.tasks.get(self.done).copied()
    }
}

/// Parses the tick at the start of a message such as `agent 0, level 3, tick 7: words`, and returns it with the
/// words.
fn reported_tick(message: &str, agent: u32, level: u64) -> Option<(u32, &str)> {
    let rest = message.strip_prefix(&format!("agent {agent}, level {level}, tick "))?;
    let (tick, words) = rest.split_once(": ")?;
    Some((tick.parse().ok()?, words))
}

/// Returns whether an agent has an episode that is not over.
fn is_playing(world: &World, agent: Entity) -> bool {
    let is_begun = |episode: &Episode| episode.is_running() || episode.is_loading();
    Control::of(world, agent).is_active() && world.get::<Episode>(agent).is_some_and(is_begun)
}

// Detectors at work in a World.

/// A detector's watch of an agent, under the detector's name.
type NamedWatch = (&'static str, Box<dyn EpisodeWatcher>);

/// A detector's watch of a World, under the detector's name.
type NamedWorldWatch = (&'static str, Box<dyn WorldWatcher>);

/// The watches of a World.
pub(super) struct EpisodeWatchers<'a> {
    game: &'a dyn Game,
    watch: &'a EpisodeObserver<'a>,
    seats: Vec<WatchedSeat>,
    worlds: Vec<NamedWorldWatch>,
    ear: Option<ErrorLogReader>,
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

impl<'a> EpisodeWatchers<'a> {
    /// Makes the watches of the test's detectors for these agents.
    pub fn new(
        game: &'a dyn Game,
        watch: &'a EpisodeObserver<'a>,
        agents: impl Iterator<Item = Entity>,
        is_alone: bool,
    ) -> Self {
        let detectors = &watch.detectors.ticks;
        let world = |detector: &Arc<dyn Detector>| detector.watch_world().map(|watch| (detector.name(), watch));
        let worlds: Vec<NamedWorldWatch> = detectors.iter().filter_map(world).collect();
        let ear = worlds.iter().any(|(_, watch)| watch.hears_errors()).then(ErrorLogReader::new);
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
        let errors = self.ear.as_ref().map(ErrorLogReader::take).unwrap_or_default();
        let moment = WorldTick { world, errors: &errors };
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
    fn look(&mut self, game: &dyn Game, watch: &EpisodeObserver, world: &World, result: Option<EpisodeResult>) {
        if watch.detectors.ticks.is_empty() {
            return;
        }
        let Some(episode) = world.get::<Episode>(self.agent) else { return };
        if episode.tick == 0 || !(episode.is_running() || result.is_some()) {
            return;
        }
        let watches = self.watches.get_or_insert_with(|| begin(game, watch, episode.level));
        let proofs = GameProofs { game, mode: watch.mode, level: episode.level, world, agent: self.agent };
        let Some(seen) = DetectorTick::of_agent(world, self.agent, episode.tick - 1) else { return };
        let moment = DetectorTick {
            position: if watches.is_empty() { None } else { game.tools().state.position(world, self.agent) },
            height: if watches.is_empty() { None } else { game.tools().state.height(world, self.agent) },
            is_success: result.map_or(seen.is_success, |result| result.success),
            proofs: &proofs,
            ..seen
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
fn begin(game: &dyn Game, watch: &EpisodeObserver, level: u64) -> Vec<NamedWatch> {
    let ahead = LevelAhead { level, plan: game.tools().levels.floor_plan(watch.mode, level) };
    let named = |detector: &Arc<dyn Detector>| detector.watch(&ahead).map(|watch| (detector.name(), watch));
    watch.detectors.ticks.iter().filter_map(named).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moment_is_taken_from_the_words() {
        assert_eq!(reported_tick("agent 0, level 3, tick 7: it burns: hot", 0, 3), Some((7, "it burns: hot")));
        assert_eq!(reported_tick("agent 0, level 3, after tick 7: late", 0, 3), None);
        assert_eq!(reported_tick("the policy cannot decide", 0, 3), None);
    }
}
