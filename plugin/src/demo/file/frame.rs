//! Frames: one episode each, found and checked without knowledge of the frames before it.
//!
//! ```text
//! magic (4 bytes) | payload length (u32) | payload | CRC-32 of length and payload (u32)
//! ```

use super::episode::DemoEpisode;
use super::episode_fault::EpisodeFault;
use super::header::DemoHeader;
use super::payload;

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
    payload::encode(episode, header, &mut bytes)?;
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
