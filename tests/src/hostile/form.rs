//! Structure of files, and changes that keep it.

use super::{
    bytes::change_bytes,
    dice::Dice,
    lines::{mutate_lines, mutate_object},
    recordings::{mutate_recording, reseal_recording},
    seals::{reseal_lines, reseal_object, reseal_results, reseal_text, unsealed_text},
    tensors::{mutate_tensors, reseal_tensors},
    texts::mutate_text,
};

/// Most changes of one mutant.
const MOST_CHANGES: usize = 3;

/// The structure of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A header in text, and a frame for each episode, all with checksums.
    Recording,
    /// Safetensors with a description in JSON, and a checksum in that.
    Tensors,
    /// A JSON object whose first entry is its checksum.
    Object,
    /// Lines of such objects.
    Lines,
    /// JSON with a level to a line, and a checksum behind the last one.
    Results,
    /// Text with its checksum in a comment on the first line.
    SealedText,
    /// Text as people write it: JSON or RON.
    Text,
}

impl Form {
    /// Returns a file that was changed in one to three places. In half of them the checksums fit the new contents, so
    /// that the parts behind them are read.
    pub fn mutate(self, bytes: &[u8], dice: &mut Dice) -> Vec<u8> {
        let mut changed = bytes.to_vec();
        for _ in 0..=dice.roll(MOST_CHANGES) {
            let of_form = if dice.roll(6) == 0 { None } else { self.change(&changed, dice) };
            changed = of_form.unwrap_or_else(|| change_bytes(&changed, dice));
        }
        if dice.roll(2) == 0 { self.reseal(&changed) } else { changed }
    }

    /// Makes one change that uses the meaning of the bytes; `None` if they have none.
    fn change(self, bytes: &[u8], dice: &mut Dice) -> Option<Vec<u8>> {
        let text = || std::str::from_utf8(bytes).ok();
        Some(match self {
            Self::Recording => mutate_recording(bytes, dice)?,
            Self::Tensors => mutate_tensors(bytes, dice)?,
            Self::Object => mutate_object(text()?, dice).into_bytes(),
            Self::Lines | Self::Results => mutate_lines(text()?, dice),
            Self::SealedText => {
                let text = text()?;
                let rest = unsealed_text(text);
                let seal = &text[..text.len() - rest.len()];
                format!("{seal}{}", mutate_text(rest, dice)).into_bytes()
            }
            Self::Text => mutate_text(text()?, dice).into_bytes(),
        })
    }

    /// Returns the file with new checksums of its parts, unchanged where it is no text or has none.
    pub fn reseal(self, bytes: &[u8]) -> Vec<u8> {
        let of_text = |reseal: fn(&str) -> String| match std::str::from_utf8(bytes) {
            Ok(text) => reseal(text).into_bytes(),
            Err(_) => bytes.to_vec(),
        };
        match self {
            Self::Recording => reseal_recording(bytes),
            Self::Tensors => reseal_tensors(bytes),
            Self::Object => of_text(reseal_object),
            Self::Lines => of_text(reseal_lines),
            Self::Results => of_text(reseal_results),
            Self::SealedText => of_text(reseal_text),
            Self::Text => bytes.to_vec(),
        }
    }
}
