//! The bytes of one episode inside its frame.
//!
//! | Field | Coding |
//! |---|---|
//! | steps | `u32` |
//! | state hashes | `steps` × `u32` |
//! | level seed | `u64` |
//! | end | `u8`: 0 terminated without, 1 with success, 2 truncated, 3 aborted |
//! | kind of actions | `u8`: 1, 2 or 4 bytes for a discrete action; 0 for continuous ones, then `u32` dimensions |
//! | actions | discrete: list; continuous: `steps` × dimensions × `f32` |
//! | rewards | list of `f32` |
//! | deciders | list of `u8`: 0 human, 1 bot, 2 policy, 3 replay, 4 idle |
//! | observation width | `u32` |
//! | observations | `steps` × width × `f32` |
//! | level file | from format 2 on: `u32` bytes of its path, 0 for none; the path in UTF-8; the level's hash, `u64` |
//!
//! All numbers are little-endian. A list is one byte and then either the plain values (byte 0) or runs
//! of a count (seven bits a byte, lowest first) and a value (byte 1), whichever is shorter.
//! The hashes come first: they bound the number of steps by the size of the frame.

use super::bytes::{Cursor, malformed, put_list, put_plain};
use super::episode::{Decider, DemoEnd, DemoEpisode, EpisodeActions};
use super::episode_fault::EpisodeFault;
use super::header::{DemoActions, DemoHeader, LEVEL_FILES_FORMAT};
use crate::level_files::LevelFile;

/// Appends the episode to `out`, after [`DemoEpisode::check`] against the header.
pub(super) fn encode(episode: &DemoEpisode, header: &DemoHeader, out: &mut Vec<u8>) -> Result<(), EpisodeFault> {
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
        EpisodeActions::Discrete(actions) => {
            // The actions were checked to be below the header's count, so the casts lose nothing.
            let size = action_size(header.actions);
            out.push(size);
            match size {
                1 => put_list(&actions.iter().map(|&a| a as u8).collect::<Vec<_>>(), out),
                2 => put_list(&actions.iter().map(|&a| a as u16).collect::<Vec<_>>(), out),
                _ => put_list(actions, out),
            }
        }
        EpisodeActions::Continuous { dim, values } => {
            out.push(0);
            put_plain(&[*dim as u32], out);
            put_plain(values, out);
        }
    }
    put_list(&episode.rewards, out);
    put_list(&episode.deciders.iter().map(|&d| decider_code(d)).collect::<Vec<_>>(), out);
    put_plain(&[header.observation_names.len() as u32], out);
    put_plain(&episode.observations, out);
    put_level_file(episode.level_file.as_ref(), header, out)
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
            EpisodeActions::Continuous { dim, values: cursor.plain(count, "action values")? }
        }
        1 => EpisodeActions::Discrete(cursor.list::<u8>(steps, "actions")?.into_iter().map(u32::from).collect()),
        2 => EpisodeActions::Discrete(cursor.list::<u16>(steps, "actions")?.into_iter().map(u32::from).collect()),
        4 => EpisodeActions::Discrete(cursor.list(steps, "actions")?),
        other => return Err(malformed(format!("unknown kind of actions {other}"))),
    };
    let rewards = cursor.list(steps, "rewards")?;
    let deciders = cursor.list(steps, "deciders")?.into_iter().map(decider).collect::<Result<_, _>>()?;
    let width = cursor.scalar::<u32>("the observation width")? as usize;
    let count = steps.checked_mul(width).ok_or_else(|| malformed("too many observation values"))?;
    let observations = cursor.plain(count, "observation values")?;
    let level_file = level_file(&mut cursor, header)?;
    if !cursor.0.is_empty() {
        return Err(malformed(format!("{} bytes after the last field", cursor.0.len())));
    }
    let episode = DemoEpisode { level_seed, level_file, actions, rewards, state_hashes, deciders, end, observations };
    episode.check(header)?;
    Ok(episode)
}

/// Bytes of a discrete action; 0 for continuous ones.
fn action_size(actions: DemoActions) -> u8 {
    match actions {
        DemoActions::Discrete(0..=0x100) => 1,
        DemoActions::Discrete(0x101..=0x1_0000) => 2,
        DemoActions::Discrete(_) => 4,
        DemoActions::Continuous(_) => 0,
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
    use super::super::testing::{episode, header};
    use super::*;

    fn coded(episode: &DemoEpisode, header: &DemoHeader) -> Result<Vec<u8>, EpisodeFault> {
        let mut bytes = Vec::new();
        encode(episode, header, &mut bytes).map(|()| bytes)
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
