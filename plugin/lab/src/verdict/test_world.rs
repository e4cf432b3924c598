//! Worlds in which testers play their episodes.

use bevy::prelude::*;
use bevy_playbot::{
    agent::Agent,
    control::Control,
    episode::Episode,
    headless::tick_world,
    level::LevelQueue,
    panics::PanicReports,
    streams::{AgentStreams, EpisodeSeeds},
    vision::{ObservationConfig, VisionError},
};

use super::{
    played::{EpisodeFinding, Interruption, Played, PlayedEnd, Task, Watch},
    tester::Tester,
    walk::{Walk, WalkCounter},
    watched::Watched,
};
use crate::{
    arrangement::at_most, ended_episodes::EndedEpisodes, eval::Player, findings::detector_of, game::Game,
    worlds::build_observing_world,
};

/// Ticks after which an episode counts as endless: more than four hours at 60 a second.
const MOST_TICKS: u32 = 1_000_000;
/// Text before the message of a game's panic, after its position.
const PANICKED: &str = "the game panicked: ";

/// An agent and its tasks, in order.
struct Seat {
    agent: Entity,
    /// Indices of its tasks, with the seeds of their episodes.
    tasks: Vec<(usize, u64)>,
    done: usize,
    /// Walk of the agent.
    walk: WalkCounter,
}

impl Seat {
    /// Returns the present or next task, and the seed of its episode.
    fn current(&self) -> Option<(usize, u64)> {
        self.tasks.get(self.done).copied()
    }
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
            seats.push(Seat { agent, tasks: own, done: 0, walk: WalkCounter::new(agent, game.tick_hz()) });
        }
        player.install(&mut world);
        Ok(Self { world, seats, found: Vec::new() })
    }

    /// Returns ticks until all tasks are played, and notes their results.
    pub fn play_out(
        &mut self,
        game: &dyn Game,
        played: &mut [Option<Played>],
        watch: &Watch,
    ) -> Result<(), Interruption> {
        let is_alone = self.seats.iter().map(|seat| seat.tasks.len()).sum::<usize>() <= 1;
        let mut watched = Watched::new(game, watch, self.seats.iter().map(|seat| seat.agent), is_alone);
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
    fn count_places(&mut self, game: &dyn Game, watch: &Watch) {
        let ended = EndedEpisodes::of(&self.world);
        for seat in &mut self.seats {
            let has_ended = ended.iter().any(|(agent, _)| *agent == seat.agent);
            seat.walk.tick(game, watch.mode, &self.world, has_ended);
        }
    }

    /// Returns the walk of an agent in the episode that is over.
    pub fn take_walk(&mut self, seat: usize) -> Option<Walk> {
        self.seats.get_mut(seat)?.walk.take()
    }

    fn note_ends(&mut self, game: &dyn Game, played: &mut [Option<Played>], watch: &Watch, watched: &mut Watched) {
        let ended = EndedEpisodes::take(&mut self.world);
        for (agent, result) in ended {
            let Some(seat) = self.seats.iter().position(|seat| seat.agent == agent) else { continue };
            let walk = self.take_walk(seat);
            let Some((task, seed)) = self.seats[seat].current() else { continue };
            let place = game.tools().state.position(&self.world, agent);
            let cause = if result.success { None } else { game.tools().state.end_cause(&self.world, agent) };
            let exact = self.is_untouched(seat, seed);
            let found = watched.take_found(seat);
            let end = PlayedEnd::Ended { result, place, cause };
            played[task] = Some(Played { end, exact, found, walk });
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
        let told = |seat: &Seat| {
            let (agent, episode) = (self.world.get::<Agent>(seat.agent)?, self.world.get::<Episode>(seat.agent)?);
            told_tick(message, agent.index, episode.level)
        };
        let (seat, task) = self.suspected().into_iter().min_by_key(|(seat, _)| told(seat).is_none())?;
        let played = || self.world.get::<Episode>(seat.agent).map_or(0, |episode| episode.tick.saturating_sub(1));
        let (tick, words) = told(seat).unwrap_or_else(|| (played(), message));
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
        let told = told_tick(message, agent.index, episode.level);
        let is_begun = episode.is_running() || episode.is_loading();
        let (tick, rest) = told.map_or((is_begun.then_some(episode.tick), message), |(tick, rest)| (Some(tick), rest));
        (tick, rest.strip_prefix(PANICKED).unwrap_or(rest).to_owned())
    }
}

/// Parses the tick at the start of a message such as `agent 0, level 3, tick 7: words`, and returns it with the
/// words.
fn told_tick(message: &str, agent: u32, level: u64) -> Option<(u32, &str)> {
    let rest = message.strip_prefix(&format!("agent {agent}, level {level}, tick "))?;
    let (tick, words) = rest.split_once(": ")?;
    Some((tick.parse().ok()?, words))
}

/// Returns whether an agent has an episode that is not over.
fn is_playing(world: &World, agent: Entity) -> bool {
    let is_begun = |episode: &Episode| episode.is_running() || episode.is_loading();
    Control::of(world, agent).is_active() && world.get::<Episode>(agent).is_some_and(is_begun)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moment_is_taken_from_the_words() {
        assert_eq!(told_tick("agent 0, level 3, tick 7: it burns: hot", 0, 3), Some((7, "it burns: hot")));
        assert_eq!(told_tick("agent 0, level 3, after tick 7: late", 0, 3), None);
        assert_eq!(told_tick("the policy cannot decide", 0, 3), None);
    }
}
