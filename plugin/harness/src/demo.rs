//! Recordings: making them with a demonstrator, and verifying them by replay.
//!
//! [`verify_file`] replays a recording: each tick must repeat as recorded, in a new World and after another episode. In
//! the folder, [`demonstration`] records a game's demonstrator or another player, and [`mod@filter`] selects episodes by
//! outcome, level and player.

pub mod demonstration;
pub mod filter;

use crate::{
    brief::shell_word,
    game::Game,
    mode::ModeError,
    parallel::{default_threads, on_threads},
    randomise::follow_recordings,
    split::LevelSplit,
    worlds::build_world,
};
use bevy::prelude::*;
use bevy_playbot::{
    demo::{
        file::{DemoEpisode, DemoFileError, DemoReader},
        replay::{Divergence, Replay},
    },
    engine::tick_world,
    fault::Fault,
    vision::{ObservationConfig, VisionError},
};
use playbot_learner::HasExitCode;
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
};
use thiserror::Error;

/// Replays every episode of a file twice; `progress` receives the number of checked episodes.
///
/// Each episode is played in a new World, and in a World that has played another episode before it. Data sets are read
/// from Worlds of both kinds, in any order and on several threads, so an accepted file is read there too.
///
/// # Errors
///
/// [`VerifyError`] if the file cannot be read to its end. Divergences are no errors: they are the report.
pub fn verify_file(game: &dyn Game, path: &Path, mut progress: impl FnMut(u64)) -> Result<VerifyReport, VerifyError> {
    let reader = DemoReader::open_for_game(path, game.name(), game.version(), None)?;
    let mode = reader.header().mode.clone();
    game.check_mode(&mode).map_err(|source| VerifyError::Mode { path: path.into(), source })?;
    let mut episodes = Vec::new();
    for episode in reader {
        let mut episode = episode?;
        // They are not compared, and would only take memory.
        episode.observations = Vec::new();
        episodes.push(Arc::new(episode));
    }
    let (threads, count) = (default_threads(), episodes.len());
    let mut replays = vec![TwoReplays::default(); count];
    let all: Vec<usize> = (0..count).collect();
    for share in all.chunks(EPISODES_PER_THREAD * threads) {
        let played = on_threads(&mut share.to_vec(), threads, |index| play_two(game, &mode, &episodes, *index));
        for (&index, played) in share.iter().zip(played) {
            let [in_new_world, after_another] = played.map_err(|(episode, fault)| {
                let replayed = ReplayedEpisodes::new([(path.to_owned(), episode)]);
                VerifyError::Fault { replayed, fault }
            })?;
            replays[index].in_new_world = in_new_world;
            replays[before(index, count)].after_another = after_another;
        }
        progress(share.last().map_or(0, |last| *last as u64 + 1));
    }
    let described =
        replays.iter().zip(0..).filter_map(|(replays, episode)| Some((episode, replays.describe(game, &mode)?)));
    Ok(VerifyReport {
        episodes: count as u64,
        ticks: episodes.iter().map(|episode| episode.len() as u64).sum(),
        divergences: described.collect(),
    })
}

/// Episodes that each thread checks between two reports of progress.
const EPISODES_PER_THREAD: usize = 4;

/// Returns the index of the episode before this one; the last one is before the first.
fn before(index: usize, count: usize) -> usize {
    (index + count - 1) % count
}

/// Plays an episode in a new World, and after it the one that is recorded before it: another order than the recorded
/// one. Returns the divergence of each, or the episode that broke the game.
fn play_two(
    game: &dyn Game,
    mode: &str,
    episodes: &[Arc<DemoEpisode>],
    index: usize,
) -> Result<[Option<Divergence>; 2], (usize, Fault)> {
    let mut replayer = EpisodeReplayer::new(game, mode);
    let mut play = |index: usize| replayer.play(episodes[index].clone(), |_, _| {}).map_err(|fault| (index, fault));
    Ok([play(index)?, play(before(index, episodes.len()))?])
}

/// The first divergence of both replays of an episode.
#[derive(Clone, Debug, Default)]
struct TwoReplays {
    in_new_world: Option<Divergence>,
    after_another: Option<Divergence>,
}

impl TwoReplays {
    /// Returns the divergence in words, and which of the two replays differs if one of them does not.
    fn describe(&self, game: &dyn Game, mode: &str) -> Option<String> {
        let (sound, wrong, divergence) = match (&self.in_new_world, &self.after_another) {
            (None, None) => return None,
            (Some(divergence), Some(_)) => return Some(divergence.to_string()),
            (None, Some(divergence)) => ("in a new World", "after another episode", divergence),
            (Some(divergence), None) => ("after another episode", "in a new World", divergence),
        };
        let (game, mode, level) = (game.name(), shell_word(mode), divergence.level);
        Some(format!(
            "replays {sound}, but not {wrong} ({divergence}): the game keeps something from one episode to the next, and \
             `playbot doctor {game} --mode {mode} --level {level}` names it"
        ))
    }
}

/// The result of a verification.
#[derive(Clone, Debug, Serialize)]
pub struct VerifyReport {
    /// Episodes replayed.
    pub episodes: u64,
    /// Ticks replayed.
    pub ticks: u64,
    /// First divergence of each episode that diverged: index of the episode, and tick with the difference. It says
    /// which replay diverged if the other one did not.
    pub divergences: Vec<(u64, String)>,
}

/// A World with one agent that replays recordings.
pub struct EpisodeReplayer {
    world: World,
    agent: Entity,
}

impl EpisodeReplayer {
    /// Builds the game in one of its modes.
    pub fn new(game: &dyn Game, mode: &str) -> Self {
        let (world, agents) = build_world(game, mode, 0, 0, 1);
        Self { world, agent: agents[0] }
    }

    /// Plays one episode and calls `after_tick` with the World and the agent after each tick.
    ///
    /// # Errors
    ///
    /// The game broke its contract.
    pub fn play(
        &mut self,
        episode: Arc<DemoEpisode>,
        mut after_tick: impl FnMut(&World, Entity),
    ) -> Result<Option<Divergence>, Fault> {
        if episode.is_empty() {
            return Ok(None);
        }
        if !episode.randomised.is_empty() {
            follow_recordings(&mut self.world);
        }
        Replay::begin(episode, &mut self.world.entity_mut(self.agent));
        loop {
            tick_world(&mut self.world)?;
            after_tick(&self.world, self.agent);
            let replay = self.world.get::<Replay>(self.agent);
            if let Some(replay) = replay.filter(|replay| replay.is_finished()) {
                return Ok(replay.divergence().cloned());
            }
        }
    }
}

/// The reason why a recording cannot be verified.
#[derive(Debug, Error)]
pub enum VerifyError {
    /// The file cannot be read, or belongs to another game.
    #[error(transparent)]
    File(#[from] DemoFileError),
    /// The game broke its contract during a replay.
    #[error("while replaying {replayed}: {fault}; if the game has changed since, record it again or leave it out")]
    Fault {
        /// The replayed episodes.
        replayed: ReplayedEpisodes,
        /// The fault.
        fault: Fault,
    },
    /// A recording does not replay in this game.
    #[error("{}: episode {episode} does not replay ({divergence}): record it again", path.display())]
    Diverged {
        /// The file.
        path: PathBuf,
        /// Index of the episode.
        episode: usize,
        /// The first difference.
        divergence: Divergence,
    },
    /// The recording has a mode that the game does not have.
    #[error("{}: {source}", path.display())]
    Mode {
        /// The file.
        path: PathBuf,
        /// The mode, and the valid ones.
        source: ModeError,
    },
    /// A recording shows a held-out level.
    #[error(
        "{}: level {level} is one of the held-out levels {split}, which must not be learned from: take \
         recordings of other levels (`playbot record --hold-out {split}` leaves these out), or hold out others with `test`",
        path.display()
    )]
    HeldOut {
        /// The file.
        path: PathBuf,
        /// The level.
        level: u64,
        /// The held-out levels.
        split: LevelSplit,
    },
    /// Only won episodes were asked for, and there are none.
    #[error(
        "{}: none of the {episodes} recorded episodes ended at the goal, and `demo_wins` takes only those that did: record a \
         demonstrator that gets there, or leave `demo_wins` out, as it must be for games that go on at the goal",
        path.display()
    )]
    NoneWon {
        /// The file or folder.
        path: PathBuf,
        /// Episodes that were recorded there.
        episodes: usize,
    },
    /// The game cannot draw these pictures.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The pictures need more memory than there is.
    #[error(
        "{steps} steps of {observation_config} need {:.1} GiB of memory, more than the {:.1} GiB that are free: learn from fewer \
         steps with `demo_steps`, or take smaller pictures, grey ones or a smaller stack (`image`)",
        gib(*.bytes), gib(*.free)
    )]
    TooLarge {
        /// Steps of the recordings.
        steps: u64,
        /// The observation.
        observation_config: ObservationConfig,
        /// Memory of the pictures.
        bytes: u64,
        /// Memory that is free.
        free: u64,
    },
    /// The recordings do not make a data set.
    #[error(transparent)]
    Data(#[from] playbot_learner::LearnError),
}

impl HasExitCode for VerifyError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Fault { .. } => 2,
            Self::File(error) => error.exit_code(),
            Self::Data(error) => error.exit_code(),
            _ => 3,
        }
    }
}

fn gib(bytes: u64) -> f64 {
    bytes as f64 / (1u64 << 30) as f64
}

/// Recorded episodes that were replayed at the same time. Its text names their files: one of the episodes caused the
/// error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReplayedEpisodes(BTreeMap<PathBuf, BTreeSet<usize>>);

impl ReplayedEpisodes {
    /// Creates it from the episodes, each with its file and its index there, from 0.
    pub fn new(episodes: impl IntoIterator<Item = (PathBuf, usize)>) -> Self {
        let mut by_file: BTreeMap<PathBuf, BTreeSet<usize>> = BTreeMap::new();
        for (file, index) in episodes {
            by_file.entry(file).or_default().insert(index);
        }
        Self(by_file)
    }
}

impl fmt::Display for ReplayedEpisodes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all: usize = self.0.values().map(BTreeSet::len).sum();
        f.write_str(if all > 1 { "one of " } else { "" })?;
        for (at, (file, episodes)) in self.0.iter().enumerate() {
            let and = if at == 0 { "" } else { " and " };
            let what = if episodes.len() == 1 { "episode" } else { "episodes" };
            let numbers: Vec<String> = episodes.iter().map(usize::to_string).collect();
            write!(f, "{and}{}, {what} {}", file.display(), numbers.join(", "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_episode_is_replayed_after_the_one_that_follows_it_in_the_file() {
        assert_eq!([0, 1, 2, 3].map(|index| before(index, 4)), [3, 0, 1, 2]);
        assert_eq!(before(0, 1), 0, "a single episode is replayed after itself");
    }

    #[test]
    fn episodes_are_named_by_their_files() {
        let named = |episodes: &[(&str, usize)]| {
            ReplayedEpisodes::new(episodes.iter().map(|(file, index)| (PathBuf::from(file), *index))).to_string()
        };
        assert_eq!(named(&[("a.demo", 3)]), "a.demo, episode 3");
        assert_eq!(
            named(&[("b.demo", 2), ("a.demo", 10), ("a.demo", 9)]),
            "one of a.demo, episodes 9, 10 and b.demo, episode 2"
        );
    }
}
