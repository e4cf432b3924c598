//! Batches of observations in host memory: owned, and borrowed.

use crate::{LearnError, ObsKind};
use std::ops::Range;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImageShape;

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
