//! Merging of the recordings of many testers.

use std::path::{Path, PathBuf};

use super::error::{DemoFault, DemoFileError};
use super::header::DemoHeader;
use super::reader::DemoReader;
use super::writer::DemoWriter;

/// The result of a merge.
#[derive(Clone, Debug, PartialEq)]
pub struct MergeReport {
    /// Header of the new file.
    pub header: DemoHeader,
    /// Each merged file with its number of episodes, in order.
    pub files: Vec<(PathBuf, usize)>,
    /// Ticks over all episodes.
    pub steps: usize,
}

impl MergeReport {
    /// Episodes of the new file.
    pub fn episodes(&self) -> usize {
        self.files.iter().map(|(_, episodes)| episodes).sum()
    }
}

/// Writes the episodes of several recordings of one game into a new file, in the order of `files`.
///
/// They must agree in everything that a replay depends on: game, version, mode, tick rate, actions, names of kept
/// observations and noise. Testers may differ: the new file names all of them. The input files stay unchanged.
///
/// ```no_run
/// use bevy_playbot::demo::file::merge_demos;
///
/// let report = merge_demos(&["ada.demo", "bob.demo"], "all.demo")?;
/// assert!(report.episodes() >= 2, "of the game {}", report.header.game);
/// # Ok::<(), bevy_playbot::demo::file::DemoFileError>(())
/// ```
///
/// # Errors
///
/// The first file that belongs to another game, version or mode ([`DemoFault::ForeignGame`] and its kin), differs
/// otherwise ([`DemoFault::MergeDiffers`]), is damaged, or is named twice. [`DemoFault::Exists`] when there is a file
/// at `out`, and [`DemoFault::NothingToMerge`] without files. After an error there is no file at `out`.
pub fn merge_demos(files: &[impl AsRef<Path>], out: impl AsRef<Path>) -> Result<MergeReport, DemoFileError> {
    let out = out.as_ref();
    let Some(first) = files.first() else { return Err(DemoFileError::new(out, DemoFault::NothingToMerge)) };
    let mut readers = Vec::new();
    for (index, path) in files.iter().enumerate() {
        let path = path.as_ref();
        if files[..index].iter().any(|before| is_same(before.as_ref(), path)) {
            return Err(DemoFileError::new(path, DemoFault::NamedTwice));
        }
        readers.push(DemoReader::open(path)?);
    }
    let header = common_header(first.as_ref(), &readers)?;
    let mut writer = DemoWriter::create(out, header.clone())?;
    let mut report = MergeReport { header, files: Vec::new(), steps: 0 };
    let copied = readers.into_iter().try_for_each(|mut reader| {
        for episode in reader.by_ref() {
            let episode = episode?;
            report.steps += episode.len();
            writer.push(&episode)?;
        }
        report.files.push((reader.path().to_owned(), reader.episodes_read()));
        Ok(())
    });
    if let Err(error) = copied {
        drop(writer);
        // An unfinished merge would look like a whole one.
        let _ = playbot_learner::disk::remove_file(out);
        return Err(error);
    }
    Ok(report)
}

/// Returns whether two paths lead to one file.
fn is_same(one: &Path, other: &Path) -> bool {
    match (one.canonicalize(), other.canonicalize()) {
        (Ok(one), Ok(other)) => one == other,
        _ => one == other,
    }
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

#[cfg(test)]
mod tests {
    use super::super::testing::{episode, header, write};
    use super::super::{DemoActions, DemoEpisode};
    use super::*;

    fn write_as(folder: &Path, name: &str, header: DemoHeader, episodes: &[DemoEpisode]) -> PathBuf {
        let path = folder.join(name);
        let mut writer = DemoWriter::create(&path, header).expect("created");
        episodes.iter().for_each(|episode| writer.push(episode).expect("written"));
        path
    }

    #[test]
    fn all_episodes_of_all_testers_are_in_the_merged_file() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let (a, b, c) = (episode(1, 5), episode(2, 3), episode(3, 4));
        let one = write(folder.path(), "one.demo", &[a.clone(), b.clone()]);
        let zoe = DemoHeader { demonstrator: "zoë".into(), note: "on the train".into(), ..header() };
        let two = write_as(folder.path(), "two.demo", zoe, std::slice::from_ref(&c));
        let out = folder.path().join("all.demo");
        let report = merge_demos(&[&one, &two], &out).expect("merges");
        assert_eq!((report.episodes(), report.steps), (3, 12));
        assert_eq!(report.files, [(one, 2), (two, 1)]);
        let reader = DemoReader::open(&out).expect("readable");
        assert_eq!(reader.header().demonstrator, "tester, zoë");
        assert_eq!(reader.header(), &report.header);
        assert_eq!(reader.read_all().expect("whole"), [a, b, c]);
    }

    #[test]
    fn files_that_do_not_belong_together_are_refused_by_name_and_nothing_is_written() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let one = write(folder.path(), "one.demo", &[episode(1, 5)]);
        let out = folder.path().join("all.demo");
        for (name, other, words) in [
            ("game", DemoHeader { game: "maze".into(), ..header() }, "`maze`, not of `walk`"),
            ("version", DemoHeader { game_version: 3, ..header() }, "version 3 of `walk`, but this is version 2"),
            ("mode", DemoHeader { mode: "hard".into(), ..header() }, "mode `hard`"),
            ("rate", DemoHeader { tick_hz: 30.0, ..header() }, "`tick_hz` is 30.0, but 60.0 in"),
            ("actions", DemoHeader { actions: DemoActions::Discrete(5), ..header() }, "`actions` is Discrete(5)"),
        ] {
            let path = write_as(folder.path(), name, other, &[]);
            let error = merge_demos(&[&one, &path], &out).expect_err(name);
            assert_eq!(error.path, path);
            assert!(error.to_string().contains(words), "{error}");
            assert!(!out.exists(), "{name}");
        }
    }

    #[test]
    fn a_damaged_file_leaves_no_half_merge_behind() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let one = write(folder.path(), "one.demo", &[episode(1, 5)]);
        let two = write(folder.path(), "two.demo", &[episode(2, 5)]);
        let bytes = std::fs::read(&two).expect("readable");
        std::fs::write(&two, &bytes[..bytes.len() - 3]).expect("writable");
        let out = folder.path().join("all.demo");
        let error = merge_demos(&[&one, &two], &out).expect_err("torn");
        assert!(error.is_repairable() && error.path == two, "{error}");
        assert!(!out.exists());
    }

    #[test]
    fn the_same_file_twice_no_file_and_an_existing_one_are_errors() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let one = write(folder.path(), "one.demo", &[episode(1, 5)]);
        let out = folder.path().join("all.demo");
        let twice = merge_demos(&[&one, &folder.path().join("./one.demo")], &out).expect_err("twice");
        assert!(matches!(twice.fault, DemoFault::NamedTwice), "{twice}");
        let nothing = merge_demos(&[] as &[&Path], &out).expect_err("nothing");
        assert!(matches!(nothing.fault, DemoFault::NothingToMerge), "{nothing}");
        let exists = merge_demos(&[&one], &one).expect_err("exists");
        assert!(matches!(exists.fault, DemoFault::Exists), "{exists}");
        assert_eq!(DemoReader::open(&one).and_then(DemoReader::read_all).expect("left alone").len(), 1);
    }
}
