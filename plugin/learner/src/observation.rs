//! What an agent observes: vectors of numbers, or images.

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
        self.channels * self.height * self.width
    }
}

/// What every observation of a game is. In files a bare number is the width of a vector.
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

    /// The width of a vector.
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

/// Many observations of one kind in host memory, one after the other.
#[derive(Clone, Debug, PartialEq)]
pub enum Observations {
    /// Numbers.
    Vector(Vec<f32>),
    /// Pixels.
    Image(Vec<u8>),
}

impl Observations {
    /// None yet, with room for `rows` of the given kind.
    pub(crate) fn with_capacity(kind: &ObsKind, rows: usize) -> Self {
        let numbers = rows * kind.numbers();
        match kind {
            ObsKind::Vector(_) => Self::Vector(Vec::with_capacity(numbers)),
            ObsKind::Image(_) => Self::Image(Vec::with_capacity(numbers)),
        }
    }

    /// Numbers in all observations together.
    pub fn numbers(&self) -> usize {
        match self {
            Self::Vector(values) => values.len(),
            Self::Image(pixels) => pixels.len(),
        }
    }

    /// `Ok` if these are `rows` observations of `kind`, all finite; `what` names them.
    pub(crate) fn check(&self, what: &str, kind: &ObsKind, rows: usize) -> Result<(), LearnError> {
        LearnError::check(what, rows * kind.numbers(), self.numbers())?;
        match (self, kind) {
            (Self::Vector(values), ObsKind::Vector(width)) => LearnError::check_finite(what, *width, values),
            (Self::Image(_), ObsKind::Image(_)) => Ok(()),
            _ => Err(LearnError::Config(format!("{what} are not {kind}"))),
        }
    }

    /// Adds number `row` of `other`, which is of the same kind with `width` numbers each.
    pub(crate) fn push_row(&mut self, other: &Self, row: usize, width: usize) {
        let range = row * width..(row + 1) * width;
        match (self, other) {
            (Self::Vector(to), Self::Vector(from)) => to.extend_from_slice(&from[range]),
            (Self::Image(to), Self::Image(from)) => to.extend_from_slice(&from[range]),
            _ => unreachable!("the episodes of a dataset are checked to be of one kind"),
        }
    }
}

impl From<Vec<f32>> for Observations {
    fn from(values: Vec<f32>) -> Self {
        Self::Vector(values)
    }
}

impl From<Vec<u8>> for Observations {
    fn from(pixels: Vec<u8>) -> Self {
        Self::Image(pixels)
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
