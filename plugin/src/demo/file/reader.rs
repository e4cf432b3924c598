//! The reader of recordings.

use crate::demo::file::{
    bytes,
    bytes::{FRAME_EXTRA, FRAME_HEAD, MAX_PAYLOAD},
    episode::DemoEpisode,
    error::{DemoFault, DemoFileError},
    header::DemoHeader,
    preamble,
};
use std::{
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

/// Reads the episodes of a recording one after the other.
///
/// It is an iterator. Episodes are returned only after their checksum and their values were checked. It ends after
/// the first error.
///
/// ```no_run
/// # use bevy_playbot::demo::file::{DemoFileError, DemoReader};
/// # fn main() -> Result<(), DemoFileError> {
/// let mut reader = DemoReader::open("demos/coinrun/easy.demo")?;
/// let game = reader.header().game.clone();
/// for episode in reader.by_ref() {
///     let episode = episode?;
///     assert_eq!(episode.rewards.len(), episode.len(), "{game}");
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct DemoReader {
    path: PathBuf,
    header: DemoHeader,
    input: BufReader<File>,
    /// Byte offset of the next frame.
    offset: u64,
    /// Length of the file when it was opened; frames beyond it are invalid.
    length: u64,
    episodes: usize,
    done: bool,
}

impl DemoReader {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or its header is invalid: see [`DemoFault`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, DemoFileError> {
        let path = path.as_ref();
        File::open(path)
            .map_err(DemoFault::io("open the file"))
            .and_then(|file| Self::from_file(path, file))
            .map_err(|fault| DemoFileError::new(path, fault))
    }

    /// Reads from a file that stands at its beginning.
    pub(super) fn from_file(path: &Path, file: File) -> Result<Self, DemoFault> {
        let metadata = file.metadata();
        let length = metadata.map_err(DemoFault::io("open the file"))?.len();
        let mut input = BufReader::new(file);
        let (header, offset) = preamble::decode(&mut input)?;
        // The preamble was read exactly; the seek makes that independent of buffering.
        input.seek(SeekFrom::Start(offset)).map_err(DemoFault::io("read the first frame"))?;
        Ok(Self { path: path.to_owned(), header, input, offset, length, episodes: 0, done: false })
    }

    /// Opens a file that must be a recording of the given game, version and mode (`None`: any mode).
    ///
    /// # Errors
    ///
    /// Those of [`open`](Self::open) and of [`DemoHeader::check_game`].
    pub fn open_for_game(
        path: impl AsRef<Path>,
        game: &str,
        game_version: u32,
        mode: Option<&str>,
    ) -> Result<Self, DemoFileError> {
        let reader = Self::open(path)?;
        match reader.header.check_game(game, game_version, mode) {
            Ok(()) => Ok(reader),
            Err(fault) => Err(DemoFileError::new(&reader.path, fault)),
        }
    }

    /// Returns the header of the file.
    pub fn header(&self) -> &DemoHeader {
        &self.header
    }

    /// Returns the path the file was opened with.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the byte offset of the next frame: everything before it was read and is intact.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Returns the length of the file in bytes, when it was opened.
    pub fn file_length(&self) -> u64 {
        self.length
    }

    /// Returns the number of episodes read so far.
    pub fn episodes_read(&self) -> usize {
        self.episodes
    }

    /// Reads all remaining episodes.
    ///
    /// # Errors
    ///
    /// The first error in the file; use the iterator to keep the episodes before it.
    pub fn read_all(self) -> Result<Vec<DemoEpisode>, DemoFileError> {
        self.collect()
    }

    fn next_episode(&mut self) -> Result<Option<DemoEpisode>, DemoFault> {
        let (offset, episode) = (self.offset, self.episodes);
        let left = self.length.saturating_sub(offset);
        if left == 0 {
            return Ok(None);
        }
        let cut = |missing| DemoFault::TruncatedFrame { offset, episode, missing };
        let head = self.read(left.min(FRAME_HEAD as u64))?;
        let magic = &head[..head.len().min(bytes::FRAME_MAGIC.len())];
        if !bytes::FRAME_MAGIC.starts_with(magic) {
            return Err(DemoFault::BadFrameMagic { offset, episode });
        }
        let Some(length) = bytes::payload_length(&head) else {
            return Err(cut(FRAME_EXTRA as u64 - head.len() as u64));
        };
        let size = (length + FRAME_EXTRA) as u64;
        if size > left {
            return Err(cut(size - left));
        }
        if length > MAX_PAYLOAD {
            return Err(DemoFault::FrameChecksum { offset, episode });
        }
        let mut bytes = head;
        bytes.extend(self.read(size - FRAME_HEAD as u64)?);
        if (bytes.len() as u64) < size {
            return Err(cut(size - bytes.len() as u64));
        }
        let payload = bytes::payload(&bytes).ok_or(DemoFault::FrameChecksum { offset, episode })?;
        let decoded =
            bytes::decode(payload, &self.header).map_err(|fault| DemoFault::BadEpisode { offset, episode, fault })?;
        self.offset += size;
        self.episodes += 1;
        Ok(Some(decoded))
    }

    fn read(&mut self, length: u64) -> Result<Vec<u8>, DemoFault> {
        let mut bytes = Vec::with_capacity(length as usize);
        self.input.by_ref().take(length).read_to_end(&mut bytes).map_err(DemoFault::io("read a frame"))?;
        Ok(bytes)
    }
}

impl Iterator for DemoReader {
    type Item = Result<DemoEpisode, DemoFileError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let next = self.next_episode().map_err(|fault| DemoFileError::new(&self.path, fault)).transpose();
        self.done = !matches!(next, Some(Ok(_)));
        next
    }
}

impl std::iter::FusedIterator for DemoReader {}
