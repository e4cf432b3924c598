//! New recordings of the episodes of others: joined, selected, or with another player's name.

use crate::{
    action::Actions,
    demo::file::{
        episode::DemoEpisode,
        error::{DemoFault, DemoFileError},
        header::DemoHeader,
        reader::DemoReader,
        writer::DemoWriter,
    },
};
use std::{
    collections::{HashMap, HashSet},
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
};

/// Writes the episodes of several recordings of one game into a new file, in the order of `files`.
///
/// They must agree in everything that a replay depends on: game, version, mode, tick rate, actions, names of kept
/// observations and noise. Testers may differ: the new file names all of them. The input files stay unchanged.
///
/// ```no_run
/// use bevy_playbot::demo::file::{DemoFileError, merge_demos};
///
/// let report = merge_demos(&["ada.demo", "bob.demo"], "all.demo")?;
/// assert!(report.episodes() >= 2, "of the game {}", report.header.game);
/// # Ok::<(), DemoFileError>(())
/// ```
///
/// # Errors
///
/// The first file that belongs to another game, version or mode ([`DemoFault::ForeignGame`] and its kin), differs
/// otherwise ([`DemoFault::MergeDiffers`]), is damaged, or is named twice. [`DemoFault::Exists`] when there is a file
/// at `out`, and [`DemoFault::NothingToMerge`] without files. After an error there is no file at `out`.
pub fn merge_demos(files: &[impl AsRef<Path>], out: impl AsRef<Path>) -> Result<MergeReport, DemoFileError> {
    select_demos(files, out, |_, episode| Some(episode))
}

/// Writes some of the episodes of several recordings of one game into a new file, in the order of `files`.
///
/// `choose` receives each episode with its file, and returns it if the new file is to have it. It may change data that
/// no replay compares, such as the deciders. For the rest this is [`merge_demos`].
///
/// # Errors
///
/// As for [`merge_demos`]. After an error there is no file at `out`.
pub fn select_demos(
    files: &[impl AsRef<Path>],
    out: impl AsRef<Path>,
    mut choose: impl FnMut(&Path, DemoEpisode) -> Option<DemoEpisode>,
) -> Result<MergeReport, DemoFileError> {
    let out = out.as_ref();
    let Some(first) = files.first() else { return Err(DemoFileError::new(out, DemoFault::NothingToMerge)) };
    let mut readers = Vec::new();
    for (index, path) in files.iter().enumerate() {
        let path = path.as_ref();
        if files[..index].iter().any(|before| is_same(before.as_ref(), path)) {
            return Err(DemoFileError::new(path, DemoFault::NamedTwice));
        }
        if let Some(before) = files[..index].iter().find(|before| has_same_bytes(before.as_ref(), path)) {
            return Err(DemoFileError::new(path, DemoFault::CopyOf(before.as_ref().into())));
        }
        readers.push(DemoReader::open(path)?);
    }
    let header = common_header(first.as_ref(), &readers)?;
    copy(readers, header, out, &mut choose)
}

/// Writes all episodes of a recording into a new file that names this player. The input file stays unchanged.
///
/// # Errors
///
/// The file is damaged, or there is one at `out` already. After an error there is no new file at `out`.
pub fn relabel_demo(file: impl AsRef<Path>, player: &str, out: impl AsRef<Path>) -> Result<MergeReport, DemoFileError> {
    let reader = DemoReader::open(file)?;
    let header = DemoHeader { demonstrator: player.to_owned(), ..reader.header().clone() };
    copy(vec![reader], header, out.as_ref(), &mut |_, episode| Some(episode))
}

/// Counts the last `added` episodes of a recording that play as one before them does, tick by tick.
///
/// # Errors
///
/// The file cannot be read, or is damaged.
pub fn repeated_episodes(file: impl AsRef<Path>, added: usize) -> Result<usize, DemoFileError> {
    let played: Result<Vec<u64>, DemoFileError> =
        DemoReader::open(file)?.map(|episode| episode.map(|episode| hash_of_play(&episode))).collect();
    let played = played?;
    let (before, added) = played.split_at(played.len().saturating_sub(added));
    let before: HashSet<&u64> = before.iter().collect();
    Ok(added.iter().filter(|episode| before.contains(episode)).count())
}

/// Writes the chosen episodes under a header.
fn copy(
    readers: Vec<DemoReader>,
    header: DemoHeader,
    out: &Path,
    choose: &mut impl FnMut(&Path, DemoEpisode) -> Option<DemoEpisode>,
) -> Result<MergeReport, DemoFileError> {
    let mut writer = DemoWriter::create(out, header.clone())?;
    let mut report = MergeReport { header, files: Vec::new(), steps: 0, equal_episodes: 0 };
    // The file in which each episode came first, by its play.
    let mut first_files: HashMap<u64, usize> = HashMap::new();
    let copied = readers.into_iter().enumerate().try_for_each(|(file, reader)| {
        let (path, mut kept) = (reader.path().to_owned(), 0);
        for episode in reader {
            let Some(episode) = choose(&path, episode?) else { continue };
            report.steps += episode.len();
            let is_known = *first_files.entry(hash_of_play(&episode)).or_insert(file) != file;
            report.equal_episodes += usize::from(is_known);
            kept += 1;
            writer.push(&episode)?;
        }
        report.files.push((path, kept));
        Ok(())
    });
    if let Err(error) = copied {
        drop(writer);
        // An unfinished copy would look like a whole one.
        let _ = playbot_learner::disk::remove_file(out);
        return Err(error);
    }
    Ok(report)
}

/// The result of a merge or a selection.
#[derive(Clone, Debug, PartialEq)]
pub struct MergeReport {
    /// Header of the new file.
    pub header: DemoHeader,
    /// Each file, in order, with the number of its episodes in the new one.
    pub files: Vec<(PathBuf, usize)>,
    /// Ticks over all episodes.
    pub steps: usize,
    /// Episodes that play as one of an earlier file does, tick by tick, as those of a copy with another player's name do.
    pub equal_episodes: usize,
}

impl MergeReport {
    /// Episodes of the new file.
    pub fn episodes(&self) -> usize {
        self.files.iter().map(|(_, episodes)| episodes).sum()
    }
}

/// Returns a hash of what was played: the level, and each tick without its decider.
fn hash_of_play(episode: &DemoEpisode) -> u64 {
    let DemoEpisode { level_seed, level_file, randomised, actions, rewards, state_hashes, end, .. } = episode;
    let mut hasher = DefaultHasher::new();
    (level_seed, level_file.as_ref().map(|file| file.hash), state_hashes).hash(&mut hasher);
    randomised.iter().for_each(|drawn| (&drawn.path, drawn.value.to_bits()).hash(&mut hasher));
    rewards.iter().for_each(|reward| reward.to_bits().hash(&mut hasher));
    match actions {
        Actions::Discrete(list) => list.hash(&mut hasher),
        Actions::Continuous { dim, values } => {
            dim.hash(&mut hasher);
            values.iter().for_each(|value| value.to_bits().hash(&mut hasher));
        }
        Actions::Mixed { options, values, .. } => {
            options.hash(&mut hasher);
            values.iter().for_each(|value| value.to_bits().hash(&mut hasher));
        }
    }
    std::mem::discriminant(end).hash(&mut hasher);
    hasher.finish()
}

/// Returns whether two paths lead to one file.
fn is_same(one: &Path, other: &Path) -> bool {
    match (one.canonicalize(), other.canonicalize()) {
        (Ok(one), Ok(other)) => one == other,
        _ => one == other,
    }
}

/// Returns whether two files are equal. Only files of one length are read.
fn has_same_bytes(one: &Path, other: &Path) -> bool {
    let length = |path: &Path| fs::metadata(path).ok().map(|data| data.len());
    // What cannot be read is an error when it is opened.
    length(one).is_some()
        && length(one) == length(other)
        && fs::read(one).is_ok_and(|bytes| fs::read(other).is_ok_and(|other| other == bytes))
}

/// Returns the common header of all these recordings.
fn common_header(first: &Path, readers: &[DemoReader]) -> Result<DemoHeader, DemoFileError> {
    let mut common = readers[0].header().clone();
    let mut names: Vec<String> = Vec::new();
    for reader in readers {
        let header = reader.header();
        let refuse = |fault| DemoFileError::new(reader.path(), fault);
        header.check_game(&common.game, common.game_version, Some(&common.mode)).map_err(refuse)?;
        let testers = DemoHeader { demonstrator: common.demonstrator.clone(), ..header.clone() };
        if let Err(fault) = testers.check_append(&common) {
            return Err(refuse(match fault {
                DemoFault::HeaderDiffers { field, found, wanted } => {
                    DemoFault::MergeDiffers { field, found, expected: wanted, first: first.to_owned() }
                }
                other => other,
            }));
        }
        for name in header.demonstrator.split(", ").filter(|name| !name.is_empty()) {
            if !names.iter().any(|known| known == name) {
                names.push(name.to_owned());
            }
        }
    }
    common.demonstrator = names.join(", ");
    Ok(common)
}
