//! Readers of event files for tests.

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
    let mut files: Vec<_> = fs::read_dir(folder).expect("listed").map(|entry| entry.expect("listed").path()).collect();
    files.retain(|file| file.to_string_lossy().contains("tfevents"));
    assert_eq!(files.len(), 1, "{files:?}");
    let bytes = fs::read(&files[0]).expect("readable");
    let (records, length) = whole_records(&bytes);
    assert_eq!(length, bytes.len(), "the last record is torn");
    // A key and eight bytes of wall time come first.
    assert_eq!((&records[0][9..], &records[1][9..]), (&b"\x1a\x0dbrain.Event:2"[..], &[0x3a, 2, 8, 1][..]));
    bytes[12 + records[0].len() + 4 + 12 + records[1].len() + 4..].to_vec()
}
