//! The writer of recordings, one whole episode at a time.

use crate::demo::file::{
    bytes,
    episode::DemoEpisode,
    error::{DemoFault, DemoFileError},
    header::DemoHeader,
    preamble,
    reader::DemoReader,
};
use playbot_learner::disk::{DiskFile, remove_file, temporary_name};
use std::{
    fs,
    fs::{File, OpenOptions, TryLockError},
    io,
    io::{Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// Appends episodes to a recording.
///
/// Each [`push`](Self::push) writes one frame with a single write and waits until it is on the disk. A crash loses at
/// most the episode that is being written. While a writer lives, the file is locked against other writers.
pub struct DemoWriter {
    path: PathBuf,
    header: DemoHeader,
    store: Box<dyn Store>,
    /// Length of the file up to the last whole frame.
    length: u64,
    episodes: usize,
    torn: bool,
}

impl std::fmt::Debug for DemoWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DemoWriter")
            .field("path", &self.path)
            .field("length", &self.length)
            .field("episodes", &self.episodes)
            .finish_non_exhaustive()
    }
}

impl DemoWriter {
    /// Creates a file and writes its header.
    ///
    /// # Errors
    ///
    /// [`DemoFault::Exists`] when there is a file already (it stays unchanged), [`DemoFault::HeaderValue`] for a
    /// header that could not be read back, or [`DemoFault::Io`].
    pub fn create(path: impl AsRef<Path>, header: DemoHeader) -> Result<Self, DemoFileError> {
        let path = path.as_ref();
        Self::start(path, header, OpenOptions::new().write(true).create_new(true)).inspect_err(|error| {
            // A file without a header would block the next attempt.
            if matches!(error.fault, DemoFault::Io { action: "write the header", .. }) {
                let _ = remove_file(path);
            }
        })
    }

    /// Replaces a file that exists, and loses its episodes; otherwise like [`create`](Self::create). The old file
    /// stays until the header of the new one is on the disk.
    ///
    /// # Errors
    ///
    /// Those of [`create`](Self::create) except [`DemoFault::Exists`], and [`DemoFault::Locked`] while
    /// another program records to the file.
    pub fn replace(path: impl AsRef<Path>, header: DemoHeader) -> Result<Self, DemoFileError> {
        let path = path.as_ref();
        match fs::canonicalize(path) {
            // A link stays a link: its target is replaced.
            Ok(old) if old.is_file() => Self::start_in_place_of(&old, path, header),
            // Devices and pipes hold no data to lose.
            _ => Self::start(path, header, OpenOptions::new().write(true).create(true).truncate(false)),
        }
    }

    /// Starts under a temporary name, and takes that of the old file when the header is on the disk. So one of the
    /// two files always exists.
    fn start_in_place_of(old: &Path, path: &Path, header: DemoHeader) -> Result<Self, DemoFileError> {
        let fresh = temporary_name(old);
        let attempt = || {
            let bytes = preamble::encode(&header)?;
            let replaced = DiskFile::open(old, OpenOptions::new().write(true));
            let replaced = replaced.map_err(DemoFault::io("create the file"))?;
            lock(replaced.as_file())?;
            let mut file = DiskFile::create(&fresh).map_err(DemoFault::io("create the file"))?;
            lock(file.as_file())?;
            let written = file.write_all(&bytes).and_then(|()| Store::sync(&mut file));
            written.and_then(|()| file.rename_to(old)).map_err(DemoFault::io("write the header"))?;
            Ok((file, bytes.len() as u64))
        };
        let started = attempt().map_err(|fault: DemoFault| DemoFileError::new(path, fault));
        let (file, length) = started.inspect_err(|error| {
            if matches!(error.fault, DemoFault::Io { action: "write the header", .. }) {
                let _ = remove_file(&fresh);
            }
        })?;
        Ok(Self { path: path.to_owned(), header, store: Box::new(file), length, episodes: 0, torn: false })
    }

    fn start(path: &Path, header: DemoHeader, options: &OpenOptions) -> Result<Self, DemoFileError> {
        let attempt = || {
            let bytes = preamble::encode(&header)?;
            let mut file = DiskFile::open(path, options).map_err(|source| match source.kind() {
                io::ErrorKind::AlreadyExists => DemoFault::Exists,
                _ => DemoFault::Io { action: "create the file", source },
            })?;
            lock(file.as_file())?;
            if file.as_file().metadata().is_ok_and(|m| m.len() > 0) {
                file.set_len(0).map_err(DemoFault::io("empty the file"))?;
            }
            file.write_all(&bytes).and_then(|()| Store::sync(&mut file)).map_err(DemoFault::io("write the header"))?;
            Ok((file, bytes.len() as u64))
        };
        let (file, length) = attempt().map_err(|fault: DemoFault| DemoFileError::new(path, fault))?;
        Ok(Self { path: path.to_owned(), header, store: Box::new(file), length, episodes: 0, torn: false })
    }

    /// [Appends](Self::append) to the file if there is one, and else [creates](Self::create) it.
    ///
    /// # Errors
    ///
    /// Those of both.
    pub fn append_or_create(path: impl AsRef<Path>, header: DemoHeader) -> Result<Self, DemoFileError> {
        let path = path.as_ref();
        if path.exists() { Self::append(path, &header) } else { Self::create(path, header) }
    }

    /// Opens an existing file to record more episodes under the same conditions.
    ///
    /// The whole file is read and checked first. The header of the file stays as it is.
    ///
    /// # Errors
    ///
    /// [`DemoFault::HeaderDiffers`] when `header` is not that of the file (only the note may differ),
    /// [`DemoFault::Locked`], or an error of [`DemoReader`]: repair a damaged file first, see
    /// [`repair`](crate::demo::file::repair::repair).
    pub fn append(path: impl AsRef<Path>, header: &DemoHeader) -> Result<Self, DemoFileError> {
        let path = path.as_ref();
        let fault = |fault| DemoFileError::new(path, fault);
        let open = || {
            let file = DiskFile::open(path, OpenOptions::new().read(true).write(true));
            let file = file.map_err(DemoFault::io("open the file"))?;
            lock(file.as_file())?;
            let same_file = file.as_file().try_clone().map_err(DemoFault::io("open the file"))?;
            Ok((file, DemoReader::from_file(path, same_file)?))
        };
        // The reader shares the handle: a lock may keep others from reading.
        let (mut file, mut reader) = open().map_err(fault)?;
        reader.header().check_append(header).map_err(fault)?;
        for episode in reader.by_ref() {
            episode?;
        }
        file.seek(SeekFrom::Start(reader.offset())).map_err(|source| fault(DemoFault::io("open the file")(source)))?;
        Ok(Self {
            path: path.to_owned(),
            header: reader.header().clone(),
            store: Box::new(file),
            length: reader.offset(),
            episodes: reader.episodes_read(),
            torn: false,
        })
    }

    /// Appends one episode and waits until it is on the disk.
    ///
    /// # Errors
    ///
    /// [`DemoFault::RefusedEpisode`] when [`DemoEpisode::check`] fails: nothing is written. [`DemoFault::PushFailed`]
    /// when the disk is full or fails: the file then ends with the episode before this one, and `push` may be tried
    /// again. [`DemoFault::PushTorn`] when the file could not be restored, and [`DemoFault::Torn`] from then on.
    pub fn push(&mut self, episode: &DemoEpisode) -> Result<(), DemoFileError> {
        self.push_inner(episode).map_err(|fault| DemoFileError::new(&self.path, fault))
    }

    fn push_inner(&mut self, episode: &DemoEpisode) -> Result<(), DemoFault> {
        if self.torn {
            return Err(DemoFault::Torn);
        }
        let bytes = bytes::encode(episode, &self.header).map_err(DemoFault::RefusedEpisode)?;
        let written = self.store.write_all(&bytes).and_then(|()| self.store.sync());
        let Err(source) = written else {
            self.length += bytes.len() as u64;
            self.episodes += 1;
            return Ok(());
        };
        let episode = self.episodes;
        match self.store.cut(self.length) {
            Ok(()) => Err(DemoFault::PushFailed { episode, source }),
            Err(cleanup) => {
                self.torn = true;
                Err(DemoFault::PushTorn { episode, source, cleanup })
            }
        }
    }

    /// Returns the header of the file.
    pub fn header(&self) -> &DemoHeader {
        &self.header
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the number of episodes in the file.
    pub fn episodes(&self) -> usize {
        self.episodes
    }

    /// Returns the length of the file in bytes.
    pub fn bytes(&self) -> u64 {
        self.length
    }
}

/// The file operations of the writer; tests substitute a disk that fills up.
pub(super) trait Store: Write + Send + Sync {
    fn sync(&mut self) -> io::Result<()>;
    fn cut(&mut self, length: u64) -> io::Result<()>;
}

impl Store for DiskFile {
    fn sync(&mut self) -> io::Result<()> {
        match DiskFile::sync(self) {
            // Devices and pipes cannot be synchronised, and need not be.
            Err(e) if e.kind() == io::ErrorKind::InvalidInput => Ok(()),
            other => other,
        }
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)?;
        self.seek(SeekFrom::Start(length)).map(drop)
    }
}

/// Locks the file against other writers, where the file system can.
pub(super) fn lock(file: &File) -> Result<(), DemoFault> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(DemoFault::Locked),
        // File systems without locks are used without them.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

#[cfg(test)]
pub(super) mod store_tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    /// A disk with limited room.
    #[derive(Clone)]
    pub(in crate::demo::file) struct SmallDisk {
        pub bytes: Arc<Mutex<Vec<u8>>>,
        pub room: usize,
        pub can_cut: bool,
    }

    impl Write for SmallDisk {
        fn write(&mut self, data: &[u8]) -> io::Result<usize> {
            let mut bytes = self.bytes.lock().expect("one thread");
            let fits = data.len().min(self.room - bytes.len());
            bytes.extend_from_slice(&data[..fits]);
            if fits == 0 { Err(io::ErrorKind::StorageFull.into()) } else { Ok(fits) }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Store for SmallDisk {
        fn sync(&mut self) -> io::Result<()> {
            Ok(())
        }

        fn cut(&mut self, length: u64) -> io::Result<()> {
            if !self.can_cut {
                return Err(io::ErrorKind::PermissionDenied.into());
            }
            self.bytes.lock().expect("one thread").truncate(length as usize);
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::action::ActionSpace;
    use crate::demo::file::testing::{episode, header};
    use crate::demo::file::writer::store_tests::SmallDisk;

    fn on_small_disk(can_cut: bool) -> (DemoWriter, Arc<Mutex<Vec<u8>>>) {
        let preamble = preamble::encode(&header()).expect("valid");
        let length = preamble.len() as u64;
        let frame = bytes::encode(&episode(1, 20), &header()).expect("valid").len();
        let disk =
            SmallDisk { room: preamble.len() + frame + frame / 2, bytes: Arc::new(Mutex::new(preamble)), can_cut };
        let bytes = disk.bytes.clone();
        let path = PathBuf::from("small.demo");
        let writer = DemoWriter { path, header: header(), store: Box::new(disk), length, episodes: 0, torn: false };
        (writer, bytes)
    }

    #[test]
    fn a_full_disk_keeps_the_episodes_before() {
        let (mut writer, bytes) = on_small_disk(true);
        writer.push(&episode(1, 20)).expect("room for one");
        let error = writer.push(&episode(2, 20)).expect_err("full");
        assert!(matches!(error.fault, DemoFault::PushFailed { episode: 1, .. }), "{error}");
        assert!(error.to_string().contains("the 1 episodes before it are kept"), "{error}");
        assert_eq!(bytes.lock().expect("one thread").len() as u64, writer.bytes());
        // A shorter episode still fits.
        writer.push(&episode(3, 2)).expect("room for a short one");
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("small.demo");
        std::fs::write(&path, &*bytes.lock().expect("one thread")).expect("written");
        let seeds: Vec<u64> = DemoReader::open(&path)
            .and_then(DemoReader::read_all)
            .expect("sound")
            .iter()
            .map(|e| e.level_seed)
            .collect();
        assert_eq!(seeds, [1, 3]);
    }

    #[test]
    fn remains_that_stay_stop_the_writer() {
        let (mut writer, _) = on_small_disk(false);
        writer.push(&episode(1, 20)).expect("room for one");
        let error = writer.push(&episode(2, 20)).expect_err("full");
        assert!(matches!(error.fault, DemoFault::PushTorn { episode: 1, .. }), "{error}");
        assert!(error.to_string().contains("playbot demo repair ") && !error.to_string().contains("FILE"), "{error}");
        assert!(matches!(writer.push(&episode(3, 2)), Err(DemoFileError { fault: DemoFault::Torn, .. })));
    }

    #[test]
    fn a_refused_episode_leaves_no_trace() {
        let (mut writer, bytes) = on_small_disk(true);
        let mut bad = episode(1, 3);
        bad.rewards[1] = f32::NAN;
        assert!(matches!(writer.push(&bad), Err(DemoFileError { fault: DemoFault::RefusedEpisode(_), .. })));
        assert_eq!(bytes.lock().expect("one thread").len() as u64, writer.bytes());
        let foreign = DemoEpisode::new(1, ActionSpace::Continuous(2));
        assert!(writer.push(&foreign).is_err());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn dev_full_is_a_full_disk() {
        let error = DemoWriter::replace("/dev/full", header()).expect_err("full");
        assert!(error.to_string().contains("cannot write the header: No space left on device"), "{error}");
        assert!(Path::new("/dev/full").exists());
        let (mut writer, _) = on_small_disk(true);
        writer.store = {
            let full = DiskFile::open(Path::new("/dev/full"), OpenOptions::new().write(true));
            Box::new(full.expect("opens"))
        };
        let error = writer.push(&episode(1, 5)).expect_err("full");
        assert!(error.to_string().contains("No space left on device"), "{error}");
    }
}
