//! Level files, read once for all Worlds of a verb.

use crate::level_files::{
    DrawnLevel, LevelDesign,
    error::{LevelFileError, LevelTextError, Utf16},
    find_level_files,
};
use std::{
    collections::BTreeMap,
    fs,
    fs::File,
    io,
    io::Read,
    path::Path,
    sync::{Arc, LazyLock, Mutex, PoisonError},
};
use thiserror::Error;

/// Largest size of a level file, bytes: the largest levels with some white space.
const MOST_BYTES: u64 = 32 << 20;

/// All levels of a pattern, in order.
pub(super) type DrawnLevels = Arc<Vec<DrawnLevel>>;

/// A game's parser of levels.
#[derive(Clone, Copy)]
pub(crate) enum Parse<'a> {
    /// The parser of a text.
    Text(&'a dyn Fn(&str) -> Result<LevelDesign, LevelTextError>),
    /// The parser of a file of any kind.
    Bytes(&'a dyn Fn(&[u8]) -> Result<LevelDesign, LevelTextError>),
}

/// The files of a pattern as last read.
struct Snapshot {
    /// Path and bytes of each.
    files: Vec<(String, Vec<u8>)>,
    /// Parsed levels by the game's name.
    designs: Mutex<BTreeMap<String, DrawnLevels>>,
}

/// Snapshots by pattern. All Worlds of a verb play the same levels even if a file is saved meanwhile, and each file
/// is read and parsed once.
static READ: Mutex<BTreeMap<String, Arc<Snapshot>>> = Mutex::new(BTreeMap::new());

/// Reads the files from the disk.
pub(super) fn read_now(game: &str, pattern: &str, parse: Parse) -> Result<DrawnLevels, LevelFileError> {
    let files: Result<Vec<_>, _> =
        find_level_files(pattern)?.into_iter().map(|path| read_file(&path).map(|bytes| (path, bytes))).collect();
    let snapshot = Arc::new(Snapshot { files: files?, designs: Mutex::default() });
    let designs = snapshot.designs(game, parse)?;
    READ.lock().unwrap_or_else(PoisonError::into_inner).insert(pattern.to_owned(), snapshot);
    Ok(designs)
}

/// Returns the files as last read, and reads them first if needed.
pub(super) fn as_read(game: &str, pattern: &str, parse: Parse) -> Result<DrawnLevels, LevelFileError> {
    let known = READ.lock().unwrap_or_else(PoisonError::into_inner).get(pattern).cloned();
    match known {
        Some(snapshot) => snapshot.designs(game, parse),
        None => read_now(game, pattern, parse),
    }
}

impl Snapshot {
    fn designs(&self, game: &str, parse: Parse) -> Result<DrawnLevels, LevelFileError> {
        let mut known = self.designs.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(designs) = known.get(game) {
            return Ok(designs.clone());
        }
        let designs = Arc::new(understand_all(&self.files, parse)?);
        known.insert(game.to_owned(), designs.clone());
        Ok(designs)
    }
}

/// Parses all levels. If several are invalid, the error names them all.
fn understand_all(files: &[(String, Vec<u8>)], parse: Parse) -> Result<Vec<DrawnLevel>, LevelFileError> {
    let (mut drawn, mut first, mut others) = (Vec::new(), None, Vec::new());
    for (path, bytes) in files {
        match understand(path, bytes, parse) {
            Ok(level) => drawn.push(level),
            Err(error) if first.is_none() => first = Some(error),
            Err(_) => others.push(path.clone()),
        }
    }
    match first {
        None => Ok(drawn),
        Some(error) if others.is_empty() => Err(error),
        Some(error) => Err(LevelFileError::Several { first: Box::new(error), others }),
    }
}

/// Reads the level in a file, or from standard input.
pub(super) fn read_one(path: &str, parse: Parse) -> Result<DrawnLevel, LevelFileError> {
    let path = Path::new(path);
    let name = shown_path(path);
    let bytes = read_input(path, MOST_BYTES).map_err(|error| named(&name, error))?;
    understand(&name, &bytes, parse)
}

fn understand(path: &str, bytes: &[u8], parse: Parse) -> Result<DrawnLevel, LevelFileError> {
    let parsed = match parse {
        Parse::Text(parse) => parse(&decode(bytes).map_err(|error| named(path, error))?),
        Parse::Bytes(parse) => parse(bytes),
    };
    match parsed {
        Ok(design) => Ok(DrawnLevel { path: path.to_owned(), design }),
        Err(error) => Err(LevelFileError::Text { path: path.to_owned(), error }),
    }
}

fn read_file(path: &str) -> Result<Vec<u8>, LevelFileError> {
    read_bytes(Path::new(path), MOST_BYTES).map_err(|error| named(path, error))
}

/// Returns an error with the path of its file.
fn named(path: &str, error: TextFileError) -> LevelFileError {
    let path = path.to_owned();
    match error {
        TextFileError::Unreadable(error) => LevelFileError::Unreadable { path, why: error.to_string() },
        TextFileError::NotAFile => LevelFileError::NotAFile { path },
        TextFileError::TooLarge { bytes, most } => LevelFileError::TooLarge { path, bytes, most },
        TextFileError::Utf16(utf16) => LevelFileError::Utf16 { path, utf16 },
        TextFileError::NoText { line, byte } => LevelFileError::NoText { path, line, byte },
    }
}

/// Failure to read a file as text.
#[derive(Debug, Error)]
pub enum TextFileError {
    /// The operating system refused.
    #[error(transparent)]
    Unreadable(#[from] io::Error),
    /// Not a regular file.
    #[error("it is a folder, a pipe or a device, not a regular file")]
    NotAFile,
    /// The file is larger than any file of its kind.
    #[error("it has {bytes} bytes, and such a file has at most {most}: name another file")]
    TooLarge {
        /// Size, as far as it was read.
        bytes: u64,
        /// Largest size of a file of its kind, bytes.
        most: u64,
    },
    /// The file is UTF-16, without the mark that says so.
    #[error("{0}")]
    Utf16(Utf16),
    /// The file is not UTF-8.
    #[error("line {line}: byte {byte} of the line is not UTF-8: save it as UTF-8, or name another file")]
    NoText {
        /// Line, from 1.
        line: usize,
        /// Byte of the line, from 1.
        byte: usize,
    },
}

impl From<TextFileError> for io::Error {
    fn from(error: TextFileError) -> Self {
        match error {
            TextFileError::Unreadable(error) => error,
            other => Self::new(io::ErrorKind::InvalidData, other.to_string()),
        }
    }
}

/// Returns the text of a regular file of at most `most` bytes, or that of standard input for the path `-`. Takes no
/// more memory, whatever the path is, and waits for nothing but standard input.
///
/// # Errors
///
/// [`TextFileError`].
pub fn read_text_file(path: &Path, most: u64) -> Result<String, TextFileError> {
    decode(&read_input(path, most)?)
}

/// The path of standard input. `./-` is a file of that name.
const STANDARD_INPUT: &str = "-";

/// Standard input up to the size of the largest file. It comes once, and an experiment is read again for its errors.
static PIPED: LazyLock<Result<Vec<u8>, (io::ErrorKind, String)>> = LazyLock::new(|| {
    let mut read = Vec::new();
    match io::stdin().take(MOST_BYTES + 1).read_to_end(&mut read) {
        Ok(_) => Ok(read),
        Err(error) => Err((error.kind(), error.to_string())),
    }
});

/// Returns a path for messages: the words `standard input` for `-`.
pub fn shown_path(path: &Path) -> String {
    if path == Path::new(STANDARD_INPUT) { "standard input".to_owned() } else { path.display().to_string() }
}

/// Returns the bytes of a regular file or of standard input, of at most `most` bytes.
fn read_input(path: &Path, most: u64) -> Result<Vec<u8>, TextFileError> {
    if path != Path::new(STANDARD_INPUT) {
        return read_bytes(path, most);
    }
    let read = PIPED.as_ref().map_err(|(kind, why)| io::Error::new(*kind, why.clone()))?;
    match read.len() as u64 {
        bytes if bytes > most => Err(TextFileError::TooLarge { bytes, most }),
        _ => Ok(read.clone()),
    }
}

/// Returns the bytes of a regular file of at most `most` bytes.
fn read_bytes(path: &Path, most: u64) -> Result<Vec<u8>, TextFileError> {
    // Opening a pipe would wait for a writer.
    if !fs::metadata(path)?.is_file() {
        return Err(TextFileError::NotAFile);
    }
    let file = File::open(path)?;
    let bytes = file.metadata()?.len();
    if bytes > most {
        return Err(TextFileError::TooLarge { bytes, most });
    }
    let mut read = Vec::new();
    // Some files report no size.
    file.take(most.saturating_add(1)).read_to_end(&mut read)?;
    if read.len() as u64 > most {
        return Err(TextFileError::TooLarge { bytes: read.len() as u64, most });
    }
    Ok(read)
}

/// Returns the text of bytes in UTF-8, or in UTF-16 with a mark. Marks, which some editors put in front, are left out.
fn decode(bytes: &[u8]) -> Result<String, TextFileError> {
    let no_text = |bytes: &[u8], at: usize| {
        let before = &bytes[..at];
        let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
        let byte = 1 + before.iter().rev().take_while(|&&byte| byte != b'\n').count();
        TextFileError::NoText { line, byte }
    };
    let utf16 = |number: fn([u8; 2]) -> u16| {
        let (pairs, rest) = bytes[2..].as_chunks::<2>();
        let text = String::from_utf16(&pairs.iter().copied().map(number).collect::<Vec<_>>());
        text.ok().filter(|_| rest.is_empty()).ok_or_else(|| no_text(bytes, 0))
    };
    match bytes {
        [0xff, 0xfe, ..] => return utf16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return utf16(u16::from_be_bytes),
        _ => {}
    }
    if let Some(utf16) = Utf16::of(bytes) {
        return Err(TextFileError::Utf16(utf16));
    }
    // Other UTF-16 without a mark would pass for UTF-8.
    if let Some(zero) = bytes.iter().position(|&byte| byte == 0) {
        return Err(no_text(bytes, zero));
    }
    let text = str::from_utf8(bytes).map_err(|error| no_text(bytes, error.valid_up_to()))?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text).to_owned())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<LevelDesign, LevelTextError> {
        Ok(LevelDesign::new((), text))
    }

    #[test]
    fn what_is_no_regular_file_is_refused_and_not_waited_for() {
        let folder = tempfile::tempdir().expect("a folder");
        let pipe = folder.path().join("pipe.json");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        let mut refused = vec!["/dev/null".to_owned(), folder.path().display().to_string()];
        if made.is_ok_and(|status| status.success()) {
            refused.push(pipe.display().to_string());
        }
        for path in refused {
            let error = read_one(&path, Parse::Text(&parse)).map(drop).expect_err("no file");
            assert_eq!(error, LevelFileError::NotAFile { path: path.clone() });
        }
    }
}

#[cfg(test)]
mod text_file_tests {
    use super::*;

    #[test]
    fn marks_are_left_out_and_utf_16_is_read_or_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("text");
        let read = |bytes: &[u8]| {
            fs::write(&path, bytes).expect("writable");
            read_text_file(&path, 64).map_err(|error| error.to_string())
        };
        let text = Ok("ä\r\n(".to_owned());
        assert_eq!(read("ä\r\n(".as_bytes()), text);
        assert_eq!(read("\u{feff}ä\r\n(".as_bytes()), text);
        for of in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes = |text: &str| text.encode_utf16().flat_map(of).collect::<Vec<u8>>();
            assert_eq!(read(&bytes("\u{feff}ä\r\n(")), text);
            let torn = read(&bytes("\u{feff}ä\r\n(")[..7]).expect_err("half a letter");
            assert!(torn.starts_with("line 1: byte 1 of the line is not UTF-8"), "{torn}");
        }
        for (of, order) in [(u16::to_le_bytes as fn(u16) -> [u8; 2], "UTF-16LE"), (u16::to_be_bytes, "UTF-16BE")] {
            let bytes = |text: &str| text.encode_utf16().flat_map(of).collect::<Vec<u8>>();
            // Some letters have a high byte, and the last one of a torn file has lost it.
            for bare in [bytes("(a: 1)"), bytes("a: Ωж\n"), bytes("(a: 1)")[..11].to_vec()] {
                let bare = read(&bare).expect_err("no mark");
                let wanted =
                    "it is text in UTF-16 without a byte order mark: save it as UTF-8 in an editor, or with `iconv -f ";
                assert_eq!(bare, format!("{wanted}{order} -t UTF-8`"));
            }
        }
        for other in [&b"\0\0a\0"[..], b"a\0", b"ab\0cdefg", b"\0"] {
            let is_utf16 = other == b"a\0";
            let error = read(other).expect_err("zeros");
            assert_eq!(error.starts_with("it is text in UTF-16"), is_utf16, "{error}");
        }
        assert_eq!(read(b""), Ok(String::new()));
    }

    #[test]
    fn a_text_is_read_up_to_its_limit_and_not_beyond() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.txt");
        fs::write(&path, "four").expect("writable");
        assert_eq!(read_text_file(&path, 4).expect("four bytes"), "four");
        let error = read_text_file(&path, 3).expect_err("too long").to_string();
        assert_eq!(error, "it has 4 bytes, and such a file has at most 3: name another file");
        fs::write(&path, b"a\nbc\xff").expect("writable");
        let error = read_text_file(&path, 100).expect_err("no text").to_string();
        assert!(error.starts_with("line 2: byte 3 of the line"), "{error}");
        assert!(matches!(read_text_file(folder.path(), 100), Err(TextFileError::NotAFile)));
    }
}
