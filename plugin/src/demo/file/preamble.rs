//! The text at the top of the file: one magic line, then the header as RON.
//!
//! ```text
//! playbot-demo header=00000214 crc32=5d3a90c1
//! (
//!     format: 1,
//!     game: "coinrun",
//!     …
//! )
//! // playbot-demo header=00000102 crc32=0c1d2e3f
//! // (
//! …
//! ```
//!
//! The text ends with a [copy](copy_of) of itself in comments. The magic line gives the length of the
//! RON text in bytes and its CRC-32. It is the same in all formats, so that an older program can report that a file
//! is too new for it.

use crate::demo::file::{
    bytes::FRAME_MAGIC,
    error::DemoFault,
    header::{DEMO_FORMAT, DemoHeader},
};
use serde::Deserialize;
use std::io::Read;

/// First bytes of every recording.
pub const DEMO_MAGIC: &str = "playbot-demo ";

/// Length of the magic line in bytes, with its line feed.
const LINE_LENGTH: usize = "playbot-demo header=00000000 crc32=00000000\n".len();

/// Longest header that is read, in bytes, to guard the memory against a damaged length.
const MAX_HEADER: usize = 1 << 20;

/// Start of a comment line.
const COMMENT: &str = "// ";

/// The only field that is read before the format is known.
#[derive(Deserialize)]
struct FormatOnly {
    format: u32,
}

fn magic_line(length: usize, crc: u32) -> String {
    format!("{DEMO_MAGIC}header={length:08} crc32={crc:08x}\n")
}

/// Returns the bytes at the top of a file with this header.
pub(super) fn encode(header: &DemoHeader) -> Result<Vec<u8>, DemoFault> {
    header.check()?;
    let pretty = ron::ser::PrettyConfig::new().new_line("\n");
    let mut text = ron::ser::to_string_pretty(header, pretty)
        .map_err(|e| DemoFault::HeaderValue { field: "header", why: e.to_string() })?;
    text.push('\n');
    let top = format!("{}{text}", magic_line(text.len(), crc32fast::hash(text.as_bytes())));
    text.push_str(&copy_of(&top));
    if text.len() > MAX_HEADER {
        let why = format!("{} bytes of text, but at most {MAX_HEADER} are read back", text.len());
        return Err(DemoFault::HeaderValue { field: "header", why });
    }
    let mut bytes = magic_line(text.len(), crc32fast::hash(text.as_bytes())).into_bytes();
    bytes.extend_from_slice(text.as_bytes());
    Ok(bytes)
}

/// Reads the header from the start of a file. Returns it with the offset of the first frame.
pub(super) fn decode(mut input: impl Read) -> Result<(DemoHeader, u64), DemoFault> {
    let line = read_up_to(&mut input, LINE_LENGTH)?;
    let magic = &line[..line.len().min(DEMO_MAGIC.len())];
    if !DEMO_MAGIC.as_bytes().starts_with(magic) {
        return Err(DemoFault::NotADemo { found: magic.escape_ascii().to_string() });
    }
    if line.len() < LINE_LENGTH {
        return Err(DemoFault::TruncatedHeader { length: line.len() as u64 });
    }
    let (length, crc) = parse_line(&line)?;
    let text = read_up_to(&mut input, length)?;
    if text.len() < length {
        return Err(DemoFault::TruncatedHeader { length: (LINE_LENGTH + text.len()) as u64 });
    }
    let intact = crc32fast::hash(&text) == crc;
    let parsed = parse_text(&text, intact);
    // A damaged header that still parses must not be trusted.
    if parsed.is_ok() && !intact {
        return Err(DemoFault::HeaderChecksum);
    }
    let header = parsed?;
    header.check()?;
    Ok((header, (LINE_LENGTH + length) as u64))
}

fn read_up_to(input: &mut impl Read, length: usize) -> Result<Vec<u8>, DemoFault> {
    let mut bytes = Vec::new();
    input.take(length as u64).read_to_end(&mut bytes).map_err(DemoFault::io("read the header"))?;
    Ok(bytes)
}

fn parse_line(line: &[u8]) -> Result<(usize, u32), DemoFault> {
    let refuse = |why| DemoFault::HeaderLine { found: line.trim_ascii_end().escape_ascii().to_string(), why };
    let parsed = std::str::from_utf8(line).ok().and_then(|text| {
        let rest = text.strip_prefix(DEMO_MAGIC)?.strip_prefix("header=")?.strip_suffix('\n')?;
        let (length, crc) = rest.split_once(" crc32=")?;
        Some((length.parse::<usize>().ok()?, u32::from_str_radix(crc, 16).ok()?))
    });
    let (length, crc) = parsed.ok_or_else(|| refuse("expected `header=<8 digits> crc32=<8 hex digits>`"))?;
    if magic_line(length, crc).as_bytes() != line {
        return Err(refuse("expected `header=<8 digits> crc32=<8 hex digits>`"));
    }
    if length > MAX_HEADER {
        return Err(refuse("the header is longer than any header"));
    }
    Ok((length, crc))
}

fn parse_text(text: &[u8], intact: bool) -> Result<DemoHeader, DemoFault> {
    let syntax = |e: ron::error::SpannedError| DemoFault::HeaderSyntax {
        // Line 1 of the file is the magic line.
        line: e.span.start.line + 1,
        column: e.span.start.col,
        message: e.code.to_string(),
    };
    if intact
        && let Ok(FormatOnly { format }) = ron::de::from_bytes(text)
        && format > DEMO_FORMAT
    {
        return Err(DemoFault::NewerFormat { found: format, newest: DEMO_FORMAT });
    }
    ron::de::from_bytes(text).map_err(syntax)
}

// Second copy of the header, so that damage to one copy loses no episode.

/// Returns the copy of the text at the top of a file.
///
/// The copy follows the header as comments of RON: the magic line and the text once more. The magic line at the top
/// of the file gives length and checksum of both together, so older programs skip the copy.
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
    let begin = [COMMENT, DEMO_MAGIC].concat();
    // Bytes that are no text belong to the damage of another line.
    let text = String::from_utf8_lossy(top);
    let lines = text.lines().skip(1).skip_while(|line| !line.starts_with(&begin));
    let copy: String = lines.map_while(|line| line.strip_prefix(COMMENT)).flat_map(|line| [line, "\n"]).collect();
    decode(copy.as_bytes()).ok().map(|(header, _)| header)
}

/// Returns the header above a damaged copy, if it matches the magic line at the top once it is written again.
fn first(top: &[u8]) -> Option<DemoHeader> {
    let text = String::from_utf8_lossy(top);
    let (line, rest) = text.split_once('\n')?;
    let end = rest.find("\n)")? + "\n)".len();
    let header: DemoHeader = ron::de::from_str(&rest[..end]).ok()?;
    let written = encode(&header).ok()?;
    written.starts_with(format!("{line}\n").as_bytes()).then_some(header)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        action::ActionSpace,
        demo::file::{
            DemoReader, repair,
            testing::{self, episode, write},
        },
    };
    use std::fs;

    fn header() -> DemoHeader {
        DemoHeader {
            observation_names: vec!["x".into(), "y \"quoted\"\n".into()],
            demonstrator: "Zoë".into(),
            ..DemoHeader::new("coinrun", 3, "easy", 60.0, ActionSpace::Discrete(15))
        }
    }

    fn with_text(text: &str) -> Vec<u8> {
        let mut bytes = magic_line(text.len(), crc32fast::hash(text.as_bytes())).into_bytes();
        bytes.extend_from_slice(text.as_bytes());
        bytes
    }

    #[test]
    fn the_text_reads_back_and_is_for_people() {
        let bytes = encode(&header()).expect("valid");
        let text = std::str::from_utf8(&bytes).expect("text");
        assert!(text.starts_with("playbot-demo header="), "{text}");
        assert!(text.contains("\n    game: \"coinrun\",\n"), "{text}");
        assert!(text.contains("\n    actions: Discrete(15),\n"), "{text}");
        let (back, offset) = decode(bytes.as_slice()).expect("reads back");
        assert_eq!((back, offset), (header(), bytes.len() as u64));
    }

    #[test]
    fn a_syntax_error_names_its_line_in_the_file() {
        let text = "(\n    format: 1,\n    game: ,\n)\n";
        match decode(with_text(text).as_slice()).expect_err("syntax") {
            DemoFault::HeaderSyntax { line: 4, column, .. } => assert!((10..=11).contains(&column), "{column}"),
            other => panic!("{other}"),
        }
        let unknown = String::from_utf8(encode(&header()).expect("valid")[LINE_LENGTH..].to_vec())
            .expect("text")
            .replace("note:", "nota:");
        let error = decode(with_text(&unknown).as_slice()).expect_err("unknown field").to_string();
        assert!(error.contains("nota"), "{error}");
    }

    #[test]
    fn a_newer_format_is_said_even_when_its_fields_are_unknown() {
        let error = decode(with_text("(format: 5, sound: [1, 2])").as_slice()).expect_err("newer");
        assert!(matches!(error, DemoFault::NewerFormat { found: 5, newest: 4 }), "{error}");
    }

    #[test]
    fn an_edited_header_is_refused() {
        let text = String::from_utf8(encode(&header()).expect("valid")).expect("text");
        let edited = text.replace("coinrun", "coinrum");
        assert!(matches!(decode(edited.as_bytes()), Err(DemoFault::HeaderChecksum)));
    }

    #[test]
    fn other_files_and_cut_files_are_distinguished() {
        assert!(
            matches!(decode(b"PK\x03\x04".as_slice()), Err(DemoFault::NotADemo { found }) if found == "PK\\x03\\x04")
        );
        assert!(matches!(decode(b"".as_slice()), Err(DemoFault::TruncatedHeader { length: 0 })));
        assert!(matches!(decode(b"playbot-de".as_slice()), Err(DemoFault::TruncatedHeader { length: 10 })));
        let huge = b"playbot-demo header=99999999 crc32=00000000\n";
        assert!(matches!(decode(huge.as_slice()), Err(DemoFault::HeaderLine { .. })));
    }

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
        assert_eq!(DemoReader::open(&out).expect("opens").header(), &testing::header());
    }
}
