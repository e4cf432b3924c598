//! The arrays of a step, and the memory that both sides read and write: a file, or the bytes of messages.
//!
//! ```
//! use bevy_playbot::action::ActionSpace;
//! use playbot_bridge::arrays::Layout;
//! use playbot_learner::ObsKind;
//!
//! let layout = Layout::new(2, &ActionSpace::Discrete(3), &ObsKind::Vector(4), false);
//! let names: Vec<&str> = layout.results.iter().map(|array| array.name).collect();
//! assert_eq!(names, ["observations", "rewards", "terminated", "truncated", "success", "level", "tick", "legal"]);
//! assert_eq!(layout.actions[0].shape, [2]);
//! assert_eq!(layout.results[0].shape, [2, 4]);
//! ```

use bevy_playbot::action::{ActionSpace, MixedSpace};
use playbot_learner::ObsKind;
#[cfg(unix)]
use playbot_learner::disk::{self, DiskFile};
use serde::Serialize;
#[cfg(unix)]
use std::{fs::OpenOptions, path::Path};
use std::{
    io,
    path::PathBuf,
    sync::{Mutex, MutexGuard, PoisonError},
};
use thiserror::Error;
#[cfg(unix)]
use vm_memory::{Bytes, FileOffset, VolatileMemory, mmap::MmapRegion};

/// Type of the numbers of an array, in the byte order of x86 and ARM: the lowest byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Number {
    /// Bytes: pixels, and 0 or 1 for false and true.
    U8,
    /// Whole numbers of 32 bits with a sign.
    I32,
    /// Whole numbers of 32 bits.
    U32,
    /// Whole numbers of 64 bits.
    U64,
    /// Floating-point numbers of 32 bits.
    F32,
}

impl Number {
    /// Returns the bytes of a number.
    pub fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::U64 => 8,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::U64 => "u64",
            Self::F32 => "f32",
        }
    }
}

/// An array: one row per agent, in the order of their numbers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Array {
    /// Name of the array.
    pub name: &'static str,
    /// Type of its numbers.
    pub dtype: Number,
    /// Its lengths; the first is the number of agents.
    pub shape: Vec<usize>,
    /// Place of its first byte: from the beginning of the actions, or of the results.
    pub offset: usize,
}

impl Array {
    /// Returns the bytes of a row.
    pub fn row(&self) -> usize {
        self.dtype.size() * self.shape[1..].iter().product::<usize>()
    }

    /// Returns the bytes of the array.
    pub fn len(&self) -> usize {
        self.dtype.size() * self.shape.iter().product::<usize>()
    }

    /// Returns whether it has no numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Arrays begin at multiples of so many bytes: lines of processors' caches.
const ALIGNED: usize = 64;

/// Bytes before the actions in shared memory: the head.
pub const HEAD: usize = 4096;

/// Places for results in shared memory, used in turn: the results of a step stay until the second step after it.
pub const SLOTS: usize = 2;

/// The arrays of a game with so many agents.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Layout {
    /// What the client writes before a step: `actions`, or `choices` and `numbers` where agents have both.
    pub actions: Vec<Array>,
    /// Bytes of all actions.
    pub action_bytes: usize,
    /// What it reads after a step.
    pub results: Vec<Array>,
    /// Bytes of the results of a step.
    pub result_bytes: usize,
}

impl Layout {
    /// Lays out the arrays of `agents` with these actions and observations. With `finals` the last observations of
    /// episodes have an array of their own, since those of the next episodes are in the place of `observations`.
    pub fn new(agents: usize, space: &ActionSpace, observation: &ObsKind, finals: bool) -> Self {
        let seen = match observation {
            ObsKind::Vector(numbers) => (Number::F32, vec![*numbers]),
            ObsKind::Image(shape) => (Number::U8, vec![shape.channels, shape.height, shape.width]),
        };
        let mut results = vec![
            (OBSERVATIONS, seen.0, seen.1.clone()),
            (REWARDS, Number::F32, vec![]),
            (TERMINATED, Number::U8, vec![]),
            (TRUNCATED, Number::U8, vec![]),
            (SUCCESS, Number::U8, vec![]),
            (LEVEL, Number::U64, vec![]),
            (TICK, Number::U32, vec![]),
        ];
        if space.mask_width() > 0 {
            results.push((LEGAL, Number::U8, vec![space.mask_width()]));
        }
        if finals {
            results.push((FINAL_OBSERVATIONS, seen.0, seen.1));
        }
        let (actions, action_bytes) = placed(agents, action_arrays(space));
        let (results, result_bytes) = placed(agents, results);
        Self { actions, action_bytes, results, result_bytes }
    }

    /// Returns an array of the results.
    pub fn result(&self, name: &str) -> Option<&Array> {
        self.results.iter().find(|array| array.name == name)
    }

    /// Returns the bytes of shared memory: the head, the actions, and [`SLOTS`] results.
    pub fn bytes(&self) -> usize {
        HEAD + self.action_bytes + SLOTS * self.result_bytes
    }

    /// Returns the CRC-32 (IEEE) of the layout in words: a line for each array, actions first, with its name, its type, its
    /// lengths separated by `x`, its place, and a line end, such as `rewards f32 64 1024`. A client that makes the same
    /// lines has understood the layout.
    pub fn checksum(&self) -> u32 {
        let line = |array: &Array| {
            let lengths: Vec<String> = array.shape.iter().map(usize::to_string).collect();
            format!("{} {} {} {}\n", array.name, array.dtype.name(), lengths.join("x"), array.offset)
        };
        let lines: String = self.actions.iter().chain(&self.results).map(line).collect();
        crc32fast::hash(lines.as_bytes())
    }
}

pub(crate) const OBSERVATIONS: &str = "observations";
pub(crate) const REWARDS: &str = "rewards";
pub(crate) const TERMINATED: &str = "terminated";
pub(crate) const TRUNCATED: &str = "truncated";
pub(crate) const SUCCESS: &str = "success";
pub(crate) const LEVEL: &str = "level";
pub(crate) const TICK: &str = "tick";
pub(crate) const LEGAL: &str = "legal";
pub(crate) const FINAL_OBSERVATIONS: &str = "final_observations";

/// Name, numbers, and the lengths of a row.
type Row = (&'static str, Number, Vec<usize>);

fn action_arrays(space: &ActionSpace) -> Vec<Row> {
    match *space {
        ActionSpace::Discrete(_) => vec![("actions", Number::I32, vec![])],
        ActionSpace::Continuous(numbers) => vec![("actions", Number::F32, vec![numbers])],
        ActionSpace::Mixed(MixedSpace { choices, numbers, .. }) => {
            let choices = ("choices", Number::I32, vec![choices.sizes().len()]);
            let numbers = (numbers > 0).then_some(("numbers", Number::F32, vec![numbers]));
            [choices].into_iter().chain(numbers).collect()
        }
    }
}

fn placed(agents: usize, rows: Vec<Row>) -> (Vec<Array>, usize) {
    let mut offset: usize = 0;
    let mut arrays = Vec::new();
    for (name, dtype, lengths) in rows {
        let shape = [vec![agents], lengths].concat();
        let array = Array { name, dtype, shape, offset };
        offset = (offset + array.len()).next_multiple_of(ALIGNED);
        arrays.push(array);
    }
    (arrays, offset)
}

// The memory that holds the arrays: a file that both sides map or read, or the bytes of messages.

/// First bytes of shared memory.
pub const MAGIC: &[u8; 8] = b"PLAYBOT\0";

/// The arrays of a conversation.
#[derive(Debug)]
pub struct Memory {
    layout: Layout,
    place: Place,
}

#[derive(Debug)]
enum Place {
    /// A file in memory, which the client has mapped.
    #[cfg(unix)]
    Shared(SharedFile),
    /// The bytes of the next message.
    Message { actions: Mutex<Vec<u8>>, results: Mutex<Vec<u8>> },
}

/// Shared memory could not be made.
#[derive(Debug, Error)]
#[error("{}: no shared memory of {} KiB can be made there: {source}; make room, take fewer arenas, or let the arrays go \
         through the socket with `--transport unix`", path.display(), bytes.div_ceil(1024))]
pub struct SharedMemoryError {
    path: PathBuf,
    bytes: usize,
    source: io::Error,
}

impl Memory {
    /// Makes the memory of arrays that go through messages.
    pub fn of_messages(layout: Layout) -> Self {
        let zeros = |bytes| Mutex::new(vec![0; bytes]);
        let place = Place::Message { actions: zeros(layout.action_bytes), results: zeros(layout.result_bytes) };
        Self { layout, place }
    }

    /// Makes a file in memory for the arrays, which begins with a head: [`MAGIC`], then as whole numbers of 32 bits the
    /// version of the protocol, the [checksum](Layout::checksum), and the places of actions and of results, the bytes of one
    /// result, and the number of results. It is filled with zeros, so that all of its memory is there.
    ///
    /// # Errors
    ///
    /// There is no room for it.
    #[cfg(unix)]
    pub fn shared(layout: Layout, protocol: u32) -> Result<Self, SharedMemoryError> {
        let file = SharedFile::new_in(&folder(), &layout, protocol)?;
        Ok(Self { layout, place: Place::Shared(file) })
    }

    /// Returns where the arrays lie.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the path of shared memory, until it is [taken](Self::forget_path).
    pub fn path(&self) -> Option<PathBuf> {
        match &self.place {
            #[cfg(unix)]
            Place::Shared(file) => lock(&file.path).clone(),
            Place::Message { .. } => None,
        }
    }

    /// Takes the path of shared memory away, once the client has it open. Whatever happens now, nothing is left behind.
    pub fn forget_path(&self) {
        #[cfg(unix)]
        if let Place::Shared(file) = &self.place {
            file.unlink();
        }
    }

    /// Returns whether arrays lie in shared memory.
    pub fn is_shared(&self) -> bool {
        !matches!(self.place, Place::Message { .. })
    }

    /// Takes the actions of a message. Shared memory has them already.
    pub fn take_actions(&self, bytes: &[u8]) {
        match &self.place {
            #[cfg(unix)]
            Place::Shared(_) => {}
            Place::Message { actions, .. } => lock(actions).copy_from_slice(bytes),
        }
    }

    /// Returns the actions.
    ///
    /// # Errors
    ///
    /// The file cannot be read.
    pub fn actions(&self) -> io::Result<Vec<u8>> {
        match &self.place {
            #[cfg(unix)]
            Place::Shared(file) => {
                let mut bytes = vec![0; self.layout.action_bytes];
                file.read(HEAD, &mut bytes)?;
                Ok(bytes)
            }
            Place::Message { actions, .. } => Ok(lock(actions).clone()),
        }
    }

    /// Writes a part of the results into one of the [`SLOTS`].
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn write(&self, slot: usize, offset: usize, bytes: &[u8]) -> io::Result<()> {
        // Only a file has several places for results.
        #[cfg_attr(not(unix), expect(unused_variables, reason = "there are no such files"))]
        let in_file = HEAD + self.layout.action_bytes + slot * self.layout.result_bytes + offset;
        match &self.place {
            #[cfg(unix)]
            Place::Shared(file) => file.write(in_file, bytes),
            Place::Message { results, .. } => {
                lock(results)[offset..offset + bytes.len()].copy_from_slice(bytes);
                Ok(())
            }
        }
    }

    /// Calls `send` with the results of a message; with nothing if they lie in shared memory.
    pub fn with_results<T>(&self, send: impl FnOnce(&[u8]) -> T) -> T {
        match &self.place {
            #[cfg(unix)]
            Place::Shared(_) => send(&[]),
            Place::Message { results, .. } => send(&lock(results)),
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the folder of files in memory, or that of temporary files where there is none.
#[cfg(unix)]
fn folder() -> PathBuf {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() }
}

/// A file that is removed at the end, or as soon as the client has opened it.
#[cfg(unix)]
#[derive(Debug)]
struct SharedFile {
    /// Kept open: its path may lead through this process.
    _file: DiskFile,
    mapped: MmapRegion,
    path: Mutex<Option<PathBuf>>,
}

#[cfg(unix)]
impl SharedFile {
    fn new_in(folder: &Path, layout: &Layout, protocol: u32) -> Result<Self, SharedMemoryError> {
        use std::os::unix::fs::OpenOptionsExt;
        let bytes = layout.bytes();
        let mut number = 0;
        let (path, opened) = loop {
            let path = folder.join(format!("playbot-{}-{number}", std::process::id()));
            let mut options = OpenOptions::new();
            options.read(true).write(true).create_new(true).mode(0o600);
            match DiskFile::open(&path, &options) {
                // Left by a program of the same number that was killed before its client came.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists && number < 1000 => number += 1,
                opened => break (path, opened),
            }
        };
        let refused = |source| SharedMemoryError { path: path.clone(), bytes, source };
        let file = opened.map_err(refused)?;
        let zeros = vec![0; 1 << 16];
        for at in (0..bytes).step_by(zeros.len()) {
            let piece = &zeros[..zeros.len().min(bytes - at)];
            // Where memory is full, this is refused. A mapping would end the program.
            std::os::unix::fs::FileExt::write_all_at(file.as_file(), piece, at as u64).map_err(refused)?;
        }
        let mapped = file.as_file().try_clone().map(|file| MmapRegion::from_file(FileOffset::new(file, 0), bytes));
        let mapped = mapped.map_err(refused)?.map_err(|error| refused(io::Error::other(error)))?;
        let shown = Some(nameless(&file, &path).unwrap_or_else(|| path.clone()));
        let shared = Self { _file: file, mapped, path: Mutex::new(shown) };
        let head = [
            protocol,
            layout.checksum(),
            HEAD as u32,
            (HEAD + layout.action_bytes) as u32,
            layout.result_bytes as u32,
            SLOTS as u32,
        ];
        let head: Vec<u8> = MAGIC.iter().copied().chain(head.into_iter().flat_map(u32::to_le_bytes)).collect();
        shared.write(0, &head).map_err(refused)?;
        Ok(shared)
    }

    fn read(&self, at: usize, bytes: &mut [u8]) -> io::Result<()> {
        self.mapped.as_volatile_slice().read_slice(bytes, at).map_err(io::Error::other)
    }

    fn write(&self, at: usize, bytes: &[u8]) -> io::Result<()> {
        self.mapped.as_volatile_slice().write_slice(bytes, at).map_err(io::Error::other)
    }

    fn unlink(&self) {
        // A file without a name has none to lose.
        if let Some(path) = lock(&self.path).take().filter(|path| !path.starts_with("/proc")) {
            // Somebody else may have removed it.
            let _ = disk::remove_file(&path);
        }
    }
}

/// Takes the name of a new file away, and returns the path by which it can be opened all the same, through this process. So
/// nothing is left of it even if the process is killed. `None` where there is no such path: the file keeps its name.
#[cfg(unix)]
fn nameless(file: &DiskFile, path: &Path) -> Option<PathBuf> {
    use std::os::fd::AsRawFd;
    let shown = PathBuf::from(format!("/proc/{}/fd/{}", std::process::id(), file.as_file().as_raw_fd()));
    (shown.exists() && disk::remove_file(path).is_ok()).then_some(shown)
}

#[cfg(unix)]
impl Drop for SharedFile {
    fn drop(&mut self) {
        self.unlink();
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use playbot_learner::{Choices, ImageShape};

    #[test]
    fn arrays_begin_at_lines_of_the_cache_and_do_not_overlap() {
        let pixels = ObsKind::Image(ImageShape { channels: 3, height: 5, width: 7 });
        let choices = Choices::new(&[3, 2]).expect("two choices");
        let mixed = ActionSpace::Mixed(MixedSpace { choices, numbers: 2 });
        for layout in [
            Layout::new(3, &mixed, &pixels, true),
            Layout::new(1, &ActionSpace::Continuous(8), &ObsKind::Vector(29), false),
        ] {
            for (arrays, bytes) in [(&layout.actions, layout.action_bytes), (&layout.results, layout.result_bytes)] {
                let mut end = 0;
                for array in arrays {
                    assert!(array.offset >= end && array.offset.is_multiple_of(ALIGNED), "{array:?}");
                    end = array.offset + array.len();
                }
                assert!(end <= bytes && bytes.is_multiple_of(ALIGNED));
            }
        }
        let layout = Layout::new(3, &mixed, &pixels, true);
        let shapes: Vec<_> = layout.actions.iter().map(|array| (array.name, array.shape.clone())).collect();
        assert_eq!(shapes, [("choices", vec![3, 2]), ("numbers", vec![3, 2])]);
        assert_eq!(
            layout.result(LEGAL).map(|array| array.shape.clone()),
            Some(vec![3, 6]),
            "five options, and whether numbers count"
        );
        assert_eq!(layout.result(FINAL_OBSERVATIONS).map(Array::row), Some(105));
        assert_eq!(Layout::new(3, &mixed, &pixels, false).result(FINAL_OBSERVATIONS), None);
    }

    #[test]
    fn the_checksum_is_that_of_the_lines() {
        let layout = Layout::new(2, &ActionSpace::Discrete(3), &ObsKind::Vector(4), false);
        let lines = "actions i32 2 0\nobservations f32 2x4 0\nrewards f32 2 64\nterminated u8 2 128\ntruncated u8 2 192\n\
                     success u8 2 256\nlevel u64 2 320\ntick u32 2 384\nlegal u8 2x3 448\n";
        assert_eq!(layout.checksum(), crc32fast::hash(lines.as_bytes()));
        let other = Layout::new(3, &ActionSpace::Discrete(3), &ObsKind::Vector(4), false);
        assert_ne!(layout.checksum(), other.checksum());
    }

    fn layout() -> Layout {
        Layout::new(2, &ActionSpace::Discrete(3), &ObsKind::Vector(2), false)
    }

    #[cfg(unix)]
    #[test]
    fn shared_memory_has_a_head_and_is_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = SharedFile::new_in(folder.path(), &layout(), 7).expect("room");
        let path = lock(&file.path).clone().expect("a path");
        let bytes = fs::read(&path).expect("readable");
        assert_eq!(bytes.len(), layout().bytes());
        assert_eq!((&bytes[..8], &bytes[8..12]), (&MAGIC[..], &[7, 0, 0, 0][..]));
        assert_eq!(bytes[12..16], layout().checksum().to_le_bytes());
        let memory = Memory { layout: layout(), place: Place::Shared(file) };
        let second = memory.layout.result("rewards").expect("rewards").offset + 4;
        memory.write(1, second, &1.5_f32.to_le_bytes()).expect("room");
        let at = HEAD + memory.layout.action_bytes + memory.layout.result_bytes + second;
        assert_eq!(fs::read(&path).expect("readable")[at..at + 4], 1.5_f32.to_le_bytes());
        memory.forget_path();
        assert!(memory.path().is_none() && names_in(folder.path()).is_empty());
        memory.write(0, 0, &[1]).expect("still open");
        let other = SharedFile::new_in(folder.path(), &layout(), 7).expect("room");
        if cfg!(target_os = "linux") {
            assert_eq!(names_in(folder.path()), Vec::<String>::new(), "not even while it is used");
        }
        drop(other);
        assert!(names_in(folder.path()).is_empty());
    }

    fn names_in(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).expect("a folder").flatten();
        names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
    }

    #[cfg(unix)]
    #[test]
    fn two_memories_of_a_program_have_two_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let of = || SharedFile::new_in(folder.path(), &layout(), 1).expect("room");
        let (one, other) = (of(), of());
        assert_ne!(*lock(&one.path), *lock(&other.path));
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_without_room_is_named_with_what_to_do() {
        let missing = Path::new("/nonexistent/shm");
        let error = SharedFile::new_in(missing, &layout(), 1).expect_err("no folder").to_string();
        assert!(error.contains("/nonexistent/shm/playbot-") && error.contains("--transport unix"), "{error}");
    }

    #[test]
    fn messages_hold_actions_and_results() {
        let memory = Memory::of_messages(layout());
        let actions: Vec<u8> = (0..64).collect();
        memory.take_actions(&actions);
        assert_eq!(memory.actions().expect("no file"), actions);
        memory.write(1, 3, &[9]).expect("no file");
        assert_eq!(memory.with_results(<[u8]>::to_vec)[3], 9);
        assert!(!memory.is_shared() && memory.path().is_none());
    }
}
