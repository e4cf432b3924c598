//! Little-endian reading and writing of the values inside a frame.
//!
//! # Frames: one episode each, found and checked without knowledge of the frames before it
//!
//! ```text
//! magic (4 bytes) | payload length (u32) | payload | CRC-32 of length and payload (u32)
//! ```

use crate::{
    action::{ActionSpace, Actions},
    demo::file::{
        episode::{Decider, DemoEnd, DemoEpisode},
        error::EpisodeFault,
        header::{DemoHeader, LEVEL_FILES_FORMAT, RANDOMISED_FORMAT},
    },
    level::{LevelFile, RandomisedValue},
};
use playbot_learner::MOST_CHOICES;

/// Encodings of a list; the shorter one is used.
const PLAIN: u8 = 0;

const RUNS: u8 = 1;

pub(super) fn malformed(why: impl Into<String>) -> EpisodeFault {
    EpisodeFault::Malformed(why.into())
}

/// A value of fixed size.
pub(super) trait Scalar: Copy {
    /// Size in bytes.
    const SIZE: usize;
    fn put(self, out: &mut Vec<u8>);
    /// Reads the value from exactly `SIZE` bytes.
    fn get(bytes: &[u8]) -> Self;
    /// Compares the bits: runs must return -0.0 as -0.0.
    fn same(self, other: Self) -> bool;
}

macro_rules! scalar {
    ($($type:ty),*) => {$(
        impl Scalar for $type {
            const SIZE: usize = size_of::<$type>();
            fn put(self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
            fn get(bytes: &[u8]) -> Self {
                let mut array = [0; size_of::<$type>()];
                array.copy_from_slice(bytes);
                Self::from_le_bytes(array)
            }
            fn same(self, other: Self) -> bool {
                self.to_le_bytes() == other.to_le_bytes()
            }
        }
    )*};
}

scalar!(u8, u16, u32, u64, f32, f64);

/// Writes the values one after the other, without their number.
pub(super) fn put_plain<T: Scalar>(values: &[T], out: &mut Vec<u8>) {
    out.reserve(values.len() * T::SIZE);
    for &value in values {
        value.put(out);
    }
}

/// Writes the values as runs `(count, value)` or one after the other, whichever is shorter.
pub(super) fn put_list<T: Scalar>(values: &[T], out: &mut Vec<u8>) {
    let start = out.len();
    out.push(RUNS);
    for run in values.chunk_by(|a, b| a.same(*b)) {
        put_varint(run.len() as u64, out);
        run[0].put(out);
    }
    if out.len() - start > 1 + values.len() * T::SIZE {
        out.truncate(start);
        out.push(PLAIN);
        put_plain(values, out);
    }
}

/// Writes a number with seven bits a byte, lowest first.
fn put_varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Reads values from the front of a slice. Sizes are checked before memory is allocated.
pub(super) struct Cursor<'a>(pub(super) &'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8], EpisodeFault> {
        let (head, tail) =
            self.0.split_at_checked(length).ok_or_else(|| malformed(format!("it ends inside {what}")))?;
        self.0 = tail;
        Ok(head)
    }

    pub(super) fn scalar<T: Scalar>(&mut self, what: &str) -> Result<T, EpisodeFault> {
        Ok(T::get(self.take(T::SIZE, what)?))
    }

    /// Reads `count` values written by [`put_plain`].
    pub(super) fn plain<T: Scalar>(&mut self, count: usize, what: &str) -> Result<Vec<T>, EpisodeFault> {
        let size = count.checked_mul(T::SIZE).ok_or_else(|| malformed(format!("too many {what}")))?;
        Ok(self.take(size, what)?.chunks_exact(T::SIZE).map(T::get).collect())
    }

    /// Reads `count` values written by [`put_list`]. The caller must have checked `count`.
    pub(super) fn list<T: Scalar>(&mut self, count: usize, what: &str) -> Result<Vec<T>, EpisodeFault> {
        match self.scalar::<u8>(what)? {
            PLAIN => self.plain(count, what),
            RUNS => {
                let mut values = Vec::with_capacity(count);
                while values.len() < count {
                    let run = self.varint(what)?;
                    if run == 0 || run > (count - values.len()) as u64 {
                        return Err(malformed(format!("a run of {run} {what} for {count} steps")));
                    }
                    let value = self.scalar(what)?;
                    values.resize(values.len() + run as usize, value);
                }
                Ok(values)
            }
            other => Err(malformed(format!("unknown coding {other} of {what}"))),
        }
    }

    fn varint(&mut self, what: &str) -> Result<u64, EpisodeFault> {
        let mut value = 0;
        for shift in (0..63).step_by(7) {
            let byte: u8 = self.scalar(what)?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(malformed(format!("a run of {what} without end")))
    }
}

/// First bytes of a frame. The first byte is not ASCII and not valid UTF-8, so no header contains it.
pub(super) const FRAME_MAGIC: [u8; 4] = [0xfe, b'E', b'P', 0xff];

/// Bytes before the payload.
pub(super) const FRAME_HEAD: usize = 8;

/// Bytes of a frame beside its payload.
pub(super) const FRAME_EXTRA: usize = FRAME_HEAD + 4;

/// Largest payload, in bytes: about four days of ticks at 60 Hz with two observation values.
pub(super) const MAX_PAYLOAD: usize = 1 << 28;

/// Returns the whole frame of an episode.
pub(super) fn encode(episode: &DemoEpisode, header: &DemoHeader) -> Result<Vec<u8>, EpisodeFault> {
    let mut bytes = FRAME_MAGIC.to_vec();
    bytes.extend_from_slice(&[0; 4]);
    encode_payload(episode, header, &mut bytes)?;
    let length = bytes.len() - FRAME_HEAD;
    if length > MAX_PAYLOAD {
        return Err(EpisodeFault::TooLarge { bytes: length, limit: MAX_PAYLOAD });
    }
    bytes[4..FRAME_HEAD].copy_from_slice(&(length as u32).to_le_bytes());
    let crc = crc32fast::hash(&bytes[4..]);
    bytes.extend_from_slice(&crc.to_le_bytes());
    Ok(bytes)
}

/// Returns the payload length that a frame head announces; `None` when no frame begins here.
pub(super) fn payload_length(head: &[u8]) -> Option<usize> {
    let rest = head.strip_prefix(&FRAME_MAGIC)?.first_chunk::<4>()?;
    Some(u32::from_le_bytes(*rest) as usize)
}

/// Returns the payload of a whole frame; `None` when its checksum does not hold.
pub(super) fn payload(frame: &[u8]) -> Option<&[u8]> {
    let (body, crc) = frame.split_last_chunk::<4>()?;
    let intact = crc32fast::hash(body.get(4..)?) == u32::from_le_bytes(*crc);
    intact.then_some(&body[FRAME_HEAD..])
}

// Payload of a frame: one episode.

/// Appends the episode to `out`, after [`DemoEpisode::check`] against the header.
///
/// | Field | Coding |
/// |---|---|
/// | steps | `u32` |
/// | state hashes | `steps` × `u32` |
/// | level seed | `u64` |
/// | end | `u8`: 0 terminated without, 1 with success, 2 truncated, 3 aborted |
/// | kind of actions | `u8`: 1, 2 or 4 bytes for a discrete action; 0 for continuous ones, then `u32` dimensions; 3 for several choices and numbers, then `u32` choices and `u32` numbers |
/// | actions | discrete: list; continuous: `steps` × dimensions × `f32`; several: a list of `u32` for each choice, then `steps` × numbers × `f32` |
/// | rewards | list of `f32` |
/// | deciders | list of `u8`: 0 human, 1 bot, 2 policy, 3 replay, 4 idle |
/// | observation width | `u32` |
/// | observations | `steps` × width × `f32` |
/// | level file | from format 2 on: `u32` bytes of its path, 0 for none; the path in UTF-8; the level's hash, `u64` |
/// | randomised values | from format 3 on: `u32` values; for each `u32` bytes of its path, the path in UTF-8, and `f64` |
///
/// All numbers are little-endian. A list is one byte and then the shorter of two forms: the plain values (byte 0), or
/// runs (byte 1). A run is a count (seven bits a byte, lowest first) and a value. The hashes come first: they bound the
/// number of steps by the size of the frame.
pub(super) fn encode_payload(
    episode: &DemoEpisode,
    header: &DemoHeader,
    out: &mut Vec<u8>,
) -> Result<(), EpisodeFault> {
    episode.check(header)?;
    let steps = u32::try_from(episode.len()).map_err(|_| malformed("more steps than 32 bits count"))?;
    put_plain(&[steps], out);
    put_plain(&episode.state_hashes, out);
    put_plain(&[episode.level_seed], out);
    out.push(match episode.end {
        DemoEnd::Terminated { success: false } => 0,
        DemoEnd::Terminated { success: true } => 1,
        DemoEnd::Truncated => 2,
        DemoEnd::Aborted => 3,
    });
    match &episode.actions {
        Actions::Discrete(actions) => {
            // The actions were checked to be below the header's count, so the casts lose nothing.
            let size = action_size(header.actions);
            out.push(size);
            match size {
                1 => put_list(&actions.iter().map(|&a| a as u8).collect::<Vec<_>>(), out),
                2 => put_list(&actions.iter().map(|&a| a as u16).collect::<Vec<_>>(), out),
                _ => put_list(actions, out),
            }
        }
        Actions::Continuous { dim, values } => {
            out.push(0);
            put_plain(&[*dim as u32], out);
            put_plain(values, out);
        }
        Actions::Mixed { choices, options, dim, values } => {
            out.push(MIXED);
            put_plain(&[*choices as u32, *dim as u32], out);
            for choice in 0..*choices {
                put_list(&options.iter().skip(choice).step_by(*choices).copied().collect::<Vec<u32>>(), out);
            }
            put_plain(values, out);
        }
    }
    put_list(&episode.rewards, out);
    put_list(&episode.deciders.iter().map(|&d| decider_code(d)).collect::<Vec<_>>(), out);
    put_plain(&[header.observation_names.len() as u32], out);
    put_plain(&episode.observations, out);
    put_level_file(episode.level_file.as_ref(), header, out)?;
    put_randomised(&episode.randomised, header, out)
}

fn put_randomised(values: &[RandomisedValue], header: &DemoHeader, out: &mut Vec<u8>) -> Result<(), EpisodeFault> {
    if header.format < RANDOMISED_FORMAT {
        let Some(RandomisedValue { path, .. }) = values.first() else { return Ok(()) };
        let format = header.format;
        return Err(malformed(format!(
            "`{path}` was drawn for the level, which recordings in format {format} cannot say"
        )));
    }
    let length = |length: usize| u32::try_from(length).map_err(|_| malformed("too many randomised values"));
    put_plain(&[length(values.len())?], out);
    for RandomisedValue { path, value } in values {
        put_plain(&[length(path.len())?], out);
        out.extend_from_slice(path.as_bytes());
        put_plain(&[*value], out);
    }
    Ok(())
}

fn randomised(cursor: &mut Cursor, header: &DemoHeader) -> Result<Vec<RandomisedValue>, EpisodeFault> {
    let mut values = Vec::new();
    if header.format < RANDOMISED_FORMAT {
        return Ok(values);
    }
    let what = "the randomised values";
    for _ in 0..cursor.scalar::<u32>(what)? {
        let length = cursor.scalar::<u32>(what)? as usize;
        let path = String::from_utf8(cursor.plain(length, what)?);
        let path = path.map_err(|_| malformed("the path of a randomised value is not text"))?;
        values.push(RandomisedValue { path, value: cursor.scalar(what)? });
    }
    Ok(values)
}

fn put_level_file(file: Option<&LevelFile>, header: &DemoHeader, out: &mut Vec<u8>) -> Result<(), EpisodeFault> {
    match (file, header.format < LEVEL_FILES_FORMAT) {
        (None, true) => {}
        (Some(file), true) => {
            let (path, format) = (&file.path, header.format);
            return Err(malformed(format!("level {path} is a file, which recordings in format {format} cannot name")));
        }
        (None, false) => put_plain(&[0u32], out),
        (Some(LevelFile { path, hash }), false) => {
            let length = u32::try_from(path.len()).ok().filter(|&length| length > 0);
            put_plain(&[length.ok_or_else(|| malformed("the path of the level file is empty or too long"))?], out);
            out.extend_from_slice(path.as_bytes());
            put_plain(&[*hash], out);
        }
    }
    Ok(())
}

fn level_file(cursor: &mut Cursor, header: &DemoHeader) -> Result<Option<LevelFile>, EpisodeFault> {
    if header.format < LEVEL_FILES_FORMAT {
        return Ok(None);
    }
    let what = "the level file";
    let length = cursor.scalar::<u32>(what)? as usize;
    if length == 0 {
        return Ok(None);
    }
    let path = String::from_utf8(cursor.plain(length, what)?);
    let path = path.map_err(|_| malformed("the path of the level file is not text"))?;
    Ok(Some(LevelFile { path, hash: cursor.scalar(what)? }))
}

/// Reads an episode and checks it against the header.
pub(super) fn decode(payload: &[u8], header: &DemoHeader) -> Result<DemoEpisode, EpisodeFault> {
    let mut cursor = Cursor(payload);
    let steps = cursor.scalar::<u32>("the number of steps")? as usize;
    let state_hashes = cursor.plain(steps, "state hashes")?;
    let level_seed = cursor.scalar("the level seed")?;
    let end = match cursor.scalar::<u8>("the end reason")? {
        0 => DemoEnd::Terminated { success: false },
        1 => DemoEnd::Terminated { success: true },
        2 => DemoEnd::Truncated,
        3 => DemoEnd::Aborted,
        other => return Err(malformed(format!("unknown end reason {other}"))),
    };
    let actions = match cursor.scalar::<u8>("the kind of actions")? {
        0 => {
            let dim = cursor.scalar::<u32>("the number of dimensions")? as usize;
            let count = steps.checked_mul(dim).ok_or_else(|| malformed("too many action values"))?;
            Actions::Continuous { dim, values: cursor.plain(count, "action values")? }
        }
        1 => Actions::Discrete(cursor.list::<u8>(steps, "actions")?.into_iter().map(u32::from).collect()),
        2 => Actions::Discrete(cursor.list::<u16>(steps, "actions")?.into_iter().map(u32::from).collect()),
        4 => Actions::Discrete(cursor.list(steps, "actions")?),
        MIXED => {
            let choices = cursor.scalar::<u32>("the number of choices")? as usize;
            let dim = cursor.scalar::<u32>("the number of dimensions")? as usize;
            if choices > MOST_CHOICES {
                return Err(malformed(format!("{choices} choices at once: at most {MOST_CHOICES} are possible")));
            }
            let mut options = vec![0; steps * choices];
            for choice in 0..choices {
                let taken = cursor.list::<u32>(steps, "options")?;
                options.iter_mut().skip(choice).step_by(choices).zip(taken).for_each(|(to, option)| *to = option);
            }
            let count = steps.checked_mul(dim).ok_or_else(|| malformed("too many action values"))?;
            Actions::Mixed { choices, options, dim, values: cursor.plain(count, "action values")? }
        }
        other => return Err(malformed(format!("unknown kind of actions {other}"))),
    };
    let rewards = cursor.list(steps, "rewards")?;
    let deciders = cursor.list(steps, "deciders")?.into_iter().map(decider).collect::<Result<_, _>>()?;
    let width = cursor.scalar::<u32>("the observation width")? as usize;
    let count = steps.checked_mul(width).ok_or_else(|| malformed("too many observation values"))?;
    let observations = cursor.plain(count, "observation values")?;
    let level_file = level_file(&mut cursor, header)?;
    let randomised = randomised(&mut cursor, header)?;
    if !cursor.0.is_empty() {
        return Err(malformed(format!("{} bytes after the last field", cursor.0.len())));
    }
    let episode =
        DemoEpisode { level_seed, level_file, randomised, actions, rewards, state_hashes, deciders, end, observations };
    episode.check(header)?;
    Ok(episode)
}

/// The code of several choices and numbers, where a discrete action has its bytes.
const MIXED: u8 = 3;

/// Bytes of a discrete action; 0 for continuous ones.
fn action_size(actions: ActionSpace) -> u8 {
    match actions {
        ActionSpace::Discrete(0..=0x100) => 1,
        ActionSpace::Discrete(0x101..=0x1_0000) => 2,
        ActionSpace::Discrete(_) => 4,
        ActionSpace::Continuous(_) => 0,
        ActionSpace::Mixed(_) => MIXED,
    }
}

fn decider_code(decider: Decider) -> u8 {
    match decider {
        Decider::Human => 0,
        Decider::Bot => 1,
        Decider::Policy => 2,
        Decider::Replay => 3,
        Decider::Idle => 4,
    }
}

fn decider(code: u8) -> Result<Decider, EpisodeFault> {
    Ok(match code {
        0 => Decider::Human,
        1 => Decider::Bot,
        2 => Decider::Policy,
        3 => Decider::Replay,
        4 => Decider::Idle,
        other => return Err(malformed(format!("unknown decider {other}"))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demo::file::testing::{episode, header};

    #[test]
    fn lists_take_the_shorter_coding_and_read_back() {
        let mut out = Vec::new();
        put_list(&[0.0f32; 1000], &mut out);
        assert_eq!(out, [RUNS, 0xe8, 0x07, 0, 0, 0, 0]);
        assert_eq!(Cursor(&out).list::<f32>(1000, "rewards"), Ok(vec![0.0; 1000]));
        out.clear();
        put_list(&[1u8, 2, 3], &mut out);
        assert_eq!(out, [PLAIN, 1, 2, 3]);
        assert_eq!(Cursor(&out).list::<u8>(3, "actions"), Ok(vec![1, 2, 3]));
    }

    #[test]
    fn the_sign_of_zero_survives_a_run() {
        let mut out = Vec::new();
        put_list(&[0.0f32, -0.0, -0.0, -0.0, -0.0, -0.0], &mut out);
        let back = Cursor(&out).list::<f32>(6, "rewards").expect("sound");
        assert!(back[0].is_sign_positive() && back[1..].iter().all(|v| v.is_sign_negative()));
    }

    #[test]
    fn runs_cannot_exceed_the_steps() {
        let endless = [RUNS, 0xff, 0xff, 0xff, 0xff, 0x7f, 1];
        assert!(Cursor(&endless).list::<u8>(3, "actions").is_err());
        assert!(Cursor(&[RUNS, 0, 1]).list::<u8>(3, "actions").is_err());
        assert!(Cursor(&[RUNS, 2, 1]).list::<u8>(3, "actions").is_err());
        assert!(Cursor(&[RUNS; 40]).list::<u8>(3, "actions").is_ok());
        assert!(Cursor(&[0x80; 40][..]).varint("actions").is_err());
        assert!(Cursor(&[]).plain::<u64>(usize::MAX, "hashes").is_err());
    }

    fn coded(episode: &DemoEpisode, header: &DemoHeader) -> Result<Vec<u8>, EpisodeFault> {
        let mut bytes = Vec::new();
        encode_payload(episode, header, &mut bytes).map(|()| bytes)
    }

    #[test]
    fn level_files_are_kept_from_format_2_on_and_cost_older_recordings_nothing() {
        let plain = episode(3, 5);
        let file = LevelFile { path: "levels/höhle.json".to_owned(), hash: u64::MAX - 1 };
        let drawn = DemoEpisode { level_file: Some(file), ..plain.clone() };
        let with_files = header().with_level_files();
        for episode in [&plain, &drawn] {
            let bytes = coded(episode, &with_files).expect("writable");
            assert_eq!(decode(&bytes, &with_files).as_ref(), Ok(episode));
        }
        let bytes = coded(&plain, &header()).expect("writable");
        assert_eq!(coded(&plain, &with_files).expect("writable").len(), bytes.len() + 4);
        assert_eq!(decode(&bytes, &header()), Ok(plain));
        let refused = coded(&drawn, &header()).expect_err("format 1").to_string();
        assert!(refused.contains("levels/höhle.json") && refused.contains("format 1"), "{refused}");
    }

    #[test]
    fn randomised_values_are_kept_from_format_3_on() {
        let drawn = |path: &str, value| RandomisedValue { path: path.to_owned(), value };
        let values = vec![drawn("Gravity.0", -9.5), drawn("Player.Speed.0", 0.1 + 0.2)];
        let episode = DemoEpisode { randomised: values, ..episode(3, 5) };
        let with_values = header().with_level_files().with_randomised_values();
        let bytes = coded(&episode, &with_values).expect("writable");
        assert_eq!(decode(&bytes, &with_values).as_ref(), Ok(&episode));
        assert!((1..bytes.len()).all(|end| decode(&bytes[..end], &with_values).is_err()), "it is cut off");
        let refused = coded(&episode, &header().with_level_files()).expect_err("format 2").to_string();
        assert!(refused.contains("`Gravity.0`") && refused.contains("format 2"), "{refused}");
        let endless = DemoEpisode { randomised: vec![drawn("Gravity.0", f64::NAN)], ..episode };
        assert!(coded(&endless, &with_values).expect_err("no number").to_string().contains("Gravity.0"));
    }

    #[test]
    fn a_level_file_that_is_cut_off_or_no_text_is_malformed() {
        let with_files = header().with_level_files();
        let file = LevelFile { path: "ab".to_owned(), hash: 7 };
        let bytes = coded(&DemoEpisode { level_file: Some(file), ..episode(3, 2) }, &with_files).expect("writable");
        assert!(decode(&bytes[..bytes.len() - 1], &with_files).is_err());
        let mut bad = bytes.clone();
        let path = bytes.len() - 10;
        bad[path] = 0xff;
        assert!(decode(&bad, &with_files).expect_err("no text").to_string().contains("not text"));
    }
}
