//! The memory of a policy, between its observations and the layers of actor and critic.

use crate::{
    device::send,
    nn::{Gru, ParamSource, ParamVisitor, Parameters},
    policy::NetInput,
    settings::{Number, Numbers},
};
use burn::tensor::{Device, Int, Tensor, TensorData};
use serde::{Deserialize, Serialize};

/// The memory of a policy and its critic.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub enum MemoryKind {
    /// Actions and values depend on the present observation alone.
    #[default]
    None,
    /// One gated recurrent layer, [`Gru`], which actor and critic share. It is reset with the episode.
    Gru {
        /// Numbers that are remembered from tick to tick.
        hidden: usize,
        /// Most ticks through which a gradient reaches back.
        #[serde(default = "default_sequence")]
        sequence: usize,
        /// Ticks of the same episode before a sequence that bring the stored state up to the present weights.
        #[serde(default)]
        burn_in: usize,
    },
    /// The vectors of the last ticks of the episode, this one included; zeros before its beginning. Pictures have
    /// `image.stack`.
    Stack {
        /// Number of vectors.
        ticks: usize,
    },
}

fn default_sequence() -> usize {
    32
}

impl MemoryKind {
    /// Returns the form of the memory; `None` without.
    pub(crate) fn shape(&self) -> Option<MemoryShape> {
        match *self {
            Self::None => None,
            Self::Gru { hidden, .. } => Some(MemoryShape::Gru { hidden }),
            Self::Stack { ticks: ..=1 } => None,
            Self::Stack { ticks } => Some(MemoryShape::Stack { ticks }),
        }
    }

    /// Returns the most ticks of a sequence, and those of its burn-in; `None` without memory.
    pub(crate) fn sequences(&self) -> Option<(usize, usize)> {
        match *self {
            Self::None => None,
            Self::Gru { sequence, burn_in, .. } => Some((sequence, burn_in)),
            Self::Stack { ticks: ..=1 } => None,
            // No gradient reaches back.
            Self::Stack { .. } => Some((1, 0)),
        }
    }
}

/// The sizes that must not be 0.
impl Numbers for MemoryKind {
    fn numbers(&self) -> Vec<Number> {
        match *self {
            Self::None => Vec::new(),
            Self::Gru { hidden, sequence, .. } => vec![Number::Whole(hidden as u64), Number::Whole(sequence as u64)],
            Self::Stack { ticks } => vec![Number::Whole(ticks as u64)],
        }
    }
}

/// The form of an actor's memory, as files describe it.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) enum MemoryShape {
    Gru { hidden: usize },
    Stack { ticks: usize },
}

impl MemoryShape {
    /// Returns the numbers that are remembered beside observations (or features) of this width.
    pub(crate) fn width(self, seen: usize) -> usize {
        match self {
            Self::Gru { hidden } => hidden,
            Self::Stack { ticks } => ticks.saturating_sub(1).saturating_mul(seen),
        }
    }

    /// Returns the width of the observations, of which and of the memory `both` is the sum.
    pub(crate) fn seen(self, both: usize) -> usize {
        match self {
            Self::Gru { hidden } => both.saturating_sub(hidden),
            Self::Stack { ticks } => both / ticks.max(1),
        }
    }
}

/// A memory whose numbers join the observation: `[z, s]` becomes `[z, s, m]`.
#[derive(Clone, Debug)]
pub enum Memory {
    /// A recurrent layer.
    Gru(Gru),
    /// The observations before this one, the newest first.
    Stack {
        /// Number of observations, this one included.
        ticks: usize,
        /// Numbers of an observation.
        seen: usize,
    },
}

impl Memory {
    /// Creates a memory over skills and observations of these widths, with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        (latent, seen): (usize, usize),
        shape: MemoryShape,
    ) -> Result<Self, S::Error> {
        Ok(match shape {
            MemoryShape::Gru { hidden } => {
                Self::Gru(Gru::build(source, prefix, latent.saturating_add(seen), hidden, 1, false)?)
            }
            MemoryShape::Stack { ticks } => Self::Stack { ticks, seen },
        })
    }

    /// Returns its form.
    pub(crate) fn shape(&self) -> MemoryShape {
        match self {
            Self::Gru(_) => MemoryShape::Gru { hidden: self.width() },
            Self::Stack { ticks, .. } => MemoryShape::Stack { ticks: *ticks },
        }
    }

    /// Returns the numbers that it remembers.
    pub fn width(&self) -> usize {
        match self {
            Self::Gru(gru) => gru.layers.first().map_or(0, |layer| layer.weight_hh.dims()[1]),
            Self::Stack { seen, .. } => self.shape().width(*seen),
        }
    }

    /// Remembers one tick of many agents. Takes joined inputs `[n, latent + obs_dim]` and the states before them,
    /// `[n, width]`; returns the inputs with the memory behind them, and the states after.
    pub fn step(&self, x: Tensor<2>, states: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        match self {
            Self::Gru(gru) => {
                let after = run(gru, x.clone(), 1, states);
                (Tensor::cat(vec![x, after.clone()], 1), after)
            }
            Self::Stack { seen, .. } => {
                let (inputs, width) = (x.dims()[1], states.dims()[1]);
                let both = Tensor::cat(vec![x.clone().narrow(1, inputs - seen, *seen), states.clone()], 1);
                (Tensor::cat(vec![x, states], 1), both.narrow(1, 0, width))
            }
        }
    }

    /// Returns joined inputs, `[n, latent + obs_dim]`, with the memory of each behind them.
    pub(crate) fn recall(&self, x: Tensor<2>, recall: &Recall, initial: Tensor<2>) -> Tensor<2> {
        let states = match self {
            Self::Gru(gru) => run(gru, x.clone().select(0, recall.grid.rows.clone()), recall.grid.steps, initial),
            // Each row is a sequence of its own.
            Self::Stack { .. } => initial,
        };
        Tensor::cat(vec![x, states.select(0, recall.places.clone())], 1)
    }

    /// Returns the states, `[S, width]`, before sequences that begin behind the joined inputs `x` of their burn-in.
    pub(crate) fn warm(&self, x: Tensor<2>, burn_in: &BurnIn, initial: Tensor<2>) -> Tensor<2> {
        let Self::Gru(gru) = self else { return initial };
        let states = run(gru, x.select(0, burn_in.grid.rows.clone()), burn_in.grid.steps, initial.clone());
        Tensor::cat(vec![initial, states], 0).select(0, burn_in.last.clone())
    }
}

/// Returns the states after each tick of sequences side by side, `[steps * S, width]`, row `t * S + s`.
fn run(gru: &Gru, x: Tensor<2>, steps: usize, initial: Tensor<2>) -> Tensor<2> {
    gru.forward(x, steps, Some(vec![initial.unsqueeze_dim(0)])).0
}

impl Parameters for Memory {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        if let Self::Gru(gru) = self {
            gru.visit(prefix, visitor);
        }
    }
}

/// The sequences to which the rows of a minibatch belong.
#[derive(Clone, Debug)]
pub struct Recall {
    /// State before each sequence, `[S, width]`; with a burn-in, before that.
    pub(crate) initial: Tensor<2>,
    pub(crate) grid: Grid,
    /// Place of each row in the grid, `[n]`.
    pub(crate) places: Tensor<1, Int>,
    /// The ticks before the sequences, if any of them are read again.
    pub(crate) burn_in: Option<BurnIn>,
}

impl Recall {
    /// Creates the sequences of these lengths, whose rows follow one another, from the states before them, `[S, width]`.
    pub fn new(initial: Tensor<2>, lengths: &[usize]) -> Self {
        let device = initial.device();
        let (grid, places) = Grid::of(lengths, &device);
        Self { initial, grid, places: send_rows(&places, &device), burn_in: None }
    }
}

/// Sequences side by side, as long as the longest one. Places behind the end of a sequence repeat one of its rows, and
/// are never read.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    /// The row at each place, `[steps * S]`, place `t * S + s`.
    pub(crate) rows: Tensor<1, Int>,
    pub(crate) steps: usize,
}

impl Grid {
    /// Returns the grid of sequences of these lengths, whose rows follow one another, and the place of each row in it.
    pub(crate) fn of(lengths: &[usize], device: &Device) -> (Self, Vec<usize>) {
        let (count, steps) = (lengths.len(), lengths.iter().copied().max().unwrap_or_default());
        let (mut rows, mut places, mut first) = (vec![0; steps * count], Vec::new(), 0);
        for (s, &len) in lengths.iter().enumerate() {
            for t in 0..len {
                rows[t * count + s] = first + t;
                places.push(t * count + s);
            }
            first += len;
        }
        (Self { rows: send_rows(&rows, device), steps }, places)
    }
}

/// Sends numbers of rows to a device.
pub(crate) fn send_rows(rows: &[usize], device: &Device) -> Tensor<1, Int> {
    let numbers: Vec<i32> = rows.iter().map(|&row| row as i32).collect();
    send(TensorData::new(numbers, [rows.len()]), device)
}

/// The ticks before each sequence. They have no gradient.
#[derive(Clone, Debug)]
pub(crate) struct BurnIn {
    pub(crate) inputs: NetInput,
    pub(crate) grid: Grid,
    /// Where the state before each sequence is, `[S]`: rows `0..S` are the states before the burn-in, the others those
    /// of the grid.
    pub(crate) last: Tensor<1, Int>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;

    #[test]
    fn shorter_sequences_leave_places_free() {
        let (grid, places) = Grid::of(&[2, 0, 3], &DeviceKind::Flex.plain());
        assert_eq!((grid.steps, places), (3, vec![0, 3, 2, 5, 8]));
        let rows: Vec<i32> = grid.rows.into_data().try_into_vec().expect("whole numbers");
        assert_eq!(rows, [0, 0, 2, 1, 0, 3, 0, 0, 4]);
    }
}
