//! Observations: their kinds, batches in host memory, metadata of pictures, and augmentations.
//!
//! - `augmentation`: image augmentations: random changes that do not matter to the task, so that networks become
//!   insensitive to them.

mod augmentation;

use crate::LearnError;
use serde::{Deserialize, Serialize};
use std::{fmt, ops::Range};

pub use crate::observation::augmentation::Augmentation;
pub(crate) use crate::observation::augmentation::augmented;

/// Many observations of one kind, one after the other. Their [`ObsKind`] gives the width of one.
#[derive(Clone, Debug, PartialEq)]
pub enum Observations {
    /// Numbers.
    Vector(Vec<f32>),
    /// Pixels, in the order channel, row, column.
    Image(Vec<u8>),
}

/// Borrowed [`Observations`], one or many. Play and learning take observations in this form, so that a part of a
/// rollout needs no copy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObsSlice<'a> {
    /// Numbers.
    Vector(&'a [f32]),
    /// Pixels, in the order channel, row, column.
    Image(&'a [u8]),
}

impl Observations {
    /// Creates an empty batch.
    pub fn empty(kind: &ObsKind) -> Self {
        Self::with_capacity(kind, 0)
    }

    /// Creates an empty batch with room for `rows` of the given kind.
    pub fn with_capacity(kind: &ObsKind, rows: usize) -> Self {
        let numbers = rows * kind.numbers();
        match kind {
            ObsKind::Vector(_) => Self::Vector(Vec::with_capacity(numbers)),
            ObsKind::Image(_) => Self::Image(Vec::with_capacity(numbers)),
        }
    }

    /// Creates `rows` of the given kind, all 0.
    pub fn zeros(kind: &ObsKind, rows: usize) -> Self {
        let numbers = rows * kind.numbers();
        match kind {
            ObsKind::Vector(_) => Self::Vector(vec![0.0; numbers]),
            ObsKind::Image(_) => Self::Image(vec![0; numbers]),
        }
    }

    /// Removes all observations and keeps the memory.
    pub fn clear(&mut self) {
        match self {
            Self::Vector(values) => values.clear(),
            Self::Image(pixels) => pixels.clear(),
        }
    }

    /// Returns the number of values in all observations together.
    pub fn numbers(&self) -> usize {
        self.as_slice().numbers()
    }

    /// Returns whether there are no observations.
    pub fn is_empty(&self) -> bool {
        self.numbers() == 0
    }

    /// Returns all observations, borrowed.
    pub fn as_slice(&self) -> ObsSlice<'_> {
        match self {
            Self::Vector(values) => ObsSlice::Vector(values),
            Self::Image(pixels) => ObsSlice::Image(pixels),
        }
    }

    /// Returns observation number `row`; all have `width` numbers.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn row(&self, row: usize, width: usize) -> ObsSlice<'_> {
        self.rows(row..row + 1, width)
    }

    /// Returns several observations, of `width` numbers each.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn rows(&self, rows: Range<usize>, width: usize) -> ObsSlice<'_> {
        self.as_slice().rows(rows, width)
    }

    /// Adds one or many observations at the end.
    ///
    /// # Errors
    /// [`LearnError::Config`] if they are of another kind.
    pub fn push<'a>(&mut self, more: impl Into<ObsSlice<'a>>) -> Result<(), LearnError> {
        match (self, more.into()) {
            (Self::Vector(to), ObsSlice::Vector(from)) => to.extend_from_slice(from),
            (Self::Image(to), ObsSlice::Image(from)) => to.extend_from_slice(from),
            (to, from) if from.numbers() > 0 => return Err(mixed(to, from)),
            _ => {}
        }
        Ok(())
    }

    /// Replaces observation number `row`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if it is of another kind.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn set_row<'a>(&mut self, row: usize, observation: impl Into<ObsSlice<'a>>) -> Result<(), LearnError> {
        let from = observation.into();
        let place = row * from.numbers()..(row + 1) * from.numbers();
        match (self, from) {
            (Self::Vector(to), ObsSlice::Vector(from)) => to[place].copy_from_slice(from),
            (Self::Image(to), ObsSlice::Image(from)) => to[place].copy_from_slice(from),
            (to, from) => return Err(mixed(to, from)),
        }
        Ok(())
    }
}

fn mixed(to: &Observations, from: ObsSlice<'_>) -> LearnError {
    LearnError::Config(format!("{} cannot be added to {}", from.what(), to.as_slice().what()))
}

impl<'a> ObsSlice<'a> {
    /// Returns the number of values in all observations together.
    pub fn numbers(self) -> usize {
        match self {
            Self::Vector(values) => values.len(),
            Self::Image(pixels) => pixels.len(),
        }
    }

    /// Returns some of the observations, of `width` numbers each.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn rows(self, rows: Range<usize>, width: usize) -> Self {
        let range = rows.start * width..rows.end * width;
        match self {
            Self::Vector(values) => Self::Vector(&values[range]),
            Self::Image(pixels) => Self::Image(&pixels[range]),
        }
    }

    /// Returns the numbers of vectors.
    ///
    /// # Errors
    /// [`LearnError::Config`], which names `reader`, if observations are images.
    pub(crate) fn vectors(self, reader: &str) -> Result<&'a [f32], LearnError> {
        match self {
            Self::Vector(values) => Ok(values),
            Self::Image(_) => Err(LearnError::Config(format!("{reader} reads vectors, not images"))),
        }
    }

    /// Checks that these are `rows` observations of `kind`; `what` names them.
    pub(crate) fn check_size(self, what: &str, kind: &ObsKind, rows: usize) -> Result<(), LearnError> {
        let same = matches!((self, kind), (Self::Vector(_), ObsKind::Vector(_)) | (Self::Image(_), ObsKind::Image(_)));
        if !same && self.numbers() > 0 {
            return Err(LearnError::Config(format!("{what} are {}, not {kind}", self.what())));
        }
        LearnError::check(what, rows * kind.numbers(), self.numbers())
    }

    /// Checks as [`Self::check_size`], and that all numbers are finite.
    pub(crate) fn check(self, what: &str, kind: &ObsKind, rows: usize) -> Result<(), LearnError> {
        self.check_size(what, kind, rows)?;
        self.check_finite(what, kind.numbers())
    }

    /// Checks that all numbers, `width` to a row, are finite; pixels always are.
    pub(crate) fn check_finite(self, what: &str, width: usize) -> Result<(), LearnError> {
        match self {
            Self::Vector(values) => LearnError::check_finite(what, width, values),
            Self::Image(_) => Ok(()),
        }
    }

    fn what(self) -> &'static str {
        match self {
            Self::Vector(_) => "vectors",
            Self::Image(_) => "images",
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

impl<'a> From<&'a Observations> for ObsSlice<'a> {
    fn from(observations: &'a Observations) -> Self {
        observations.as_slice()
    }
}

impl<'a> From<&'a [f32]> for ObsSlice<'a> {
    fn from(values: &'a [f32]) -> Self {
        Self::Vector(values)
    }
}

impl<'a> From<&'a [u8]> for ObsSlice<'a> {
    fn from(pixels: &'a [u8]) -> Self {
        Self::Image(pixels)
    }
}

impl<'a> From<&'a Vec<f32>> for ObsSlice<'a> {
    fn from(values: &'a Vec<f32>) -> Self {
        Self::Vector(values)
    }
}

impl<'a> From<&'a Vec<u8>> for ObsSlice<'a> {
    fn from(pixels: &'a Vec<u8>) -> Self {
        Self::Image(pixels)
    }
}

impl<'a, const N: usize> From<&'a [f32; N]> for ObsSlice<'a> {
    fn from(values: &'a [f32; N]) -> Self {
        Self::Vector(values)
    }
}

/// Metadata of the images that a policy or a skill model observes: images of one shape can be made in different ways.
/// Their size is that of the policy's observation, and the network that reads them is part of the policy.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct PictureMetadata {
    /// Name of the sensor that made them.
    pub sensor: String,
    /// Number of successive pictures in an image, oldest first.
    pub stack: usize,
    /// One channel of brightness instead of red, green and blue.
    pub grayscale: bool,
    /// True if the agent's velocity is painted into them.
    pub paint_velocity: bool,
}

impl PictureMetadata {
    /// Channels of an image.
    pub fn channels(&self) -> usize {
        self.stack * if self.grayscale { 1 } else { 3 }
    }

    /// Checks that a policy of `observation` can have this metadata.
    pub(crate) fn check(&self, observation: ObsKind) -> Result<(), LearnError> {
        match observation {
            ObsKind::Image(image) if image.channels == self.channels() => Ok(()),
            _ => Err(LearnError::Config(format!(
                "the metadata describes {} pictures with {} channels in total, but the policy observes {observation}",
                self.stack,
                self.channels()
            ))),
        }
    }
}

// Kinds of observations: a vector of numbers, or an image.

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

    const IMAGE: ObsKind = ObsKind::Image(ImageShape { channels: 1, height: 1, width: 2 });

    #[test]
    fn rows_go_in_and_come_out() {
        for kind in [ObsKind::Vector(2), IMAGE] {
            let mut all = Observations::zeros(&kind, 2);
            let mut other = Observations::empty(&kind);
            match &mut other {
                Observations::Vector(values) => values.extend([3.0, 4.0]),
                Observations::Image(pixels) => pixels.extend([3, 4]),
            }
            all.set_row(1, &other).expect("one kind");
            all.push(all.clone().row(1, 2)).expect("one kind");
            assert_eq!((all.numbers(), all.row(0, 2) == other.as_slice()), (6, false));
            assert!(all.row(1, 2) == other.as_slice() && all.rows(2..3, 2) == other.as_slice());
            assert!(all.as_slice().check("rows", &kind, 3).is_ok());
            assert!(matches!(all.as_slice().check("rows", &kind, 2), Err(LearnError::Shape { .. })));
            all.clear();
            assert!(all.is_empty() && all == Observations::empty(&kind));
        }
    }

    #[test]
    fn kinds_do_not_mix() {
        let mut images = Observations::zeros(&IMAGE, 1);
        let text = |error: Result<(), LearnError>| error.expect_err("mixed").to_string();
        assert_eq!(text(images.push(&[1.0, 2.0])), "config: vectors cannot be added to images");
        assert_eq!(text(images.set_row(0, &[1.0, 2.0])), "config: vectors cannot be added to images");
        let error = text(ObsSlice::Vector(&[0.0; 2]).check("rows", &IMAGE, 1));
        assert_eq!(error, "config: rows are vectors, not images of 1 channels, 1 rows and 2 columns");
        let nothing: &[f32] = &[];
        assert!(images.push(nothing).is_ok() && ObsSlice::Vector(nothing).check("rows", &IMAGE, 0).is_ok());
        let error = images.as_slice().vectors("SAC").expect_err("images").to_string();
        assert_eq!(error, "config: SAC reads vectors, not images");
    }
}
