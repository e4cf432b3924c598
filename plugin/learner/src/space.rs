//! Action spaces and actions.

use crate::{LearnError, ObsKind};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The actions that an agent can take in one step.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ActionSpace {
    /// One of `n` choices, numbered from 0.
    Discrete(usize),
    /// A vector of `n` real numbers. Games take those in [-1, 1] and clip the others.
    ///
    /// Gaussian policies (PPO's, and the skill model's decoder) draw numbers beyond. To a learner clipping is part of
    /// the game. It keeps an action as it was drawn, with the density of that draw, and measures the decoder's
    /// confidence there too. Squashed policies (SAC's) stay within.
    Continuous(usize),
}

impl ActionSpace {
    /// Returns the number of outputs of a network that acts in this space: the choices, or the vector's length.
    pub fn dim(&self) -> usize {
        match *self {
            Self::Discrete(n) | Self::Continuous(n) => n,
        }
    }

    /// Checks that every action of `actions` lies in this space.
    ///
    /// # Errors
    /// [`LearnError::Action`] names the first action that does not fit.
    pub fn check(&self, actions: &Actions) -> Result<(), LearnError> {
        match (self, actions) {
            (Self::Discrete(n), Actions::Discrete(values)) => match values.iter().position(|&a| a as usize >= *n) {
                None => Ok(()),
                Some(row) => Err(LearnError::Action(format!("row {row} is {} of {n} choices", values[row]))),
            },
            (Self::Continuous(n), Actions::Continuous { dim, values }) => {
                if n != dim {
                    return Err(LearnError::Action(format!("width {dim}, expected {n}")));
                }
                match values.iter().position(|v| !v.is_finite()) {
                    None => Ok(()),
                    Some(at) => Err(LearnError::Action(format!("row {} is not finite", at / n))),
                }
            }
            (space, _) => Err(LearnError::Action(format!("wrong kind for {space}"))),
        }
    }
}

/// Writes it as `15 discrete actions`, `continuous actions of 2 numbers`.
impl fmt::Display for ActionSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.dim() == 1 { "" } else { "s" };
        match self {
            Self::Discrete(n) => write!(f, "{n} discrete action{plural}"),
            Self::Continuous(n) => write!(f, "continuous actions of {n} number{plural}"),
        }
    }
}

/// One action.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub enum ActionValue {
    /// Index of the choice.
    Discrete(u32),
    /// The vector.
    Continuous(Vec<f32>),
}

/// Many actions of one space, in order.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub enum Actions {
    /// Indices of the choices.
    Discrete(Vec<u32>),
    /// Vectors, one after the other.
    Continuous {
        /// Length of each vector.
        dim: usize,
        /// The numbers, `dim` per action.
        values: Vec<f32>,
    },
}

impl Actions {
    /// Creates an empty list of the kind of `space`.
    pub fn empty(space: &ActionSpace) -> Self {
        match *space {
            ActionSpace::Discrete(_) => Self::Discrete(Vec::new()),
            ActionSpace::Continuous(dim) => Self::Continuous { dim, values: Vec::new() },
        }
    }

    /// Returns the number of actions.
    pub fn len(&self) -> usize {
        match self {
            Self::Discrete(values) => values.len(),
            Self::Continuous { dim, values } => values.len() / (*dim).max(1),
        }
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Removes all actions and keeps the memory.
    pub fn clear(&mut self) {
        match self {
            Self::Discrete(values) => values.clear(),
            Self::Continuous { values, .. } => values.clear(),
        }
    }

    /// Returns the action of row `row`, if there is one.
    pub fn get(&self, row: usize) -> Option<ActionValue> {
        match self {
            Self::Discrete(values) => values.get(row).copied().map(ActionValue::Discrete),
            Self::Continuous { dim, values } => {
                values.get(row * dim..(row + 1) * dim).map(|v| ActionValue::Continuous(v.to_vec()))
            }
        }
    }

    /// Adds one action at the end.
    ///
    /// # Errors
    /// [`LearnError::Action`] if it is of another kind or width.
    pub fn push(&mut self, action: &ActionValue) -> Result<(), LearnError> {
        match (self, action) {
            (Self::Discrete(values), ActionValue::Discrete(a)) => values.push(*a),
            (Self::Continuous { dim, values }, ActionValue::Continuous(a)) if a.len() == *dim => {
                values.extend_from_slice(a);
            }
            (all, one) => {
                return Err(LearnError::Action(format!("{one:?} among {}", all.kind())));
            }
        }
        Ok(())
    }

    /// Adds rows `start..end` of `other` at the end.
    ///
    /// # Errors
    /// [`LearnError::Action`] if `other` is of another kind or width.
    pub fn extend_rows(&mut self, other: &Self, start: usize, end: usize) -> Result<(), LearnError> {
        match (self, other) {
            (Self::Discrete(to), Self::Discrete(from)) => to.extend_from_slice(&from[start..end]),
            (Self::Continuous { dim, values }, Self::Continuous { dim: d, values: from }) if dim == d => {
                values.extend_from_slice(&from[start * *d..end * *d]);
            }
            (all, other) => {
                return Err(LearnError::Action(format!("{} among {}", other.kind(), all.kind())));
            }
        }
        Ok(())
    }

    /// Puts row `row` of `other` at `at`, in place of the action there or behind the last one.
    ///
    /// # Errors
    /// [`LearnError::Action`] if `other` is of another kind or width.
    pub(crate) fn write(&mut self, at: usize, other: &Self, row: usize) -> Result<(), LearnError> {
        if at == self.len() {
            return self.extend_rows(other, row, row + 1);
        }
        match (self, other) {
            (Self::Discrete(to), Self::Discrete(from)) => to[at] = from[row],
            (Self::Continuous { dim, values }, Self::Continuous { dim: d, values: from }) if dim == d => {
                values[at * *d..(at + 1) * *d].copy_from_slice(&from[row * *d..(row + 1) * *d]);
            }
            (all, other) => {
                return Err(LearnError::Action(format!("{} among {}", other.kind(), all.kind())));
            }
        }
        Ok(())
    }

    /// Returns the actions at `rows`, in that order.
    pub(crate) fn gather(&self, rows: &[usize]) -> Self {
        match self {
            Self::Discrete(values) => Self::Discrete(rows.iter().map(|&r| values[r]).collect()),
            Self::Continuous { dim, values } => {
                let mut out = Vec::with_capacity(rows.len() * dim);
                for &r in rows {
                    out.extend_from_slice(&values[r * dim..(r + 1) * dim]);
                }
                Self::Continuous { dim: *dim, values: out }
            }
        }
    }

    fn kind(&self) -> String {
        match self {
            Self::Discrete(_) => "discrete actions".to_owned(),
            Self::Continuous { dim, .. } => format!("continuous actions of width {dim}"),
        }
    }
}

/// The inputs and outputs of a policy.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct PolicySpec {
    /// The kind of its observations.
    // Checkpoints of vectors were written before there were images.
    #[serde(alias = "obs_dim")]
    pub obs: ObsKind,
    /// Width of the skill before it; 0 for a policy without skills.
    pub latent: usize,
    /// Its action space.
    pub action_space: ActionSpace,
}

impl PolicySpec {
    /// Checks that it has at least one input and one action.
    ///
    /// # Errors
    /// [`LearnError::Config`] if it has not.
    pub(crate) fn validate(&self) -> Result<(), LearnError> {
        if self.obs.numbers() == 0 || self.action_space.dim() == 0 {
            return Err(LearnError::Config("observations and actions must not be empty".to_owned()));
        }
        Ok(())
    }
}

/// The value behind a step that reached the time limit.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum TimeLimit {
    /// The value of the episode's last observation: the game would have gone on.
    Bootstrap,
    /// Zero, as if the episode had ended by itself (the released code).
    Legacy,
}
