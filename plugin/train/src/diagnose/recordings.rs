//! Recordings as evidence: what they are of, what is done in them, and what becomes of them in the present game.

use crate::diagnose::play::{PlayedEpisode, Replayed, replay};
use bevy_playbot::{
    action::{ActionValue, Actions},
    demo::file::{DemoEnd, DemoEpisode, DemoFileError, DemoReader},
    engine::find_demos,
    vision::ObservationConfig,
};
use playbot_harness::game::{Game, idle_action};
use playbot_learner::ActionSpace;
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

/// Most episodes that are replayed, and most of their ticks together.
const REPLAYED: usize = 12;
const REPLAYED_TICKS: usize = 4000;

/// One recorded episode, without what a replay adds.
#[derive(Clone, Debug)]
pub struct RecordedEpisode {
    /// Mode of the game.
    pub mode: Arc<str>,
    /// Version of the game's rules.
    pub version: u32,
    /// Noise of the demonstrator's actions.
    pub noise: f64,
    /// The recorded values of an observation; 0 if they were not kept.
    pub width: usize,
    /// The recording.
    pub episode: Arc<DemoEpisode>,
}

impl RecordedEpisode {
    /// Returns the tick, from 1, of its first positive reward.
    pub fn first_reward(&self) -> Option<usize> {
        self.episode.rewards.iter().position(|reward| *reward > 0.0).map(|tick| tick + 1)
    }

    /// Iterates over its actions.
    pub fn actions(&self) -> impl Iterator<Item = ActionValue> + '_ {
        self.episode.actions.iter()
    }

    /// Returns whether it was cut off at the end of the recording.
    pub fn is_aborted(&self) -> bool {
        self.episode.end == DemoEnd::Aborted
    }
}

/// All recordings of a path.
#[derive(Clone, Debug, Default)]
pub struct RecordedSet {
    /// Where they are.
    pub path: PathBuf,
    /// Their games, each once.
    pub games: Vec<String>,
    /// The episodes, in the order of the files.
    pub episodes: Vec<RecordedEpisode>,
    /// The action of the game that does nothing.
    pub idle: Option<ActionValue>,
    /// Names of the observed values in the recordings; empty if they differ or were not kept.
    pub names: Vec<String>,
    /// Replays of some of them in the present game; `None` if they were not replayed.
    pub replays: Option<Vec<Replayed>>,
    /// A pair of discrete actions whose exchange makes recordings replay that do not replay as they are.
    pub exchanged: Option<(u32, u32)>,
}

impl RecordedSet {
    /// Reads all recordings below a path, of whatever game.
    ///
    /// # Errors
    ///
    /// A file is missing or damaged.
    pub fn read(path: &Path) -> Result<Self, DemoFileError> {
        let mut set = Self { path: path.to_owned(), ..Self::default() };
        for (number, file) in find_demos(path)?.into_iter().enumerate() {
            let reader = DemoReader::open(&file)?;
            let header = reader.header().clone();
            if number == 0 {
                set.names.clone_from(&header.observation_names);
            } else if set.names != header.observation_names {
                set.names.clear();
            }
            if !set.games.contains(&header.game) {
                set.games.push(header.game.clone());
            }
            let (mode, width) = (Arc::<str>::from(header.mode.as_str()), header.observation_names.len());
            for episode in reader {
                let (mode, episode) = (mode.clone(), Arc::new(episode?));
                let (version, noise) = (header.game_version, header.action_noise);
                set.episodes.push(RecordedEpisode { mode, version, noise, width, episode });
            }
        }
        Ok(set)
    }

    /// Adds further recordings.
    pub fn join(&mut self, other: Self) {
        if self.names != other.names {
            self.names.clear();
        }
        for game in other.games {
            if !self.games.contains(&game) {
                self.games.push(game);
            }
        }
        self.episodes.extend(other.episodes);
    }

    /// Returns whether all recordings are of this game and version.
    pub fn is_of(&self, game: &dyn Game) -> bool {
        self.games.iter().all(|name| name == game.name())
            && self.episodes.iter().all(|episode| episode.version == game.version())
    }

    /// Adds what the game knows: its idle action, and replays of some episodes if `replays`.
    ///
    /// # Errors
    ///
    /// The game's breach of contract, in words.
    pub fn look_up(&mut self, game: &dyn Game, replays: bool) -> Result<(), String> {
        self.idle = Some(idle_action(game));
        if !replays || !self.is_of(game) {
            return Ok(());
        }
        let chosen = self.chosen();
        let mut all = Vec::new();
        let mut modes: Vec<Arc<str>> = chosen.iter().map(|episode| episode.mode.clone()).collect();
        modes.dedup();
        for mode in modes.iter().filter(|mode| game.check_mode(mode).is_ok()) {
            let of_mode = chosen.iter().filter(|episode| episode.mode == *mode);
            let of_mode: Vec<_> = of_mode.map(|episode| episode.episode.clone()).collect();
            all.extend(replay(game, mode, &ObservationConfig::default(), &of_mode)?);
        }
        if all.iter().any(|replayed| replayed.divergence.is_some()) {
            self.exchanged = exchanged(game, &chosen)?;
        }
        self.replays = Some(all);
        Ok(())
    }

    /// Returns the episodes to replay: some of all, evenly, of few ticks together, those of one mode together.
    fn chosen(&self) -> Vec<RecordedEpisode> {
        let every = self.episodes.len().div_ceil(REPLAYED).max(1);
        let mut ticks = 0;
        let candidates = self.episodes.iter().step_by(every).filter(|episode| !episode.episode.is_empty());
        let mut chosen: Vec<_> = candidates
            .take_while(|episode| {
                let is_first = ticks == 0;
                ticks += episode.episode.len();
                is_first || ticks <= REPLAYED_TICKS
            })
            .cloned()
            .collect();
        chosen.sort_by(|one, other| one.mode.cmp(&other.mode));
        chosen
    }

    /// Returns the observations and actions of each episode: the recorded ones, or else those of the replays.
    pub fn seen(&self) -> Vec<(Vec<&[f32]>, Vec<ActionValue>)> {
        let recorded = self.episodes.iter().filter(|episode| episode.width > 0);
        let of_recording = |episode: &'_ RecordedEpisode| -> Vec<ActionValue> { episode.actions().collect() };
        let mut seen: Vec<(Vec<&[f32]>, Vec<ActionValue>)> = recorded
            .map(|episode| (episode.episode.observations.chunks(episode.width).collect(), of_recording(episode)))
            .collect();
        if seen.is_empty() {
            let replays = self.replays.iter().flatten().filter(|replayed| replayed.divergence.is_none());
            seen =
                replays.map(|replayed| (replayed.episode.rows().collect(), replayed.episode.actions.clone())).collect();
        }
        seen
    }

    /// Returns the share of all recorded ticks in which nothing is done; `None` without ticks.
    pub fn idle_share(&self) -> Option<f64> {
        let idle = self.idle.as_ref()?;
        let is_idle = |action: &ActionValue| match (action, idle) {
            (ActionValue::Continuous(values), _) => values.iter().all(|value| value.abs() < 1e-3),
            (action, idle) => action == idle,
        };
        let (mut ticks, mut idles) = (0_u64, 0_u64);
        for action in self.episodes.iter().flat_map(RecordedEpisode::actions) {
            ticks += 1;
            idles += u64::from(is_idle(&action));
        }
        (ticks > 0).then(|| idles as f64 / ticks as f64)
    }

    /// Returns the share of the recorded ticks with such an action.
    pub fn share_of(&self, is_taken: impl Fn(&ActionValue) -> bool) -> f64 {
        let (mut ticks, mut found) = (0_u64, 0_u64);
        for taken in self.episodes.iter().flat_map(RecordedEpisode::actions) {
            ticks += 1;
            found += u64::from(is_taken(&taken));
        }
        found as f64 / ticks.max(1) as f64
    }
}

/// Most actions whose exchange is looked for, and most recordings that are tried.
const EXCHANGED_ACTIONS: usize = 16;
const EXCHANGED_EPISODES: usize = 3;

/// Returns two discrete actions whose exchange makes recordings replay.
fn exchanged(game: &dyn Game, chosen: &[RecordedEpisode]) -> Result<Option<(u32, u32)>, String> {
    let count = match game.actions() {
        ActionSpace::Discrete(count) if count <= EXCHANGED_ACTIONS => count as u32,
        _ => return Ok(None),
    };
    let Some(mode) = chosen.first().map(|episode| episode.mode.clone()) else { return Ok(None) };
    let tried: Vec<_> = chosen.iter().filter(|episode| episode.mode == mode).take(EXCHANGED_EPISODES).collect();
    for one in 0..count {
        for other in one + 1..count {
            let with = |episode: &RecordedEpisode| Arc::new(swapped(&episode.episode, one, other));
            let episodes: Vec<_> = tried.iter().map(|episode| with(episode)).collect();
            let is_same = |actions: &DemoEpisode, before: &DemoEpisode| actions.actions == before.actions;
            if episodes.iter().zip(&tried).all(|(changed, before)| is_same(changed, &before.episode)) {
                continue;
            }
            let replayed = replay(game, &mode, &ObservationConfig::default(), &episodes)?;
            if !replayed.is_empty() && replayed.iter().all(|replayed| replayed.divergence.is_none()) {
                return Ok(Some((one, other)));
            }
        }
    }
    Ok(None)
}

fn swapped(episode: &DemoEpisode, one: u32, other: u32) -> DemoEpisode {
    let mut changed = episode.clone();
    if let Actions::Discrete(list) = &mut changed.actions {
        for action in list {
            *action = match *action {
                action if action == one => other,
                action if action == other => one,
                action => action,
            };
        }
    }
    changed
}

/// Returns the episode of a replay as evidence of a player.
pub fn replayed_episodes(set: &RecordedSet) -> impl Iterator<Item = &PlayedEpisode> {
    set.replays.iter().flatten().filter(|replayed| replayed.divergence.is_none()).map(|replayed| &replayed.episode)
}
