//! Kinds of observations: a vector of numbers, or an image.

use crate::LearnError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Size of an image.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct ImageShape {
    /// Colours, times the number of stacked frames.
    pub channels: usize,
    /// Rows of pixels.
    pub height: usize,
    /// Columns of pixels.
    pub width: usize,
}

impl ImageShape {
    /// Numbers in one image.
    pub fn numbers(&self) -> usize {
        // Sizes in files can be anything.
        self.channels.saturating_mul(self.height).saturating_mul(self.width)
    }
}

/// The kind of all observations of a game. In files a bare number is the width of a vector.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(untagged)]
pub enum ObsKind {
    /// This many numbers.
    Vector(usize),
    /// Pixels of 0 to 255, in the order channel, row, column.
    Image(ImageShape),
}

impl ObsKind {
    /// Numbers in one observation.
    pub fn numbers(&self) -> usize {
        match self {
            Self::Vector(width) => *width,
            Self::Image(shape) => shape.numbers(),
        }
    }

    /// Describes it for a message: `26 observation values`, or the size of an image.
    pub fn describe(&self) -> String {
        match self {
            Self::Vector(values) => format!("{values} observation values"),
            Self::Image(_) => self.to_string(),
        }
    }

    /// Checks that `other`, the kind that `who` observes, is the same.
    ///
    /// # Errors
    /// [`LearnError::Config`] names both kinds.
    pub(crate) fn same_as(&self, other: &Self, who: &str) -> Result<(), LearnError> {
        if self == other {
            return Ok(());
        }
        Err(LearnError::Config(format!("observations must be {self}, but those of {who} are {other}")))
    }

    /// Returns the width of a vector.
    ///
    /// # Errors
    /// [`LearnError::Config`], which names `reader`, if observations are images.
    pub(crate) fn vector(&self, reader: &str) -> Result<usize, LearnError> {
        match self {
            Self::Vector(width) => Ok(*width),
            Self::Image(_) => Err(LearnError::Config(format!("{reader} reads vectors, not {self}"))),
        }
    }
}

impl From<usize> for ObsKind {
    fn from(width: usize) -> Self {
        Self::Vector(width)
    }
}

impl From<ImageShape> for ObsKind {
    fn from(shape: ImageShape) -> Self {
        Self::Image(shape)
    }
}

impl fmt::Display for ObsKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Vector(width) => write!(f, "vectors of {width}"),
            Self::Image(ImageShape { channels, height, width }) => {
                write!(f, "images of {channels} channels, {height} rows and {width} columns")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_hold_a_width_or_an_image() {
        let image = ImageShape { channels: 3, height: 64, width: 48 };
        for (kind, text) in
            [(ObsKind::Vector(26), "26"), (ObsKind::Image(image), r#"{"channels":3,"height":64,"width":48}"#)]
        {
            assert_eq!(serde_json::to_string(&kind).expect("plain"), text);
            assert_eq!(serde_json::from_str::<ObsKind>(text).expect("as written"), kind);
        }
        assert_eq!(ObsKind::Image(image).numbers(), 9216);
        let error = ObsKind::Image(image).vector("PPO").expect_err("an image");
        assert_eq!(error.to_string(), "config: PPO reads vectors, not images of 3 channels, 64 rows and 48 columns");
    }
}
