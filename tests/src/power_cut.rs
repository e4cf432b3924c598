//! Disks after a power cut, made from a program's [operations](playbot_learner::disk::DiskRecording).
//!
//! The model is that of today's file systems with a journal. Names and folders change in the order in which the program
//! changed them. The bytes of a file are sure only once they were brought to the disk. Until then they may be there, be
//! gone, or be there in part.

use std::{
    collections::{BTreeMap, HashSet},
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
};

use playbot_learner::disk::DiskOperation;

/// The fate of bytes that the program had written and not brought to the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsynced {
    /// They are all there: as after a kill.
    Kept,
    /// They are gone.
    Lost,
    /// Half of them are there.
    Halved,
}

const WAYS: [Unsynced; 3] = [Unsynced::Kept, Unsynced::Lost, Unsynced::Halved];

/// The time of the power cut.
#[derive(Clone, Copy, Debug)]
pub struct PowerCut {
    /// Operations that were begun.
    pub operations: usize,
    /// Eighths of the bytes of the last one that were written, if it is one that writes.
    pub eighths: usize,
    /// The fate of bytes that were not brought to the disk.
    pub unsynced: Unsynced,
}

/// Returns every time of a power cut: after each operation, and in the middle of each that writes.
pub fn power_cuts(operations: &[DiskOperation]) -> Vec<PowerCut> {
    let all = (0..=operations.len()).flat_map(|count| {
        let torn: &[usize] = match count.checked_sub(1).map(|last| &operations[last]) {
            Some(DiskOperation::Write { .. }) => &[0, 1, 4, 7, 8],
            _ => &[8],
        };
        // Where the last bytes are torn, those before are there; any other state is another cut.
        torn.iter().flat_map(move |&eighths| {
            let ways = if eighths < 8 { &WAYS[..1] } else { &WAYS[..] };
            ways.iter().map(move |&unsynced| PowerCut { operations: count, eighths, unsynced })
        })
    });
    all.collect()
}

/// Returns those of the power cuts that leave this disk in different states: the last of equal ones, since most was finished
/// by then.
pub fn distinct_power_cuts(disk: &PaperDisk, operations: &[DiskOperation]) -> Vec<PowerCut> {
    let (mut seen, mut cuts) = (HashSet::new(), power_cuts(operations));
    cuts.reverse();
    cuts.retain(|cut| seen.insert(disk.clone().after(operations, cut).hash()));
    cuts.reverse();
    cuts
}

#[derive(Clone, Debug, Default)]
struct Contents {
    now: Vec<u8>,
    synced: Vec<u8>,
}

/// A simulated disk.
#[derive(Clone, Debug, Default)]
pub struct PaperDisk {
    /// The contents of each file by their place in the list; `None` for folders.
    names: BTreeMap<PathBuf, Option<usize>>,
    contents: Vec<Contents>,
}

impl PaperDisk {
    /// Returns the contents of a folder, all of it on the disk for good.
    pub fn of(folder: &Path) -> Self {
        let mut disk = Self::default();
        disk.add(folder);
        disk
    }

    fn add(&mut self, folder: &Path) {
        for entry in fs::read_dir(folder).expect("readable") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                self.names.insert(path.clone(), None);
                self.add(&path);
            } else {
                let bytes = fs::read(&path).expect("readable");
                self.make(path, Contents { now: bytes.clone(), synced: bytes });
            }
        }
    }

    fn make(&mut self, path: PathBuf, contents: Contents) {
        self.names.insert(path, Some(self.contents.len()));
        self.contents.push(contents);
    }

    /// Plays the operations up to a power cut.
    pub fn after(mut self, operations: &[DiskOperation], cut: &PowerCut) -> Self {
        let begun = &operations[..cut.operations];
        for (index, operation) in begun.iter().enumerate() {
            let is_last = index + 1 == begun.len();
            self.apply(operation, if is_last { cut.eighths } else { 8 });
        }
        for contents in &mut self.contents {
            contents.fail(cut.unsynced);
        }
        self
    }

    fn apply(&mut self, operation: &DiskOperation, eighths: usize) {
        match operation {
            DiskOperation::CreateFolder(path) => drop(self.names.insert(path.clone(), None)),
            DiskOperation::Create(path) => self.make(path.clone(), Contents::default()),
            DiskOperation::Write { path, at, bytes } => {
                let (at, part) = (*at as usize, &bytes[..bytes.len() * eighths / 8]);
                let now = &mut self.file(path).now;
                now.resize(now.len().max(at + part.len()), 0);
                now[at..at + part.len()].copy_from_slice(part);
            }
            DiskOperation::SetLength { path, length } => self.file(path).now.resize(*length as usize, 0),
            DiskOperation::Sync(path) => {
                let contents = self.file(path);
                contents.synced.clone_from(&contents.now);
            }
            DiskOperation::Rename { from, to } => self.rename(from, to),
            DiskOperation::Link { from, to } => drop(self.names.insert(to.clone(), self.names[from])),
            DiskOperation::Remove(path) => drop(self.names.remove(path).expect("there")),
        }
    }

    fn file(&mut self, path: &Path) -> &mut Contents {
        let place = self.names.get(path).copied().flatten();
        &mut self.contents[place.unwrap_or_else(|| panic!("{} is no file", path.display()))]
    }

    fn rename(&mut self, from: &Path, to: &Path) {
        let moved: Vec<PathBuf> = self.names.keys().filter(|path| path.starts_with(from)).cloned().collect();
        for path in moved {
            let kind = self.names.remove(&path).expect("listed");
            let below = path.strip_prefix(from).expect("listed");
            // A trailing separator would make a file a folder.
            let name = if below.as_os_str().is_empty() { to.to_owned() } else { to.join(below) };
            self.names.insert(name, kind);
        }
    }

    /// Returns true if there is such a file or folder.
    pub fn has(&self, path: &Path) -> bool {
        self.names.contains_key(path)
    }

    /// Returns a hash of all names and bytes.
    fn hash(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        for (path, kind) in &self.names {
            (path, kind.map(|place| &self.contents[place].now)).hash(&mut hasher);
        }
        hasher.finish()
    }

    /// Puts the files that lie below `from` below `to`.
    pub fn write(&self, from: &Path, to: &Path) {
        for (path, kind) in &self.names {
            let path = to.join(path.strip_prefix(from).expect("below"));
            match kind {
                None => fs::create_dir_all(path).expect("writable"),
                Some(place) => fs::write(path, &self.contents[*place].now).expect("writable"),
            }
        }
    }
}

impl Contents {
    fn fail(&mut self, unsynced: Unsynced) {
        match unsynced {
            Unsynced::Kept => {}
            Unsynced::Lost => self.now.clone_from(&self.synced),
            Unsynced::Halved if self.now.starts_with(&self.synced) => {
                self.now.truncate(self.synced.len().midpoint(self.now.len()));
            }
            // A file that was written over is half new.
            Unsynced::Halved => {
                let half = self.now.len() / 2;
                let rest = self.synced.get(half..).unwrap_or_default();
                self.now = [&self.now[..half], rest].concat();
            }
        }
    }
}

/// Checks the work after each power cut, on two threads: each has files of its own.
///
/// # Panics
/// If a check does.
pub fn after_each(cuts: &[PowerCut], check: impl Fn(&PowerCut) + Sync) {
    let (half, rest) = cuts.split_at(cuts.len() / 2);
    std::thread::scope(|scope| {
        let other = scope.spawn(|| half.iter().for_each(&check));
        rest.iter().for_each(&check);
        if let Err(panic) = other.join() {
            std::panic::resume_unwind(panic);
        }
    });
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use playbot_learner::disk::{self, DiskFile, DiskRecording};

    use super::*;

    /// Does all kinds of operations in a folder, and returns them.
    fn worked_on(folder: &Path) -> Vec<DiskOperation> {
        let recording = DiskRecording::of(folder);
        let below = folder.join("a/b");
        disk::create_dir_all(&below).expect("writable");
        disk::write_atomically(&below.join("whole"), b"whole").expect("writable");
        let mut file = DiskFile::create(&below.join("log")).expect("writable");
        file.write_all(b"first").and_then(|()| file.sync()).expect("writable");
        for line in ["second", "third"] {
            DiskFile::append(&below.join("log")).and_then(|mut log| log.write_all(line.as_bytes())).expect("writable");
        }
        disk::hard_link(&below.join("whole"), &folder.join("a/link")).expect("writable");
        disk::rename(&below, &folder.join("a/c")).expect("writable");
        disk::create_dir_all(&folder.join("gone/deep")).expect("writable");
        DiskFile::create_new(&folder.join("gone/deep/file")).and_then(|file| file.set_len(3)).expect("writable");
        disk::remove_dir_all(&folder.join("gone")).expect("writable");
        recording.operations()
    }

    fn found(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
        let disk = PaperDisk::of(folder);
        let contents = |kind: &Option<usize>| kind.map_or(Vec::new(), |place| disk.contents[place].now.clone());
        let name = |path: &PathBuf| path.strip_prefix(folder).expect("below").to_owned();
        disk.names.iter().map(|(path, kind)| (name(path), contents(kind))).collect()
    }

    #[test]
    fn what_was_recorded_gives_the_same_disk() {
        let (real, paper) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
        let operations = worked_on(real.path());
        let end = PowerCut { operations: operations.len(), eighths: 8, unsynced: Unsynced::Kept };
        PaperDisk::default().after(&operations, &end).write(real.path(), paper.path());
        assert_eq!(found(real.path()), found(paper.path()));
        assert_eq!(found(real.path())[Path::new("a/c/log")], b"firstsecondthird");
    }

    #[test]
    fn only_bytes_that_were_not_synchronised_are_lost() {
        let folder = tempfile::tempdir().expect("a folder");
        let operations = worked_on(folder.path());
        let log = |unsynced| {
            let cut = PowerCut { operations: operations.len(), eighths: 8, unsynced };
            let mut disk = PaperDisk::default().after(&operations, &cut);
            assert_eq!(disk.file(&folder.path().join("a/link")).now, b"whole", "{unsynced:?}");
            disk.file(&folder.path().join("a/c/log")).now.clone()
        };
        assert_eq!(log(Unsynced::Lost), b"first");
        assert_eq!(log(Unsynced::Halved), b"firstsecon");
        let (all, distinct) = (power_cuts(&operations), distinct_power_cuts(&PaperDisk::default(), &operations));
        assert!(all.len() > 3 * operations.len() && distinct.len() > operations.len(), "{}", distinct.len());
        assert!(distinct.len() < all.len() && distinct.last().map(|cut| cut.operations) == Some(operations.len()));
    }
}
