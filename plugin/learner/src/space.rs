//! Action spaces and actions.

use crate::{Choices, LearnError, MOST_CHOICES, MixedSpace, ObsKind};
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
    /// Several choices at once, with or without a vector of numbers: [`mixed`](Self::mixed).
    Mixed(MixedSpace),
}

impl ActionSpace {
    /// Creates a space of several choices at once and a vector of `numbers`, as in `Continuous`. Each part is drawn by
    /// itself: probabilities are multiplied, and entropies and divergences are added.
    ///
    /// ```
    /// use playbot_learner::ActionSpace;
    ///
    /// // Left, right or neither; jump or not; and an angle.
    /// let space = ActionSpace::mixed([3, 2], 1);
    /// assert_eq!((space.dim(), space.options(), space.numbers()), (6, 5, 1));
    /// ```
    pub fn mixed<const CHOICES: usize>(sizes: [usize; CHOICES], numbers: usize) -> Self {
        const { assert!(CHOICES <= MOST_CHOICES, "an agent makes at most 16 choices in one step") };
        let choices = Choices::new(&sizes).unwrap_or_default();
        Self::Mixed(MixedSpace { choices, numbers })
    }

    /// Returns the number of outputs of a network that acts in this space: the choices, or the vector's length. In a
    /// mixed space these are the options of all choices, and then the numbers.
    pub fn dim(&self) -> usize {
        match *self {
            Self::Discrete(n) | Self::Continuous(n) => n,
            Self::Mixed(mixed) => mixed.dim(),
        }
    }

    /// Returns the choices of a step: one in a discrete space, none in a continuous one.
    pub fn choices(&self) -> Choices {
        match *self {
            Self::Discrete(n) => Choices::one(n),
            Self::Continuous(_) => Choices::default(),
            Self::Mixed(mixed) => mixed.choices,
        }
    }

    /// Returns the options of all choices together.
    pub fn options(&self) -> usize {
        match *self {
            Self::Discrete(n) => n,
            Self::Continuous(_) => 0,
            Self::Mixed(mixed) => mixed.choices.options(),
        }
    }

    /// Returns the length of the vector of numbers in an action.
    pub fn numbers(&self) -> usize {
        match *self {
            Self::Discrete(_) => 0,
            Self::Continuous(n) => n,
            Self::Mixed(mixed) => mixed.numbers,
        }
    }

    /// Returns the entries that a mask has for each state: one for each option, and with numbers one more. That last
    /// one is false where the numbers are no choice of the agent: the game holds those of an earlier tick.
    pub fn mask_width(&self) -> usize {
        self.options() + usize::from(self.numbers() > 0)
    }

    /// Returns an action of it, for want of another one: the first options, and zeros.
    pub fn first(&self) -> ActionValue {
        match *self {
            Self::Discrete(_) => ActionValue::Discrete(0),
            Self::Continuous(n) => ActionValue::Continuous(vec![0.0; n]),
            Self::Mixed(MixedSpace { choices, numbers }) => {
                ActionValue::Mixed { choices: vec![0; choices.sizes().len()], numbers: vec![0.0; numbers] }
            }
        }
    }

    /// Returns whether it holds no action.
    pub fn is_empty(&self) -> bool {
        match *self {
            Self::Discrete(n) | Self::Continuous(n) => n == 0,
            Self::Mixed(mixed) => mixed.is_empty(),
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
            (Self::Mixed(mixed), Actions::Mixed { choices, .. }) => {
                if mixed.choices.sizes().len() != *choices {
                    return Err(LearnError::Action(format!("{choices} choices at once, expected {self}")));
                }
                let misfit = |row| mixed.misfit(actions.chosen(row), actions.vector(row));
                match (0..actions.len()).find_map(|row| Some((row, misfit(row)?))) {
                    None => Ok(()),
                    Some((row, why)) => Err(LearnError::Action(format!("row {row}: {why}"))),
                }
            }
            (space, _) => Err(LearnError::Action(format!("wrong kind for {space}"))),
        }
    }
}

/// Writes it as `15 discrete actions`, `continuous actions of 2 numbers`, `actions of 2 choices (3 x 2) and 1 number`.
impl fmt::Display for ActionSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.dim() == 1 { "" } else { "s" };
        match self {
            Self::Discrete(n) => write!(f, "{n} discrete action{plural}"),
            Self::Continuous(n) => write!(f, "continuous actions of {n} number{plural}"),
            Self::Mixed(MixedSpace { choices, numbers }) => {
                let sizes: Vec<String> = choices.sizes().iter().map(u32::to_string).collect();
                let of = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
                write!(f, "actions of {} ({})", of(sizes.len(), "choice"), sizes.join(" x "))?;
                if *numbers > 0 { write!(f, " and {}", of(*numbers, "number")) } else { Ok(()) }
            }
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
    /// Several choices and a vector.
    Mixed {
        /// The option taken of each choice.
        choices: Vec<u32>,
        /// The vector; empty without one.
        numbers: Vec<f32>,
    },
}

impl ActionValue {
    /// Returns the option taken of each choice: one of a discrete action, none of a continuous one.
    pub fn options(&self) -> &[u32] {
        match self {
            Self::Discrete(index) => std::slice::from_ref(index),
            Self::Continuous(_) => &[],
            Self::Mixed { choices, .. } => choices,
        }
    }

    /// Returns the vector of numbers; empty for a discrete action.
    pub fn numbers(&self) -> &[f32] {
        match self {
            Self::Discrete(_) => &[],
            Self::Continuous(numbers) | Self::Mixed { numbers, .. } => numbers,
        }
    }
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
    /// Several choices and a vector each.
    Mixed {
        /// Choices of each action.
        choices: usize,
        /// The options taken, `choices` per action.
        options: Vec<u32>,
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
            ActionSpace::Mixed(MixedSpace { choices, numbers }) => {
                Self::Mixed { choices: choices.sizes().len(), options: Vec::new(), dim: numbers, values: Vec::new() }
            }
        }
    }

    /// Returns the actions one by one.
    pub fn iter(&self) -> impl Iterator<Item = ActionValue> + '_ {
        (0..self.len()).filter_map(|row| self.get(row))
    }

    /// Returns the number of actions.
    pub fn len(&self) -> usize {
        match self {
            Self::Discrete(values) => values.len(),
            Self::Continuous { dim, values } => values.len() / (*dim).max(1),
            Self::Mixed { choices: 0, dim, values, .. } => values.len() / (*dim).max(1),
            Self::Mixed { choices, options, .. } => options.len() / choices,
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
            Self::Mixed { options, values, .. } => {
                options.clear();
                values.clear();
            }
        }
    }

    /// Returns the action of row `row`, if there is one.
    pub fn get(&self, row: usize) -> Option<ActionValue> {
        match self {
            Self::Discrete(values) => values.get(row).copied().map(ActionValue::Discrete),
            Self::Continuous { dim, values } => {
                values.get(row * dim..(row + 1) * dim).map(|v| ActionValue::Continuous(v.to_vec()))
            }
            Self::Mixed { .. } => (row < self.len())
                .then(|| ActionValue::Mixed { choices: self.chosen(row).to_vec(), numbers: self.vector(row).to_vec() }),
        }
    }

    /// Returns the options of row `row`: one of a discrete action, none of a continuous one.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn chosen(&self, row: usize) -> &[u32] {
        match self {
            Self::Discrete(values) => &values[row..=row],
            Self::Continuous { .. } => &[],
            Self::Mixed { choices, options, .. } => &options[row * choices..(row + 1) * choices],
        }
    }

    /// Returns the vector of row `row`; empty of a discrete action.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn vector(&self, row: usize) -> &[f32] {
        match self {
            Self::Discrete(_) => &[],
            Self::Continuous { dim, values } | Self::Mixed { dim, values, .. } => &values[row * dim..(row + 1) * dim],
        }
    }

    /// Keeps the first `n` actions.
    pub fn truncate(&mut self, n: usize) {
        match self {
            Self::Discrete(values) => values.truncate(n),
            Self::Continuous { dim, values } => values.truncate(n.saturating_mul(*dim)),
            Self::Mixed { choices, options, dim, values } => {
                options.truncate(n.saturating_mul(*choices));
                values.truncate(n.saturating_mul(*dim));
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
            (Self::Mixed { choices, options, dim, values }, ActionValue::Mixed { choices: taken, numbers })
                if (taken.len(), numbers.len()) == (*choices, *dim) =>
            {
                options.extend_from_slice(taken);
                values.extend_from_slice(numbers);
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
            (
                Self::Mixed { choices, options, dim, values },
                Self::Mixed { choices: c, options: from, dim: d, values: numbers },
            ) if (&*choices, &*dim) == (c, d) => {
                options.extend_from_slice(&from[start * *c..end * *c]);
                values.extend_from_slice(&numbers[start * *d..end * *d]);
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
            (Self::Mixed { choices, options, dim, values }, Self::Mixed { choices: c, dim: d, .. })
                if (&*choices, &*dim) == (c, d) =>
            {
                options[at * *c..(at + 1) * *c].copy_from_slice(other.chosen(row));
                values[at * *d..(at + 1) * *d].copy_from_slice(other.vector(row));
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
            Self::Mixed { choices, dim, .. } => Self::Mixed {
                choices: *choices,
                options: rows.iter().flat_map(|&r| self.chosen(r)).copied().collect(),
                dim: *dim,
                values: rows.iter().flat_map(|&r| self.vector(r)).copied().collect(),
            },
        }
    }

    fn kind(&self) -> String {
        match self {
            Self::Discrete(_) => "discrete actions".to_owned(),
            Self::Continuous { dim, .. } => format!("continuous actions of width {dim}"),
            Self::Mixed { choices, dim, .. } => format!("actions of {choices} choices and {dim} numbers"),
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
        if self.obs.numbers() == 0 || self.action_space.is_empty() {
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
