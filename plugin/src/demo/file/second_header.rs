//! The second copy of a header, so that damage to one copy loses no episode.
//!
//! The copy follows the header as comments of RON: the magic line and the text once more. The magic line at the top
//! of the file gives length and checksum of both together, so older programs skip the copy.

use super::frame::FRAME_MAGIC;
use super::header::DemoHeader;
use super::preamble;

/// Start of a comment line.
const COMMENT: &str = "// ";

/// Returns the copy of the text at the top of a file.
pub(super) fn copy_of(top: &str) -> String {
    top.lines().flat_map(|line| [COMMENT, line, "\n"]).collect()
}

/// Returns the header of a file whose header is damaged in one copy, and the offset at which to search for frames.
/// `None` if neither copy is valid, or no frame follows.
pub(super) fn recover(input: &[u8]) -> Option<(DemoHeader, usize)> {
    let frames = input.windows(FRAME_MAGIC.len()).position(|bytes| bytes == FRAME_MAGIC)?;
    let top = &input[..frames];
    let header = second(top).or_else(|| first(top))?;
    Some((header, frames))
}

/// Returns the header of the copy.
fn second(top: &[u8]) -> Option<DemoHeader> {
    let begin = [COMMENT, preamble::DEMO_MAGIC].concat();
    // Bytes that are no text belong to the damage of another line.
    let text = String::from_utf8_lossy(top);
    let lines = text.lines().skip(1).skip_while(|line| !line.starts_with(&begin));
    let copy: String = lines.map_while(|line| line.strip_prefix(COMMENT)).flat_map(|line| [line, "\n"]).collect();
    preamble::decode(copy.as_bytes()).ok().map(|(header, _)| header)
}

/// Returns the header above a damaged copy, if it matches the magic line at the top once it is written again.
fn first(top: &[u8]) -> Option<DemoHeader> {
    let text = String::from_utf8_lossy(top);
    let (line, rest) = text.split_once('\n')?;
    let end = rest.find("\n)")? + "\n)".len();
    let header: DemoHeader = ron::de::from_str(&rest[..end]).ok()?;
    let written = preamble::encode(&header).ok()?;
    written.starts_with(format!("{line}\n").as_bytes()).then_some(header)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{episode, header, write};
    use super::super::{DemoReader, repair};
    use std::fs;

    #[test]
    fn one_flipped_bit_in_a_header_loses_no_episode() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = write(folder.path(), "a.demo", &[episode(1, 3), episode(2, 3)]);
        let whole = fs::read(&path).expect("written");
        let frames = DemoReader::open(&path).expect("opens").offset() as usize;
        let (damaged, out) = (folder.path().join("damaged.demo"), folder.path().join("mended.demo"));
        for at in 0..frames {
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << (at % 8);
            fs::write(&damaged, bytes).expect("written");
            assert!(DemoReader::open(&damaged).is_err(), "byte {at}");
            let report = repair(&damaged, &out, None).expect("its other copy is sound");
            assert_eq!((report.kept_episodes, report.header_from.is_some()), (2, true), "byte {at}");
            assert!(fs::read(&out).expect("written") == whole, "byte {at}");
            fs::remove_file(&out).expect("removed");
        }
    }

    #[test]
    fn a_file_whose_copies_are_both_damaged_takes_the_header_of_another_one() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = write(folder.path(), "a.demo", &[episode(1, 3)]);
        let other = write(folder.path(), "b.demo", &[]);
        let mut bytes = fs::read(&path).expect("written");
        let frames = DemoReader::open(&path).expect("opens").offset() as usize;
        bytes[..frames].fill(b'x');
        fs::write(&path, bytes).expect("written");
        let out = folder.path().join("mended.demo");
        let error = repair(&path, &out, None).expect_err("nothing says what it is").to_string();
        let advice = format!("`playbot demo repair {} --header-from OTHER`", path.display());
        assert!(error.contains("not a recording: ") && error.contains(&advice), "{error}");
        assert_eq!(error.matches("demo repair").count(), 1, "what was tried is not advised again: {error}");
        assert_eq!(repair(&path, &out, Some(&other)).expect("it fits").kept_episodes, 1);
        let read = DemoReader::open(&out).and_then(DemoReader::read_all).expect("sound");
        assert_eq!(read, [episode(1, 3)]);
        assert_eq!(DemoReader::open(&out).expect("opens").header(), &header());
    }
}
