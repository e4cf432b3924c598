//! The encoder's representation of actions.

use crate::{ActionSpace, Actions, LearnError};
use serde::{Deserialize, Serialize};

/// The encoder's representation of a discrete action. Continuous ones are read unchanged.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum ActionInput {
    /// One number per choice: 1 for the one taken, else 0.
    #[default]
    OneHot,
    /// The number of the choice divided by that of the last one, in 0..1 (the paper's released code for CoinRun).
    ScaledIndex,
}

impl ActionInput {
    /// Returns the width of an action of `space`.
    pub fn width(self, space: ActionSpace) -> usize {
        match (self, space) {
            (Self::ScaledIndex, ActionSpace::Discrete(_)) => 1,
            _ => space.dim(),
        }
    }

    /// Returns `actions` of `space` as the encoder reads them, row-major, `[n, width]`.
    ///
    /// # Errors
    /// [`LearnError::Action`] names the first action that is not in `space`.
    pub fn encode(self, actions: &Actions, space: ActionSpace) -> Result<Vec<f32>, LearnError> {
        space.check(actions)?;
        Ok(match (actions, self) {
            (Actions::Continuous { values, .. }, _) => values.clone(),
            (Actions::Discrete(values), Self::OneHot) => {
                let dim = space.dim();
                let mut out = vec![0.0; values.len() * dim];
                for (row, &a) in values.iter().enumerate() {
                    out[row * dim + a as usize] = 1.0;
                }
                out
            }
            (Actions::Discrete(values), Self::ScaledIndex) => {
                let last = space.dim().saturating_sub(1).max(1) as f64;
                values.iter().map(|&a| (f64::from(a) / last) as f32).collect()
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_form_by_hand() {
        let encode = |input: ActionInput, actions, space| input.encode(actions, space).expect("in the space");
        let (space, actions) = (ActionSpace::Discrete(3), Actions::Discrete(vec![2, 1]));
        assert_eq!(encode(ActionInput::OneHot, &actions, space), [0.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
        assert_eq!(encode(ActionInput::ScaledIndex, &actions, space), [1.0, 0.5]);
        let outside = ActionInput::OneHot.encode(&Actions::Discrete(vec![0, 3]), space);
        assert!(matches!(outside, Err(LearnError::Action(text)) if text.contains("row 1")));
        let (space, actions) = (ActionSpace::Continuous(2), Actions::Continuous { dim: 2, values: vec![0.3, -2.0] });
        for input in [ActionInput::OneHot, ActionInput::ScaledIndex] {
            assert_eq!(input.width(space), 2);
            assert_eq!(encode(input, &actions, space), [0.3, -2.0]);
        }
        assert_eq!(encode(ActionInput::ScaledIndex, &Actions::Discrete(vec![0]), ActionSpace::Discrete(1)), [0.0]);
    }
}
