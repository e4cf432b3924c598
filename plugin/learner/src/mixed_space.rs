//! Spaces of several choices at once, with or without a vector of numbers.

use crate::LearnError;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Most choices that an agent makes in one step.
pub const MOST_CHOICES: usize = 16;

/// The sizes of the choices that an agent makes in one step: `[3, 2]` for one of three and one of two.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Choices {
    sizes: [u32; MOST_CHOICES],
    len: usize,
}

impl Choices {
    /// Creates the choices of these sizes.
    ///
    /// # Errors
    /// [`LearnError::Config`] if there are more than [`MOST_CHOICES`].
    pub fn new(sizes: &[usize]) -> Result<Self, LearnError> {
        let mut choices = Self { len: sizes.len(), ..Self::default() };
        for (at, &size) in sizes.iter().enumerate() {
            let (Some(to), Ok(size)) = (choices.sizes.get_mut(at), u32::try_from(size)) else {
                let why = format!("at most {MOST_CHOICES} choices can be made in one step, not {}", sizes.len());
                return Err(LearnError::Config(why));
            };
            *to = size;
        }
        Ok(choices)
    }

    /// Returns one choice of this size.
    pub(crate) fn one(size: usize) -> Self {
        let mut sizes = [0; MOST_CHOICES];
        sizes[0] = u32::try_from(size).unwrap_or(u32::MAX);
        Self { sizes, len: 1 }
    }

    /// Returns the size of each choice.
    pub fn sizes(&self) -> &[u32] {
        &self.sizes[..self.len]
    }

    /// Returns the number of all options together.
    pub fn options(&self) -> usize {
        self.sizes().iter().map(|&size| size as usize).sum()
    }

    /// Returns the columns of each choice among all options.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut end = 0;
        self.sizes().iter().map(move |&size| {
            let start = end;
            end += size as usize;
            start..end
        })
    }
}

/// Several choices and a vector of numbers, which an agent gives together in each step.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(try_from = "MixedParts", into = "MixedParts")]
pub struct MixedSpace {
    /// The choices.
    pub choices: Choices,
    /// Length of the vector; 0 without one.
    pub numbers: usize,
}

impl MixedSpace {
    /// Returns the number of outputs of a network: all options, then the numbers.
    pub fn dim(&self) -> usize {
        self.choices.options().saturating_add(self.numbers)
    }

    /// Returns whether a part of it has nothing to choose from, or it has no part.
    pub fn is_empty(&self) -> bool {
        self.choices.sizes().contains(&0) || self.dim() == 0
    }

    /// Returns why an action of these options and numbers does not belong to it, or `None` if it does.
    pub fn misfit(&self, options: &[u32], numbers: &[f32]) -> Option<String> {
        let sizes = self.choices.sizes();
        if options.len() != sizes.len() {
            return Some(format!("{} choices, expected {}", options.len(), sizes.len()));
        }
        if let Some(at) = options.iter().zip(sizes).position(|(option, size)| option >= size) {
            return Some(format!("choice {at} is {} of {} options", options[at], sizes[at]));
        }
        if numbers.len() != self.numbers {
            return Some(format!("{} numbers, expected {}", numbers.len(), self.numbers));
        }
        numbers.iter().position(|x| !x.is_finite()).map(|at| format!("number {at} is {}", numbers[at]))
    }
}

/// The form in files.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MixedParts {
    choices: Vec<usize>,
    numbers: usize,
}

impl From<MixedSpace> for MixedParts {
    fn from(space: MixedSpace) -> Self {
        Self { choices: space.choices.sizes().iter().map(|&size| size as usize).collect(), numbers: space.numbers }
    }
}

impl TryFrom<MixedParts> for MixedSpace {
    type Error = LearnError;

    fn try_from(parts: MixedParts) -> Result<Self, LearnError> {
        Ok(Self { choices: Choices::new(&parts.choices)?, numbers: parts.numbers })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_follow_one_another() {
        let choices = Choices::new(&[3, 2, 4]).expect("three choices");
        assert_eq!(choices.ranges().collect::<Vec<_>>(), [0..3, 3..5, 5..9]);
        assert_eq!((choices.options(), choices.sizes()), (9, &[3, 2, 4][..]));
    }

    #[test]
    fn too_many_choices_are_refused() {
        let text = Choices::new(&[2; 17]).expect_err("too many").to_string();
        assert!(text.contains("at most 16 choices"), "{text}");
        let space = serde_json::json!({"choices": vec![2; 17], "numbers": 0});
        assert!(serde_json::from_value::<MixedSpace>(space).is_err());
    }

    #[test]
    fn misfits_are_named() {
        let space = MixedSpace { choices: Choices::new(&[3, 2]).expect("two"), numbers: 1 };
        assert_eq!(space.misfit(&[2, 1], &[0.5]), None);
        let why = |options: &[u32], numbers: &[f32]| space.misfit(options, numbers).expect("a misfit");
        assert_eq!(why(&[2], &[0.5]), "1 choices, expected 2");
        assert_eq!(why(&[2, 2], &[0.5]), "choice 1 is 2 of 2 options");
        assert_eq!(why(&[2, 1], &[]), "0 numbers, expected 1");
        assert_eq!(why(&[2, 1], &[f32::NAN]), "number 0 is NaN");
    }
}
