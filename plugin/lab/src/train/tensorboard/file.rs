//! The event file of a run.

use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use playbot_learner::disk::{self, DiskFile};

use super::{
    event::{Event, EventKind},
    record::frame,
};

/// Prefix by which TensorBoard recognises event files.
const PREFIX: &str = "events.out.tfevents.";

/// A folder with the event file of one run.
#[derive(Clone, Debug)]
pub struct EventFolder {
    path: PathBuf,
}

impl EventFolder {
    /// Makes a folder at `path`, which need not exist yet.
    pub fn new(path: PathBuf) -> Self {
        Self { path }
    }

    /// Appends an event with one write, and starts the file if it is missing. After a crash, or during the write,
    /// readers find at most the last record torn. TensorBoard waits for such a record and then skips it.
    ///
    /// # Errors
    ///
    /// The operating system refuses.
    pub fn append(&self, event: &Event) -> io::Result<()> {
        let Some(file) = self.files()?.pop() else { return self.rewrite(std::slice::from_ref(event), event.wall_time) };
        let mut record = Vec::new();
        frame(&event.encode(), &mut record);
        DiskFile::append(&file)?.write_all(&record)
    }

    /// Replaces the old files by a new one with these events.
    ///
    /// The new file sorts after the old ones, and its first events make a running TensorBoard forget the values of
    /// those. `now` is the present, in seconds since 1970.
    ///
    /// # Errors
    ///
    /// The operating system refuses; the old file is then still there.
    pub fn rewrite(&self, events: &[Event], now: f64) -> io::Result<()> {
        disk::create_dir_all(&self.path)?;
        let old = self.files()?;
        let after = old.last().and_then(|file| second_of(file)).map_or(0, |second| second + 1);
        let second = (now as u64).max(after);
        let mut content = Vec::new();
        for kind in [EventKind::FileVersion, EventKind::SessionStart] {
            frame(&Event { wall_time: now, step: 0, kind }.encode(), &mut content);
        }
        for event in events {
            frame(&event.encode(), &mut content);
        }
        let temporary = self.path.join("unfinished");
        let mut file = DiskFile::create(&temporary)?;
        file.write_all(&content).and_then(|()| file.sync())?;
        disk::rename(&temporary, &self.path.join(format!("{PREFIX}{second:010}.playbot")))?;
        old.iter().try_for_each(|file| disk::remove_file(file))
    }

    /// Returns the event files, from the oldest to the newest.
    fn files(&self) -> io::Result<Vec<PathBuf>> {
        let entries = match fs::read_dir(&self.path) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(error),
        };
        let mut files = Vec::new();
        for entry in entries {
            let path = entry?.path();
            if second_of(&path).is_some() {
                files.push(path);
            }
        }
        files.sort();
        Ok(files)
    }
}

/// Returns the second in which an event file was begun, from its name; `None` for other files.
fn second_of(path: &Path) -> Option<u64> {
    let rest = path.file_name()?.to_str()?.strip_prefix(PREFIX)?;
    rest.strip_suffix(".playbot")?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::{super::testing::events_after_the_header, *};

    fn scalar(step: u64) -> Event {
        Event { wall_time: 100.0, step, kind: EventKind::Scalars(vec![("a".into(), step as f64)]) }
    }

    fn names(folder: &EventFolder) -> Vec<String> {
        let files = folder.files().expect("listed");
        files.iter().map(|file| file.file_name().expect("a name").to_string_lossy().into_owned()).collect()
    }

    fn framed(events: &[Event]) -> Vec<u8> {
        let mut out = Vec::new();
        events.iter().for_each(|event| frame(&event.encode(), &mut out));
        out
    }

    #[test]
    fn events_are_appended_and_replaced() {
        let temporary = tempfile::tempdir().expect("a folder");
        let folder = EventFolder::new(temporary.path().join("tensorboard"));
        folder.append(&scalar(1)).expect("writable");
        folder.append(&scalar(2)).expect("writable");
        assert_eq!(events_after_the_header(&folder.path), framed(&[scalar(1), scalar(2)]));
        assert_eq!(names(&folder), ["events.out.tfevents.0000000100.playbot"]);

        // A torn record, and an unrelated file.
        let file = folder.files().expect("listed").remove(0);
        fs::OpenOptions::new().append(true).open(file).expect("there").write_all(&[9; 7]).expect("writable");
        fs::write(folder.path.join("notes.txt"), "mine").expect("writable");
        folder.rewrite(&[scalar(1)], 100.0).expect("writable");
        assert_eq!(names(&folder), ["events.out.tfevents.0000000101.playbot"], "sorts behind the old one");
        folder.append(&scalar(3)).expect("writable");
        assert_eq!(events_after_the_header(&folder.path), framed(&[scalar(1), scalar(3)]));
        assert!(folder.path.join("notes.txt").exists() && !folder.path.join("unfinished").exists());
    }
}
