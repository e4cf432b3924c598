//! The selection of recorded episodes by outcome, level and player.
//!
//! ```no_run
//! use playbot_harness::demo::filter::{EpisodeFilter, FilterError, filter_demos};
//! use std::path::Path;
//!
//! let filter = EpisodeFilter { min_return: Some(5.0), success: true, ..EpisodeFilter::default() };
//! let report = filter_demos(&["all.demo".into()], &filter, Path::new("good.demo"))?;
//! println!("{} episodes", report.episodes());
//! # Ok::<(), FilterError>(())
//! ```

use crate::split::LevelSplit;
use bevy_playbot::{
    action::ActionValue,
    demo::file::{Decider, DemoEpisode, DemoFault, DemoFileError, DemoHeader, DemoReader},
    engine::select_demos,
};
use playbot_learner::{HasExitCode, disk::remove_file};
use serde::Serialize;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Conditions on recorded episodes. An episode is kept if it meets all of them; the default keeps every episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EpisodeFilter {
    /// Smallest undiscounted return.
    pub min_return: Option<f64>,
    /// Largest undiscounted return.
    pub max_return: Option<f64>,
    /// True if only episodes that ended at the goal are kept.
    pub success: bool,
    /// Name of the player, as the recording has it. Recordings of other players are left out whole.
    pub player: Option<String>,
    /// Levels of the recordings' mode; empty for all levels.
    pub levels: Vec<LevelSplit>,
    /// The game's [idle action](crate::game::idle_action), to mark idle starts. A replay needs the ticks of an idle
    /// start, so they stay, and their decider becomes [`Decider::Idle`]. Episodes that are idle to their end are left
    /// out. `None` keeps the deciders as they are.
    pub idle: Option<ActionValue>,
}

impl EpisodeFilter {
    /// Returns whether an episode meets the conditions on outcome and level.
    pub fn keeps(&self, episode: &DemoEpisode) -> bool {
        let episode_return = episode.episode_return();
        self.min_return.is_none_or(|least| episode_return >= least)
            && self.max_return.is_none_or(|most| episode_return <= most)
            && (!self.success || episode.is_success())
            && (self.levels.is_empty() || self.levels.iter().any(|split| has_level(split, episode.level_seed)))
    }

    /// Checks that the levels are of the mode of a recording.
    fn check_mode(&self, path: &Path, mode: &str) -> Result<(), FilterError> {
        match self.levels.iter().find(|split| split.mode != mode) {
            None => Ok(()),
            Some(levels) => {
                Err(FilterError::OtherMode { path: path.to_owned(), mode: mode.to_owned(), levels: levels.clone() })
            }
        }
    }

    /// Returns whether a recording is of the player, if one is wanted.
    fn is_by(&self, path: &Path, header: &DemoHeader) -> Result<bool, FilterError> {
        let Some(wanted) = &self.player else { return Ok(true) };
        let players = &header.demonstrator;
        if players != wanted && players.split(", ").any(|name| name == wanted) {
            let (path, players, wanted) = (path.to_owned(), players.clone(), wanted.clone());
            return Err(FilterError::ManyPlayers { path, players, wanted });
        }
        Ok(players == wanted)
    }

    /// Marks the idle start of an episode. Returns `None` if it is idle to its end.
    fn marked(&self, mut episode: DemoEpisode) -> Option<DemoEpisode> {
        let Some(idle) = &self.idle else { return Some(episode) };
        let is_idle = |tick: &usize| episode.actions.get(*tick).is_some_and(|action| action == *idle);
        let start = (0..episode.len()).take_while(is_idle).count();
        episode.deciders[..start].fill(Decider::Idle);
        (start < episode.len()).then_some(episode)
    }
}

fn has_level(split: &LevelSplit, level: u64) -> bool {
    (split.first..=split.last).contains(&level)
}

/// Writes the episodes of recordings that a filter keeps into a new file, in the order of `files`.
///
/// The kept episodes replay as before. Without a kept episode there is no file at `out`, and the report has 0 episodes.
///
/// # Errors
///
/// As for [`select_demos`], and [`FilterError`] for levels or players that the recordings cannot have. After an error
/// there is no new file at `out`.
pub fn filter_demos(files: &[PathBuf], filter: &EpisodeFilter, out: &Path) -> Result<FilterReport, FilterError> {
    let (mut of_player, mut left_out) = (Vec::new(), Vec::new());
    let mut players: Vec<String> = Vec::new();
    for file in files {
        let reader = DemoReader::open(file)?;
        filter.check_mode(file, &reader.header().mode)?;
        if filter.is_by(file, reader.header())? {
            of_player.push(file);
            continue;
        }
        left_out.push(file.clone());
        if !players.contains(&reader.header().demonstrator) {
            players.push(reader.header().demonstrator.clone());
        }
    }
    if let (Some(wanted), true) = (&filter.player, of_player.is_empty()) {
        return Err(FilterError::NoPlayer { wanted: wanted.clone(), players });
    }
    let (mut read, mut idle_steps) = (BTreeMap::<PathBuf, usize>::new(), 0);
    let written = select_demos(&of_player, out, |path, episode| {
        *read.entry(path.to_owned()).or_default() += 1;
        let episode = filter.marked(filter.keeps(&episode).then_some(episode)?)?;
        idle_steps += if filter.idle.is_some() { episode.idle_start() } else { 0 };
        Some(episode)
    })?;
    if written.episodes() == 0 {
        remove_file(out).map_err(|source| DemoFileError {
            path: out.to_owned(),
            fault: DemoFault::Io { action: "remove the file without episodes", source },
        })?;
    }
    let count =
        |(file, kept): (PathBuf, usize)| FilteredFile { episodes: read.get(&file).copied().unwrap_or(0), file, kept };
    let (header, steps) = (written.header, written.steps);
    Ok(FilterReport { header, files: written.files.into_iter().map(count).collect(), left_out, steps, idle_steps })
}

/// The result of a selection of episodes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FilterReport {
    /// Header of the new file.
    pub header: DemoHeader,
    /// The recordings that were read, in order.
    pub files: Vec<FilteredFile>,
    /// Recordings of other players.
    pub left_out: Vec<PathBuf>,
    /// Ticks of all kept episodes.
    pub steps: usize,
    /// Ticks among them that are marked as idle starts.
    pub idle_steps: usize,
}

impl FilterReport {
    /// Returns the number of kept episodes.
    pub fn episodes(&self) -> usize {
        self.files.iter().map(|file| file.kept).sum()
    }
}

/// One recording of a selection.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FilteredFile {
    /// The recording.
    pub file: PathBuf,
    /// Its episodes.
    pub episodes: usize,
    /// Those of them that were kept.
    pub kept: usize,
}

/// The reason why recordings cannot be filtered.
#[derive(Debug, Error)]
pub enum FilterError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] DemoFileError),
    /// The levels are of another mode than a recording.
    #[error(
        "{}: recorded in mode `{mode}`, so no episode is on the levels {levels}: name levels of that mode, such as \
         {mode}:{}..{}, or leave the file out", path.display(), levels.first, levels.last
    )]
    OtherMode {
        /// The recording.
        path: PathBuf,
        /// Its mode.
        mode: String,
        /// The levels.
        levels: LevelSplit,
    },
    /// A recording has the episodes of several players, and does not say which episode is whose.
    #[error(
        "{}: its players are {players}, and its episodes do not name theirs: filter the recordings of `{wanted}` before \
         they are merged", path.display()
    )]
    ManyPlayers {
        /// The recording.
        path: PathBuf,
        /// Its players.
        players: String,
        /// The player that was asked for.
        wanted: String,
    },
    /// No recording is of the player.
    #[error("no recording is by `{wanted}`; the players are {}", players.join(" and "))]
    NoPlayer {
        /// The player that was asked for.
        wanted: String,
        /// The players of the recordings, each once.
        players: Vec<String>,
    },
}

impl HasExitCode for FilterError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::File(error) => error.exit_code(),
            _ => 3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_playbot::{
        action::{ActionSpace, Actions},
        demo::file::{DemoEnd, DemoWriter},
    };

    fn header(player: &str) -> DemoHeader {
        let header = DemoHeader::new("walk", 1, "easy", 60.0, ActionSpace::Discrete(3));
        DemoHeader { demonstrator: player.to_owned(), ..header }
    }

    /// Creates an episode with these actions, whose return is `total`.
    fn episode(level: u64, actions: &[u32], total: f32, success: bool) -> DemoEpisode {
        let ticks = actions.len();
        let mut rewards = vec![0.0; ticks];
        rewards[ticks - 1] = total;
        DemoEpisode {
            actions: Actions::Discrete(actions.to_vec()),
            rewards,
            state_hashes: vec![7; ticks],
            deciders: vec![Decider::Human; ticks],
            end: DemoEnd::Terminated { success },
            ..DemoEpisode::new(level, ActionSpace::Discrete(3))
        }
    }

    fn write(folder: &Path, name: &str, header: DemoHeader, episodes: &[DemoEpisode]) -> PathBuf {
        let path = folder.join(name);
        let mut writer = DemoWriter::create(&path, header).expect("writable");
        episodes.iter().for_each(|episode| writer.push(episode).expect("writable"));
        path
    }

    fn read(path: &Path) -> Vec<DemoEpisode> {
        DemoReader::open(path).and_then(DemoReader::read_all).expect("whole")
    }

    #[test]
    fn episodes_are_kept_if_they_meet_all_conditions() {
        let folder = tempfile::tempdir().expect("a folder");
        let all = [
            episode(0, &[1], 4.0, true),
            episode(1, &[1, 2], 6.0, true),
            episode(2, &[2], 6.0, false),
            episode(3, &[2, 2], 9.0, true),
            episode(9, &[2, 1], 6.0, true),
        ];
        let file = write(folder.path(), "all.demo", header("ada"), &all);
        let filter = EpisodeFilter {
            min_return: Some(6.0),
            max_return: Some(8.0),
            success: true,
            levels: vec!["easy:0..3".parse().expect("a range")],
            ..EpisodeFilter::default()
        };
        let out = folder.path().join("some.demo");
        let report = filter_demos(std::slice::from_ref(&file), &filter, &out).expect("filters");
        assert_eq!(read(&out), [all[1].clone()]);
        assert_eq!((report.episodes(), report.steps, report.idle_steps), (1, 2, 0));
        assert_eq!(report.files, [FilteredFile { file, episodes: 5, kept: 1 }]);
    }

    #[test]
    fn an_idle_start_stays_and_is_marked() {
        let folder = tempfile::tempdir().expect("a folder");
        let all = [episode(0, &[0, 0, 1, 0], 1.0, true), episode(1, &[0, 0], 1.0, true), episode(2, &[2], 1.0, true)];
        let file = write(folder.path(), "all.demo", header("ada"), &all);
        let filter = EpisodeFilter { idle: Some(ActionValue::Discrete(0)), ..EpisodeFilter::default() };
        let out = folder.path().join("marked.demo");
        let report = filter_demos(&[file], &filter, &out).expect("filters");
        let kept = read(&out);
        assert_eq!(kept.iter().map(|episode| episode.level_seed).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(kept[0].deciders, [Decider::Idle, Decider::Idle, Decider::Human, Decider::Human]);
        assert_eq!((&kept[0].actions, &kept[1]), (&all[0].actions, &all[2]));
        assert_eq!((report.steps, report.idle_steps), (5, 2));
    }

    #[test]
    fn recordings_of_other_players_are_left_out() {
        let folder = tempfile::tempdir().expect("a folder");
        let (one, two) = (episode(0, &[1], 1.0, true), episode(1, &[1], 1.0, true));
        let ada = write(folder.path(), "ada.demo", header("ada"), std::slice::from_ref(&one));
        let bob = write(folder.path(), "bob.demo", header("bob"), &[two]);
        let both = write(folder.path(), "both.demo", header("ada, bob"), std::slice::from_ref(&one));
        let out = folder.path().join("out.demo");
        let by = |name: &str| EpisodeFilter { player: Some(name.to_owned()), ..EpisodeFilter::default() };
        let report = filter_demos(&[ada.clone(), bob.clone()], &by("ada"), &out).expect("filters");
        assert_eq!(
            (read(&out), report.header.demonstrator.as_str(), report.left_out),
            (vec![one], "ada", vec![bob.clone()])
        );
        let out = folder.path().join("none.demo");
        let unknown = filter_demos(&[ada, bob], &by("eve"), &out).expect_err("no such player").to_string();
        assert_eq!(unknown, "no recording is by `eve`; the players are ada and bob");
        let merged = filter_demos(&[both], &by("bob"), &out).expect_err("of both").to_string();
        assert!(merged.contains("its players are ada, bob, and its episodes do not name theirs"), "{merged}");
        assert!(!out.exists());
    }

    #[test]
    fn nothing_is_written_if_no_episode_or_no_level_fits() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = write(folder.path(), "a.demo", header("ada"), &[episode(0, &[1], 1.0, false)]);
        let out = folder.path().join("out.demo");
        let won = EpisodeFilter { success: true, ..EpisodeFilter::default() };
        let report = filter_demos(std::slice::from_ref(&file), &won, &out).expect("reads");
        assert_eq!((report.episodes(), report.files[0].episodes), (0, 1));
        let levels = vec!["hard:0..9".parse().expect("a range")];
        let other = EpisodeFilter { levels, ..EpisodeFilter::default() };
        let error = filter_demos(&[file], &other, &out).expect_err("of another mode").to_string();
        assert!(error.contains("recorded in mode `easy`") && error.contains("such as easy:0..9"), "{error}");
        assert!(!out.exists());
    }
}
