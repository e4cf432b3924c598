//! Recovery of the intact parts of a damaged recording.
//!
//! ```
//! use bevy_playbot::demo::file::repair::repair;
//!
//! let folder = std::env::temp_dir();
//! let missing = repair(folder.join("no-such.demo"), folder.join("repaired.demo"), None);
//! assert!(missing.is_err(), "there is nothing to repair");
//! ```

use crate::demo::file::{
    bytes,
    bytes::{FRAME_EXTRA, FRAME_MAGIC, MAX_PAYLOAD},
    error::{DemoFault, DemoFileError},
    header::DemoHeader,
    preamble,
    reader::DemoReader,
    writer,
};
use playbot_learner::disk::{DiskFile, hard_link, remove_file, rename};
use serde::Serialize;
use std::{
    fs,
    fs::File,
    io::{Read, Write},
    path::{Path, PathBuf},
};

/// A stretch of the input without an intact frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct DroppedRegion {
    /// Byte offset from the start of the input.
    pub offset: u64,
    /// Its length in bytes.
    pub bytes: u64,
}

/// The result of [`repair`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RepairReport {
    /// Episodes in the repaired file.
    pub kept_episodes: usize,
    /// Ticks in the repaired file.
    pub kept_steps: usize,
    /// Bytes of the input that were dropped: the sum over the regions.
    pub dropped_bytes: u64,
    /// The dropped regions, in the order of the file.
    pub dropped_regions: Vec<DroppedRegion>,
    /// Path of the damaged file, when it was repaired in place.
    pub backup: Option<PathBuf>,
    /// The file that the header was taken from, if the one at the top is damaged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub header_from: Option<PathBuf>,
}

/// Copies the header and every intact episode of `path` to `out`. A damaged header is taken from its copy in the
/// file. If that is damaged too, it is taken from `header_from`, another recording of the same game. Episodes that do
/// not fit that header are dropped.
///
/// A frame is intact when its checksum holds and its episode fits the header. After a damaged frame the search
/// continues at the next frame magic, so episodes behind the damage are kept too. The result is written under a
/// temporary name and then renamed. The input is not modified, unless `out` is the same file. Then the damaged file
/// is kept beside it as `FILE.bak` (or `FILE.bak2`, … if that exists), and a file without damage stays unchanged.
///
/// # Errors
///
/// No header is valid, `out` is another file that exists ([`DemoFault::Exists`]), another program records to the file
/// that is repaired in place ([`DemoFault::Locked`]), or reading or writing fails.
pub fn repair(
    path: impl AsRef<Path>,
    out: impl AsRef<Path>,
    header_from: Option<&Path>,
) -> Result<RepairReport, DemoFileError> {
    let (path, out) = (path.as_ref(), out.as_ref());
    let at_input = |fault| DemoFileError::new(path, fault);
    let file = File::open(path).map_err(|e| at_input(DemoFault::io("open the file")(e)))?;
    let in_place = match (fs::canonicalize(path), fs::canonicalize(out)) {
        (Ok(a), Ok(b)) if a == b => true,
        (_, Ok(_)) => return Err(DemoFileError::new(out, DemoFault::Exists)),
        _ => false,
    };
    if in_place {
        writer::lock(&file).map_err(at_input)?;
    }
    let Loaded { input, header, top, start, header_from } = load(&file, path, header_from)?;
    let mut output = top;
    let mut report = RepairReport { header_from, ..salvage(&input, start, &header, &mut output) };
    if in_place {
        if output == input {
            return Ok(report);
        }
        let backup = keep_backup(path, &input);
        report.backup = Some(backup.map_err(|e| at_input(DemoFault::io("keep a backup")(e)))?);
    }
    let temporary = beside(out, ".repairing");
    let written = DiskFile::create(&temporary)
        .and_then(|mut file| file.write_all(&output).and_then(|()| file.sync()))
        .and_then(|()| rename(&temporary, out));
    written.map_err(|source| {
        let _ = remove_file(&temporary);
        DemoFileError::new(out, DemoFault::io("write the repaired file")(source))
    })?;
    Ok(report)
}

/// A file whose header is known.
struct Loaded {
    /// All of its bytes.
    input: Vec<u8>,
    header: DemoHeader,
    /// The top of the repaired file.
    top: Vec<u8>,
    /// Byte offset of the first frame.
    start: usize,
    /// The file that the header is from, if it is not the top of this one.
    header_from: Option<PathBuf>,
}

fn load(mut file: &File, path: &Path, header_from: Option<&Path>) -> Result<Loaded, DemoFileError> {
    let at_input = |fault| DemoFileError::new(path, fault);
    let mut input = Vec::new();
    file.read_to_end(&mut input).map_err(|e| at_input(DemoFault::io("read the file")(e)))?;
    let fault = match preamble::decode(input.as_slice()) {
        Ok((header, start)) => {
            let (top, start) = (input[..start as usize].to_vec(), start as usize);
            return Ok(Loaded { input, header, top, start, header_from: None });
        }
        Err(fault) => fault,
    };
    let (header, start, from) = match (preamble::recover(&input), header_from) {
        (Some((header, start)), _) => (header, start, path.to_owned()),
        (None, Some(other)) => (DemoReader::open(other)?.header().clone(), 0, other.to_owned()),
        (None, None) => return Err(at_input(fault.without_copy())),
    };
    let top = preamble::encode(&header).map_err(at_input)?;
    Ok(Loaded { input, header, top, start, header_from: Some(from) })
}

/// Appends every intact frame from `start` on to `output`.
pub(super) fn salvage(input: &[u8], start: usize, header: &DemoHeader, output: &mut Vec<u8>) -> RepairReport {
    let mut report = RepairReport::default();
    let mut drop_region = |from: usize, to: usize| {
        if from < to {
            let region = DroppedRegion { offset: from as u64, bytes: (to - from) as u64 };
            report.dropped_bytes += region.bytes;
            report.dropped_regions.push(region);
        }
    };
    let (mut at, mut sound_until) = (start, start);
    let (mut episodes, mut steps) = (0, 0);
    while let Some(found) = find_magic(&input[at..]) {
        at += found;
        let Some((frame, episode_steps)) = sound_frame(&input[at..], header) else {
            at += 1;
            continue;
        };
        drop_region(sound_until, at);
        output.extend_from_slice(frame);
        at += frame.len();
        sound_until = at;
        episodes += 1;
        steps += episode_steps;
    }
    drop_region(sound_until, input.len());
    RepairReport { kept_episodes: episodes, kept_steps: steps, ..report }
}

fn find_magic(bytes: &[u8]) -> Option<usize> {
    bytes.windows(FRAME_MAGIC.len()).position(|w| w == FRAME_MAGIC)
}

/// Returns the frame at the start of `bytes` and the steps of its episode, if it is intact.
fn sound_frame<'a>(bytes: &'a [u8], header: &DemoHeader) -> Option<(&'a [u8], usize)> {
    let length = bytes::payload_length(bytes).filter(|&n| n <= MAX_PAYLOAD)?;
    let frame = bytes.get(..length + FRAME_EXTRA)?;
    let episode = bytes::decode(bytes::payload(frame)?, header).ok()?;
    Some((frame, episode.len()))
}

/// Gives the file a second name, `FILE.bak`, without ever replacing a file.
fn keep_backup(path: &Path, content: &[u8]) -> std::io::Result<PathBuf> {
    let mut number = 1;
    loop {
        let backup = match number {
            1 => beside(path, ".bak"),
            _ => beside(path, &format!(".bak{number}")),
        };
        match hard_link(path, &backup) {
            Ok(()) => return Ok(backup),
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => number += 1,
            // File systems without hard links.
            Err(_) => {
                let mut copy = DiskFile::create_new(&backup)?;
                copy.write_all(content)?;
                copy.sync()?;
                return Ok(backup);
            }
        }
    }
}

/// Returns the path with a suffix added to its file name.
fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demo::file::DemoWriter;
    use crate::demo::file::testing::{episode, header, write};

    fn seeds(path: &Path) -> Vec<u64> {
        let episodes = DemoReader::open(path).and_then(DemoReader::read_all).expect("sound");
        episodes.iter().map(|e| e.level_seed).collect()
    }

    #[test]
    fn episodes_behind_the_damage_are_kept() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = write(folder.path(), "a.demo", &[episode(1, 9), episode(2, 9), episode(3, 9)]);
        let mut bytes = fs::read(&path).expect("read");
        let second = DemoReader::open(&path).map(|mut r| (r.next().is_some(), r.offset()).1).expect("opens");
        bytes[second as usize + 30] ^= 0x10;
        fs::write(&path, &bytes).expect("damaged");
        let out = folder.path().join("b.demo");
        let report = repair(&path, &out, None).expect("repaired");
        assert_eq!(seeds(&out), [1, 3]);
        assert_eq!(fs::read(&path).expect("read"), bytes, "the input is not touched");
        let frame = bytes::encode(&episode(2, 9), &header()).expect("valid").len() as u64;
        let regions = vec![DroppedRegion { offset: second, bytes: frame }];
        let expected = RepairReport {
            kept_episodes: 2,
            kept_steps: 18,
            dropped_bytes: frame,
            dropped_regions: regions,
            backup: None,
            header_from: None,
        };
        assert_eq!(report, expected);
        let error = repair(&path, &out, None).expect_err("the output exists");
        assert!(matches!(error.fault, DemoFault::Exists), "{error}");
    }

    #[test]
    fn repair_in_place_keeps_backups_and_allows_appending() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = write(folder.path(), "a.demo", &[episode(1, 5)]);
        assert_eq!(repair(&path, &path, None).expect("nothing to do").backup, None);
        for round in 1..=2 {
            let torn = [fs::read(&path).expect("read"), FRAME_MAGIC.to_vec(), vec![9; 7]].concat();
            fs::write(&path, &torn).expect("torn");
            let error = DemoWriter::append(&path, &header()).expect_err("torn");
            assert!(
                error.is_repairable()
                    && error.to_string().contains(&format!("`playbot demo repair {}`", path.display())),
                "{error}"
            );
            let report = repair(&path, &path, None).expect("repaired");
            let backup = folder.path().join(if round == 1 { "a.demo.bak" } else { "a.demo.bak2" });
            assert_eq!((report.kept_episodes, report.dropped_bytes), (round, 11));
            assert_eq!(report.backup.as_deref(), Some(backup.as_path()));
            assert_eq!(fs::read(backup).expect("kept"), torn);
            let mut writer = DemoWriter::append(&path, &header()).expect("sound again");
            writer.push(&episode(round as u64 + 1, 5)).expect("written");
        }
        assert_eq!(seeds(&path), [1, 2, 3]);
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 3, "no temporary file is left");
    }
}
