//! Changes of recordings.

use super::{
    bytes::{EXTREME_WORDS, change_bytes},
    dice::Dice,
    seals::digits,
    texts::mutate_text,
};

/// The beginning of a frame.
const MAGIC: [u8; 4] = [0xfe, b'E', b'P', 0xff];
/// Bytes of a frame before its payload: magic and length.
const HEAD: usize = 8;
/// Bytes of its checksum.
const SUM: usize = 4;
/// The beginning of the second copy of the header.
const COPY: &str = "\n// playbot-demo ";

/// A recording in its parts, with the checksums that stand in it.
struct Recording {
    header: String,
    header_sum: String,
    frames: Vec<Frame>,
    /// The rest behind the last whole frame.
    rest: Vec<u8>,
}

#[derive(Clone)]
struct Frame {
    payload: Vec<u8>,
    sum: [u8; SUM],
}

impl Recording {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let end = bytes.iter().position(|byte| *byte == b'\n')? + 1;
        let line = std::str::from_utf8(&bytes[..end]).ok()?.trim_end();
        let (length, sum) = line.strip_prefix("playbot-demo header=")?.split_once(" crc32=")?;
        let start = end.checked_add(length.parse().ok()?)?;
        let header = String::from_utf8(bytes.get(end..start)?.to_vec()).ok()?;
        let (mut frames, mut rest) = (Vec::new(), &bytes[start..]);
        while let Some((frame, after)) = Frame::parse(rest) {
            frames.push(frame);
            rest = after;
        }
        Some(Self { header, header_sum: sum.to_owned(), frames, rest: rest.to_vec() })
    }

    fn to_bytes(&self) -> Vec<u8> {
        let line = format!("playbot-demo header={:08} crc32={}\n", self.header.len(), self.header_sum);
        let mut bytes = [line.as_bytes(), self.header.as_bytes()].concat();
        for Frame { payload, sum } in &self.frames {
            let length = (payload.len() as u32).to_le_bytes();
            bytes.extend([&MAGIC[..], &length, payload, sum].concat());
        }
        bytes.extend(&self.rest);
        bytes
    }

    /// Returns the position at which a frame begins.
    fn place(&self, frame: usize) -> usize {
        let all: usize = self.frames[frame..].iter().map(|frame| HEAD + frame.payload.len() + SUM).sum();
        self.to_bytes().len() - self.rest.len() - all
    }
}

impl Frame {
    fn parse(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let rest = bytes.strip_prefix(&MAGIC)?;
        let (length, rest) = rest.split_first_chunk()?;
        let (payload, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        let (sum, rest) = rest.split_first_chunk()?;
        Some((Self { payload: payload.to_vec(), sum: *sum }, rest))
    }
}

/// Changes one thing about a recording: its header, the order or number of its episodes, a length, or something in an
/// episode. `None` if it is no recording any more.
pub(super) fn mutate_recording(bytes: &[u8], dice: &mut Dice) -> Option<Vec<u8>> {
    let mut recording = Recording::parse(bytes)?;
    let count = recording.frames.len();
    if count == 0 || dice.roll(4) == 0 {
        recording.header = mutate_header(&recording.header, dice);
        return Some(recording.to_bytes());
    }
    let (at, other) = (dice.roll(count), dice.roll(count));
    match dice.roll(8) {
        0 => recording.frames.swap(at, other),
        1 => {
            let copy = recording.frames[at].clone();
            recording.frames.insert(other, copy);
        }
        2 => drop(recording.frames.remove(at)),
        3 => recording.rest = change_bytes(&recording.frames[other].payload, dice),
        4 => {
            let place = recording.place(at) + MAGIC.len();
            let mut bytes = recording.to_bytes();
            bytes[place..place + 4].copy_from_slice(&(*dice.pick(&EXTREME_WORDS) as u32).to_le_bytes());
            return Some(bytes);
        }
        5 => {
            let part = recording.frames[other].payload.clone();
            let payload = &mut recording.frames[at].payload;
            payload.splice(..dice.roll(part.len()).min(payload.len()), part);
        }
        6 => recording.frames[at].payload = change_bytes(&recording.frames[at].payload, dice),
        _ => {
            // Numbers of a payload stand at any place.
            let payload = &mut recording.frames[at].payload;
            let place = dice.roll(payload.len().saturating_sub(3));
            let word = (*dice.pick(&EXTREME_WORDS) as u32).to_le_bytes();
            payload.iter_mut().skip(place).zip(word).for_each(|(byte, new)| *byte = new);
        }
    }
    Some(recording.to_bytes())
}

/// Changes the first copy of the header alone, or both.
fn mutate_header(header: &str, dice: &mut Dice) -> String {
    match header.find(COPY) {
        Some(end) if dice.roll(3) > 0 => mutate_text(&header[..end], dice) + &header[end..],
        _ => mutate_text(header, dice),
    }
}

/// Returns the recording with new checksums of its parts.
pub(super) fn reseal_recording(bytes: &[u8]) -> Vec<u8> {
    let Some(mut recording) = Recording::parse(bytes) else { return bytes.to_vec() };
    recording.header_sum = digits(recording.header.as_bytes());
    for Frame { payload, sum } in &mut recording.frames {
        let length = (payload.len() as u32).to_le_bytes();
        *sum = crc32fast::hash(&[&length[..], &payload[..]].concat()).to_le_bytes();
    }
    recording.to_bytes()
}

#[cfg(test)]
mod tests {
    use bevy_playbot::demo::file::{DemoReader, DemoWriter};

    use super::*;
    use crate::{Corridor, recording::record_random};

    #[test]
    fn what_is_taken_apart_is_put_together_again_with_its_checksums() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.demo");
        record_random(&Corridor, "plain", 5, &path, 0..3);
        let whole = std::fs::read(&path).expect("written");
        let mut recording = Recording::parse(&whole).expect("whole");
        assert_eq!((recording.frames.len(), recording.rest.len()), (3, 0));
        assert!(recording.to_bytes() == whole && reseal_recording(&whole) == whole);
        assert_eq!(whole[recording.place(1)..][..4], MAGIC);
        recording.frames.swap(0, 2);
        recording.header = recording.header.replacen("note: \"\"", "note: \"changed\"", 1);
        let read = |bytes: Vec<u8>| {
            std::fs::write(&path, bytes).expect("writable");
            DemoReader::open(&path).map(|reader| reader.header().note.clone())
        };
        assert!(read(recording.to_bytes()).is_err());
        assert_eq!(read(reseal_recording(&recording.to_bytes())).expect("it fits"), "changed");
        let header = DemoReader::open(&path).expect("whole").header().clone();
        assert_eq!(DemoWriter::append(&path, &header).expect("all episodes are sound").episodes(), 3);
    }
}
