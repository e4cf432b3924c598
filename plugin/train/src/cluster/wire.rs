//! Messages between a training and its workers.
//!
//! A message is the length of the rest in bytes, as a whole number of 32 bits; a byte with its [`Kind`]; the number of the
//! worker, 32 bits; and its content. All numbers have their lowest byte first.
//!
//! ```
//! use playbot_train::cluster::wire::{Kind, read_frame, write_frame};
//!
//! let mut bytes = Vec::new();
//! write_frame(&mut bytes, Kind::Lost, 3, &[b"work", b"er 3"])?;
//! let frame = read_frame(&mut bytes.as_slice())?.expect("a message");
//! assert_eq!((frame.kind, frame.worker, frame.content.as_slice()), (Kind::Lost, 3, &b"worker 3"[..]));
//! # Ok::<(), std::io::Error>(())
//! ```

use crate::{
    collect::{ArenaState, Ended},
    levels::LevelState,
};
use bevy_playbot::{
    action::ActionSpace,
    episode::{EpisodeEnd, EpisodeEnded, EpisodeResult},
};
use playbot_harness::split::LevelSplit;
use playbot_learner::{Actions, ObsKind, Observations, Rollout};
use serde::{Deserialize, Serialize};
use std::io::{self, ErrorKind, Read, Write};

/// Version of the protocol. A training and its workers have the same.
pub const PROTOCOL: u32 = 1;

/// The number of the worker in messages to all of them.
pub const ALL: u32 = u32::MAX;

/// The kind of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Relay: the first message, a JSON [`Hello`].
    Hello = 1,
    /// Training: what is played, a JSON [`Setup`].
    Setup = 2,
    /// Training: new weights. A number of 64 bits, and the bytes of a policy file.
    Weights = 3,
    /// Training: an order to play, JSON.
    Play = 4,
    /// Worker: the answer to it. The length of a JSON text, 32 bits; the text; the numbers of a rollout.
    Played = 5,
    /// Relay: a worker is lost, and another one has its place. The content says why.
    Lost = 6,
    /// Relay: the workers are lost for good. The content says why.
    Failed = 7,
}

impl Kind {
    fn of(byte: u8) -> Option<Self> {
        let all = [Self::Hello, Self::Setup, Self::Weights, Self::Play, Self::Played, Self::Lost, Self::Failed];
        all.into_iter().find(|kind| *kind as u8 == byte)
    }
}

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Its kind.
    pub kind: Kind,
    /// Number of the worker that it is from or for, or [`ALL`].
    pub worker: u32,
    /// Its content.
    pub content: Vec<u8>,
}

/// Bytes of a message's length.
const LENGTH: usize = 4;

/// Bytes between length and content.
const HEAD: usize = 5;

/// Writes a message whose content are these parts.
///
/// # Errors
///
/// The other side is gone.
pub fn write_frame(stream: &mut impl Write, kind: Kind, worker: u32, parts: &[&[u8]]) -> io::Result<()> {
    let content: usize = parts.iter().map(|part| part.len()).sum();
    let length = u32::try_from(content + HEAD).map_err(|_| io::Error::from(ErrorKind::FileTooLarge))?;
    stream.write_all(&length.to_le_bytes())?;
    stream.write_all(&[kind as u8])?;
    stream.write_all(&worker.to_le_bytes())?;
    parts.iter().try_for_each(|part| stream.write_all(part))?;
    stream.flush()
}

/// Reads a message; `None` if the other side has left between two messages.
///
/// # Errors
///
/// The other side has left within a message, or this is none.
pub fn read_frame(stream: &mut impl Read) -> io::Result<Option<Frame>> {
    let head = up_to(stream, LENGTH + HEAD)?;
    let [l0, l1, l2, l3, kind, w0, w1, w2, w3] = head[..] else {
        return if head.is_empty() { Ok(None) } else { Err(ErrorKind::UnexpectedEof.into()) };
    };
    let length = u32::from_le_bytes([l0, l1, l2, l3]) as usize;
    let kind = Kind::of(kind).filter(|_| length >= HEAD);
    let kind =
        kind.ok_or_else(|| io::Error::new(ErrorKind::InvalidData, "this is no message of a training or worker"))?;
    let content = up_to(stream, length - HEAD)?;
    if content.len() < length - HEAD {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    Ok(Some(Frame { kind, worker: u32::from_le_bytes([w0, w1, w2, w3]), content }))
}

/// Reads so many bytes, or fewer at the end. Memory is taken for those that come: a wrong length may ask for any number.
fn up_to(stream: &mut impl Read, bytes: usize) -> io::Result<Vec<u8>> {
    let mut read = Vec::new();
    stream.take(bytes as u64).read_to_end(&mut read)?;
    Ok(read)
}

/// The first message of a relay.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Hello {
    /// The version of the protocol that it speaks.
    pub protocol: u32,
    /// Its workers.
    pub workers: usize,
}

/// What a training plays.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Setup {
    /// The version of the protocol.
    pub protocol: u32,
    /// Version and revision of playbot.
    pub code: String,
    /// Version of the game's rules.
    pub game_version: u32,
    /// The experiment, as RON.
    pub experiment: String,
}

/// An order to play a share of the arenas.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct Order {
    /// Number of the share's first agent.
    pub(crate) first: u32,
    /// Its agents.
    pub(crate) count: u32,
    /// Its levels.
    pub(crate) levels: LevelSplit,
    /// Ticks to play.
    pub(crate) steps: usize,
    /// Width of the skills to keep.
    pub(crate) latent: usize,
    /// Number of the weights.
    pub(crate) weights: u64,
    /// Rollouts that the share has played so far.
    pub(crate) played: u64,
    /// What decides the levels that come next, if anything does.
    pub(crate) plan: Option<LevelState>,
    /// States of the arenas to begin with, unless the worker has played the share's last rollout.
    pub(crate) states: Option<Vec<ArenaState>>,
}

/// The answer to an order, beside the numbers of the rollout.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct Answer {
    /// Number of the share's first agent.
    pub(crate) first: u32,
    /// The fault of the game, if it has one, or the reason why the worker cannot play.
    pub(crate) error: Option<String>,
    pub(crate) ended: Vec<EndedEpisode>,
    /// States of the arenas after it.
    pub(crate) states: Vec<ArenaState>,
}

/// An episode that ended in a rollout, with its place in it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(crate) struct EndedEpisode {
    tick: usize,
    agent: usize,
    level: u64,
    end: EpisodeEnd,
    success: bool,
    ticks: u32,
    clipped: u32,
    total_reward: f64,
}

impl From<Ended> for EndedEpisode {
    fn from(Ended { tick, agent, episode }: Ended) -> Self {
        let EpisodeResult { level, end, success, ticks, clipped, total_reward } = episode.result;
        Self { tick, agent, level, end, success, ticks, clipped, total_reward }
    }
}

impl From<EndedEpisode> for Ended {
    fn from(ended: EndedEpisode) -> Self {
        let EndedEpisode { tick, agent, level, end, success, ticks, clipped, total_reward } = ended;
        let result = EpisodeResult { level, end, success, ticks, clipped, total_reward };
        // The agent lives in another World.
        let entity = bevy::prelude::Entity::PLACEHOLDER;
        Self { tick, agent, episode: EpisodeEnded { entity, result } }
    }
}

impl Answer {
    /// Returns the content of a message with this answer and a rollout.
    pub(crate) fn with(&self, rollout: Option<Rollout>) -> Vec<u8> {
        let text = serde_json::to_vec(self).unwrap_or_default();
        let mut bytes = (text.len() as u32).to_le_bytes().to_vec();
        bytes.extend(text);
        if let Some(mut rollout) = rollout {
            let mut writer = Writer(bytes);
            writer.count(&mut rollout.steps);
            parts(&mut rollout, &mut writer);
            bytes = writer.0;
        }
        bytes
    }

    /// Reads the content of a message. The rollout has agents, observations and actions of these kinds; it is empty beside an
    /// error.
    pub(crate) fn read(
        content: &[u8],
        kind: &ObsKind,
        space: &ActionSpace,
        latent: usize,
    ) -> Result<(Self, Rollout), String> {
        let cut = || "its answer is cut off".to_owned();
        let (length, rest) = content.split_first_chunk::<4>().ok_or_else(cut)?;
        let (text, numbers) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(cut)?;
        let answer: Self = serde_json::from_slice(text).map_err(|error| format!("its answer is damaged: {error}"))?;
        let mut rollout = Rollout::new(answer.states.len(), *kind, latent, space);
        if answer.error.is_some() {
            return Ok((answer, rollout));
        }
        let mut reader = Reader { rest: numbers, is_cut: false };
        reader.count(&mut rollout.steps);
        parts(&mut rollout, &mut reader);
        if reader.is_cut || !reader.rest.is_empty() {
            return Err(cut());
        }
        rollout.check().map_err(|error| error.to_string())?;
        Ok((answer, rollout))
    }
}

/// The lists of a rollout, one after the other, which are written or read.
trait Parts {
    fn count(&mut self, number: &mut usize);
    fn numbers(&mut self, all: &mut Vec<f32>);
    fn words(&mut self, all: &mut Vec<u32>);
    fn bytes(&mut self, all: &mut Vec<u8>);

    fn flags(&mut self, all: &mut Vec<bool>) {
        let mut bytes = all.iter().map(|&flag| u8::from(flag)).collect();
        self.bytes(&mut bytes);
        *all = bytes.into_iter().map(|byte| byte != 0).collect();
    }

    fn rows(&mut self, all: &mut Vec<usize>) {
        let mut words = all.iter().map(|&row| row as u32).collect();
        self.words(&mut words);
        *all = words.into_iter().map(|word| word as usize).collect();
    }

    fn observations(&mut self, all: &mut Observations) {
        match all {
            Observations::Vector(values) => self.numbers(values),
            Observations::Image(pixels) => self.bytes(pixels),
        }
    }

    fn actions(&mut self, all: &mut Actions) {
        match all {
            Actions::Discrete(options) => self.words(options),
            Actions::Continuous { values, .. } => self.numbers(values),
            Actions::Mixed { options, values, .. } => {
                self.words(options);
                self.numbers(values);
            }
        }
    }
}

/// Visits all lists of a rollout. Its sizes and kinds are known to both sides.
fn parts(rollout: &mut Rollout, visitor: &mut impl Parts) {
    visitor.observations(&mut rollout.obs);
    visitor.actions(&mut rollout.actions);
    for flags in [&mut rollout.legal, &mut rollout.terminated, &mut rollout.truncated] {
        visitor.flags(flags);
    }
    for numbers in [
        &mut rollout.z,
        &mut rollout.left,
        &mut rollout.memory,
        &mut rollout.log_probs,
        &mut rollout.values,
        &mut rollout.rewards,
        &mut rollout.final_values,
        &mut rollout.next_values,
    ] {
        visitor.numbers(numbers);
    }
    let ends = &mut rollout.ends;
    visitor.rows(&mut ends.cut_rows);
    visitor.observations(&mut ends.cut_obs);
    visitor.observations(&mut ends.next_obs);
    visitor.flags(&mut ends.cut_legal);
    visitor.flags(&mut ends.next_legal);
    for numbers in [
        &mut ends.cut_z,
        &mut ends.cut_left,
        &mut ends.cut_memory,
        &mut ends.next_z,
        &mut ends.next_left,
        &mut ends.next_memory,
    ] {
        visitor.numbers(numbers);
    }
}

/// Writes lists, each behind its length.
struct Writer(Vec<u8>);

impl Parts for Writer {
    fn count(&mut self, number: &mut usize) {
        self.0.extend((*number as u64).to_le_bytes());
    }

    fn numbers(&mut self, all: &mut Vec<f32>) {
        self.count(&mut all.len());
        self.0.extend(all.iter().flat_map(|number| number.to_le_bytes()));
    }

    fn words(&mut self, all: &mut Vec<u32>) {
        self.count(&mut all.len());
        self.0.extend(all.iter().flat_map(|word| word.to_le_bytes()));
    }

    fn bytes(&mut self, all: &mut Vec<u8>) {
        self.count(&mut all.len());
        self.0.extend_from_slice(all);
    }
}

/// Reads what [`Writer`] has written.
struct Reader<'a> {
    rest: &'a [u8],
    is_cut: bool,
}

impl Reader<'_> {
    /// Takes a list of elements of this size.
    fn list(&mut self, size: usize) -> &[u8] {
        let mut length = 0;
        self.count(&mut length);
        let taken = length.checked_mul(size).and_then(|bytes| self.rest.split_at_checked(bytes));
        self.is_cut |= taken.is_none();
        let (list, rest) = taken.unwrap_or_default();
        self.rest = rest;
        list
    }
}

impl Parts for Reader<'_> {
    fn count(&mut self, number: &mut usize) {
        let taken = self.rest.split_first_chunk::<8>();
        self.is_cut |= taken.is_none();
        let (bytes, rest) = taken.unwrap_or((&[0; 8], &[]));
        *number = u64::from_le_bytes(*bytes) as usize;
        self.rest = rest;
    }

    fn numbers(&mut self, all: &mut Vec<f32>) {
        let words = self.list(4).chunks_exact(4);
        *all = words.map(|word| f32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
    }

    fn words(&mut self, all: &mut Vec<u32>) {
        let words = self.list(4).chunks_exact(4);
        *all = words.map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
    }

    fn bytes(&mut self, all: &mut Vec<u8>) {
        *all = self.list(1).to_vec();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::RolloutStep;

    fn rollout() -> Rollout {
        let (kind, space) = (ObsKind::Vector(2), ActionSpace::Discrete(3));
        let mut rollout = Rollout::new(2, kind, 1, &space);
        let actions = Actions::Discrete(vec![2, 0]);
        rollout
            .push_step(RolloutStep {
                obs: (&[1.0_f32, 2.0, 3.0, f32::MIN_POSITIVE][..]).into(),
                z: &[0.5, -0.5],
                actions: &actions,
                log_probs: &[-1.0, -2.0],
                values: &[1.0, 2.0],
                rewards: &[0.0, 10.0],
                terminated: &[false, true],
                truncated: &[true, false],
                final_values: &[7.0, 0.0],
            })
            .expect("fits");
        rollout.push_cut(0, &[8.0_f32, 9.0][..], &[0.25]).expect("fits");
        rollout.push_legal(&[true, false, true, true, true, false]);
        rollout.next_values = vec![3.0, 4.0];
        rollout.ends.next_obs = Observations::Vector(vec![0.0; 4]);
        rollout.ends.next_z = vec![0.0; 2];
        rollout
    }

    fn answer() -> Answer {
        let result = EpisodeResult {
            level: u64::MAX,
            end: EpisodeEnd::WON,
            success: true,
            ticks: 9,
            clipped: 1,
            total_reward: 0.1 + 0.2,
        };
        let episode = EpisodeEnded { entity: bevy::prelude::Entity::PLACEHOLDER, result };
        let states = vec![ArenaState::begun(&ActionSpace::Discrete(3), &Default::default()); 2];
        Answer { first: 4, error: None, ended: vec![Ended { tick: 3, agent: 1, episode }.into()], states }
    }

    #[test]
    fn answers_are_read_as_they_were_written() {
        let bytes = answer().with(Some(rollout()));
        let (read, back) = Answer::read(&bytes, &ObsKind::Vector(2), &ActionSpace::Discrete(3), 1).expect("whole");
        assert_eq!(back, rollout());
        assert_eq!((read.first, read.states), (4, answer().states));
        let ended = Ended::from(read.ended[0]);
        assert_eq!((ended.tick, ended.agent, ended.episode.level), (3, 1, u64::MAX));
        assert_eq!(ended.episode.total_reward.to_bits(), (0.1_f64 + 0.2).to_bits());
    }

    #[test]
    fn answers_that_are_cut_or_of_another_game_are_refused() {
        let bytes = answer().with(Some(rollout()));
        let read = |bytes: &[u8], space| Answer::read(bytes, &ObsKind::Vector(2), &space, 1);
        for length in [0, 3, 40, bytes.len() - 1] {
            read(&bytes[..length], ActionSpace::Discrete(3)).expect_err("cut off");
        }
        read(&[&bytes[..], &[0]].concat(), ActionSpace::Discrete(3)).expect_err("too long");
        read(&bytes, ActionSpace::Continuous(4)).expect_err("of another game");
    }

    #[test]
    fn what_is_no_message_is_refused() {
        for bytes in
            [&[9, 0, 0, 0, 99, 0, 0, 0, 0][..], &[1, 0, 0, 0, 4, 0, 0, 0, 0], &[255, 255, 255, 255, 4, 0, 0, 0, 0]]
        {
            read_frame(&mut &*bytes).expect_err("no message");
        }
        assert!(read_frame(&mut &[][..]).expect("the end").is_none());
    }
}
