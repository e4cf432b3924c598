//! Event files for [TensorBoard](https://www.tensorflow.org/tensorboard): the metrics of a run as its curves.
//!
//! An event file is a sequence of framed records (TFRecord), each of them a protobuf [`Event`]. The crates for them
//! bring image codecs, code generators or an asynchronous runtime along, and the part for scalars is small enough to
//! implement here. Every byte is tested against the output of TensorBoard's own writer.

use playbot_learner::{disk, disk::DiskFile};
use std::{
    fs, io,
    io::Write,
    path::{Path, PathBuf},
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

// The `Event` message of TensorFlow's `event.proto`, as far as scalars need it.

/// An event at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Seconds since 1970.
    pub wall_time: f64,
    /// Environment steps done.
    pub step: u64,
    /// Kind of the event.
    pub kind: EventKind,
}

/// Kinds of events.
#[derive(Clone, Debug, PartialEq)]
pub enum EventKind {
    /// The first event of every file: the version of the format.
    FileVersion,
    /// Values follow from this step on; later ones from another file become void.
    SessionStart,
    /// Numbers by their tags. They are kept as `f32`; NaN is allowed, and TensorBoard shows it as such.
    Scalars(Vec<(String, f64)>),
}

/// Wire types of protobuf.
const VARINT: u64 = 0;

const EIGHT_BYTES: u64 = 1;

const LENGTH_DELIMITED: u64 = 2;

const FOUR_BYTES: u64 = 5;

impl Event {
    /// Encodes the event in protobuf's wire format: fields in the order of their numbers, those that are 0 left out.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::new();
        key(1, EIGHT_BYTES, &mut out);
        out.extend(self.wall_time.to_le_bytes());
        if self.step > 0 {
            key(2, VARINT, &mut out);
            varint(self.step, &mut out);
        }
        match &self.kind {
            EventKind::FileVersion => bytes(3, b"brain.Event:2", &mut out),
            EventKind::Scalars(values) => bytes(5, &summary(values), &mut out),
            // SessionLog { status: START }.
            EventKind::SessionStart => bytes(7, &[8, 1], &mut out),
        }
        out
    }
}

/// Encodes the `Summary` message: a value for each tag.
fn summary(values: &[(String, f64)]) -> Vec<u8> {
    let mut out = Vec::new();
    for (tag, value) in values {
        let mut entry = Vec::new();
        bytes(1, tag.as_bytes(), &mut entry);
        key(2, FOUR_BYTES, &mut entry);
        entry.extend((*value as f32).to_le_bytes());
        bytes(1, &entry, &mut out);
    }
    out
}

fn key(field: u64, wire_type: u64, out: &mut Vec<u8>) {
    varint(field << 3 | wire_type, out);
}

fn bytes(field: u64, content: &[u8], out: &mut Vec<u8>) {
    key(field, LENGTH_DELIMITED, out);
    varint(content.len() as u64, out);
    out.extend(content);
}

/// Encodes seven bits a byte, the lowest first; the highest bit of a byte marks a following byte.
fn varint(mut value: u64, out: &mut Vec<u8>) {
    while value > 0x7f {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

// TFRecord framing: length, checksum of the length, data, checksum of the data, all little-endian.

/// Offset added to a rotated checksum, which makes checksums of data that contains checksums reliable.
const MASK: u32 = 0xa282_ead8;

/// Appends one record with this content.
fn frame(data: &[u8], out: &mut Vec<u8>) {
    let length = (data.len() as u64).to_le_bytes();
    out.extend(length);
    out.extend(masked_crc(&length).to_le_bytes());
    out.extend(data);
    out.extend(masked_crc(data).to_le_bytes());
}

/// Returns the CRC-32C (Castagnoli), rotated right by 15 bits and masked.
fn masked_crc(data: &[u8]) -> u32 {
    crc32c::crc32c(data).rotate_right(15).wrapping_add(MASK)
}

/// Readers of event files for tests.
#[cfg(test)]
pub(crate) mod testing {
    use std::{fs, path::Path};

    /// Returns the contents of the whole records at the beginning of `bytes`, and the number of bytes that they take.
    /// Lengths are trusted; the checksums have tests of their own.
    pub(super) fn whole_records(bytes: &[u8]) -> (Vec<&[u8]>, usize) {
        let (mut records, mut rest) = (Vec::new(), bytes);
        while let Some((length, tail)) = rest.split_first_chunk() {
            let length = u64::from_le_bytes(*length) as usize;
            let Some(data) = tail.get(4..4 + length).filter(|_| tail.len() >= length + 8) else { break };
            records.push(data);
            rest = &tail[length + 8..];
        }
        (records, bytes.len() - rest.len())
    }

    /// Returns the bytes of the only event file in a folder, after the two events at the start of every file.
    pub(crate) fn events_after_the_header(folder: &Path) -> Vec<u8> {
        let mut files: Vec<_> =
            fs::read_dir(folder).expect("listed").map(|entry| entry.expect("listed").path()).collect();
        files.retain(|file| file.to_string_lossy().contains("tfevents"));
        assert_eq!(files.len(), 1, "{files:?}");
        let bytes = fs::read(&files[0]).expect("readable");
        let (records, length) = whole_records(&bytes);
        assert_eq!(length, bytes.len(), "the last record is torn");
        // A key and eight bytes of wall time come first.
        assert_eq!((&records[0][9..], &records[1][9..]), (&b"\x1a\x0dbrain.Event:2"[..], &[0x3a, 2, 8, 1][..]));
        bytes[12 + records[0].len() + 4 + 12 + records[1].len() + 4..].to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensorboard::testing::{events_after_the_header, whole_records};

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

    fn hex(event: &Event) -> String {
        event.encode().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// The expected bytes are what the `Event` class of TensorBoard 2.21 serialises.
    #[test]
    fn events_are_those_of_tensorboard() {
        let mut event = Event { wall_time: 1.5, step: 0, kind: EventKind::FileVersion };
        assert_eq!(hex(&event), "09000000000000f83f1a0d627261696e2e4576656e743a32");
        event.kind = EventKind::SessionStart;
        assert_eq!(hex(&event), "09000000000000f83f3a020801");
        let values = vec![("a/b".to_owned(), 0.5), ("c".to_owned(), f64::NAN)];
        let event = Event { wall_time: 2.25, step: 300, kind: EventKind::Scalars(values) };
        assert_eq!(hex(&event), "09000000000000024010ac022a160a0a0a03612f62150000003f0a080a0163150000c07f");
    }

    #[test]
    fn the_largest_number_takes_ten_bytes() {
        let mut out = Vec::new();
        varint(u64::MAX, &mut out);
        assert_eq!(out, [[0xff; 9].as_slice(), &[1]].concat());
    }

    #[test]
    fn checksums_are_those_of_the_standard() {
        // RFC 3720, appendix B.4, and the check value of CRC-32C.
        assert_eq!(crc32c::crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc32c::crc32c(b"123456789"), 0xe306_9283);
        // TensorBoard 2.21's `masked_crc32c`.
        assert_eq!(masked_crc(b"123456789"), 0xc78a_b0e5);
    }

    #[test]
    fn records_are_those_of_tensorboards_writer() {
        let data = [&[9, 0, 0, 0, 0, 0, 0, 0xf8, 0x3f, 0x1a, 0x0d][..], b"brain.Event:2"].concat();
        let mut framed = Vec::new();
        frame(&data, &mut framed);
        let expected = [&[0x18, 0, 0, 0, 0, 0, 0, 0, 0xa3, 0x7f, 0x4b, 0x22], &data[..], &[0x2a, 0x28, 0x64, 0x6c]];
        assert_eq!(framed, expected.concat());
        assert_eq!(whole_records(&framed), (vec![&data[..]], framed.len()));
        assert_eq!(whole_records(&framed[..framed.len() - 1]), (vec![], 0));
    }
}
