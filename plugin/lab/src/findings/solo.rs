//! One agent that plays one episode, in a World of its own.

use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionValue},
    control::Control,
    episode::{Episode, EpisodeResult},
    headless::tick_world,
    level::LevelQueue,
    level_files::{LevelFile, LevelFiles},
    panics::PanicReports,
    reward::Reward,
    state_hash::StateHash,
    streams::EpisodeSeeds,
    vision::{ObservationConfig, VisionError},
};

use super::{breakage::Breakage, moment::Moment};
use crate::{detectors::Ear, ended_episodes::EndedEpisodes, eval::Player, game::Game, worlds::build_observing_world};

/// Ticks after which an episode counts as endless, as in tests of levels.
const MOST_TICKS: u32 = 1_000_000;

/// The episode to play.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a> {
    pub game: &'a dyn Game,
    pub mode: &'a str,
    pub level: u64,
    /// Random seed of the agent.
    pub seed: u64,
}

/// The World and its agent.
pub(super) struct Solo<'a> {
    game: &'a dyn Game,
    mode: &'a str,
    level: u64,
    world: World,
    agent: Entity,
    /// Ticks of the episode so far.
    ticks: u32,
    /// Ticks and frames of the World: a level may never be ready.
    runs: u32,
    /// Collects errors of the log, if they are needed.
    ear: Option<Ear>,
    /// The errors of the last tick, and of the level's loading before it.
    errors: Vec<String>,
    /// Whether the last run was a tick of the episode.
    was_tick: bool,
}

impl<'a> Solo<'a> {
    /// Builds a World as tests of levels do, with an agent whose actions the caller sets.
    pub fn new(setting: Setting<'a>, observation_config: &ObservationConfig) -> Result<Self, VisionError> {
        let Setting { game, mode, level, seed } = setting;
        let (mut world, agents) = build_observing_world(game, mode, observation_config, 0, 0, 1)?;
        EndedEpisodes::note_in(&mut world);
        if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
            // The finding is the report.
            reports.keep_no_files();
        }
        let agent = agents[0];
        let queue = LevelQueue::list([level]);
        world.entity_mut(agent).insert((Control::Bot, queue, EpisodeSeeds::new([seed])));
        let (ear, errors) = (None, Vec::new());
        Ok(Self { game, mode, level, world, agent, ticks: 0, runs: 0, ear, errors, was_tick: false })
    }

    /// Collects errors of the log from now on.
    pub fn listen(&mut self) {
        self.ear = Some(Ear::new());
    }

    /// Hands the agent over to a player.
    pub fn seat(&mut self, player: &Player) {
        let control = player.seat(self.game, &mut self.world, self.agent);
        self.world.entity_mut(self.agent).insert(control);
        player.install(&mut self.world);
    }

    /// Sets the agent's next action.
    pub fn act(&mut self, action: ActionValue) {
        self.world.entity_mut(self.agent).insert(Action(action));
    }

    /// Runs the World. Returns whether that was a tick of the episode: a level that is still loading has no ticks.
    pub fn tick(&mut self) -> Result<bool, Breakage> {
        if let Some(endless) = self.endless() {
            return Err(endless);
        }
        self.runs += 1;
        if std::mem::take(&mut self.was_tick) {
            self.errors.clear();
        }
        let ticked = match &self.ear {
            Some(ear) => ear.listen(|| tick_world(&mut self.world)),
            None => tick_world(&mut self.world),
        };
        self.errors.extend(self.ear.as_ref().map(Ear::take).unwrap_or_default());
        ticked.map_err(|fault| Breakage::of_fault(&fault, self.ticks))?;
        let played = match self.end() {
            Some(end) => end.ticks,
            None => self.world.get::<Episode>(self.agent).map_or(0, |episode| episode.tick),
        };
        let is_tick = played != self.ticks;
        self.ticks = played;
        self.was_tick = is_tick;
        Ok(is_tick)
    }

    /// Returns the ticks of the episode so far.
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Returns the breakage if this many ticks mean that the episode is endless.
    pub fn endless(&self) -> Option<Breakage> {
        (self.ticks >= MOST_TICKS || self.runs >= 2 * MOST_TICKS).then(|| Breakage::endless(MOST_TICKS))
    }

    /// Returns the result of the episode, once it is over.
    pub fn end(&self) -> Option<EpisodeResult> {
        EndedEpisodes::of(&self.world).last().map(|(_, result)| *result)
    }

    /// Returns the agent's action in the last tick.
    pub fn action(&self) -> Option<ActionValue> {
        self.world.get::<Action>(self.agent).map(|action| action.0.clone())
    }

    /// Returns reward and state hash of the last tick.
    pub fn outcome(&self) -> (f32, u32) {
        let reward = self.world.get::<Reward>(self.agent).map_or(0.0, Reward::get);
        let hash = self.world.get::<StateHash>(self.agent).map_or(0, StateHash::folded);
        (reward, hash)
    }

    /// Returns the file of the level, for levels from files.
    pub fn level_file(&self) -> Option<LevelFile> {
        self.world.get_resource::<LevelFiles>()?.of(self.level).cloned()
    }

    /// Returns the World after its last tick.
    pub fn moment(&self) -> Moment<'_> {
        let (tick, end) = (self.ticks.saturating_sub(1), self.end());
        let (game, mode, world, agent) = (self.game, self.mode, &self.world, self.agent);
        Moment { game, mode, world, agent, tick, end, errors: &self.errors }
    }
}
