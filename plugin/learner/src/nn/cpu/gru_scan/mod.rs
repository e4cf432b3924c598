//! A GRU layer over all its steps, forward and backward, in plain loops.
//!
//! Compared with a graph of tensor operations this saves the copies of gates and states. The gradients of the weights
//! are one product over all steps. The two directions are computed at the same time; within a direction nothing
//! depends on the number of threads.
//!
//! With a = x W_i + b_i and c = h W_h + b_h for each gate (see [`crate::nn::Gru`]): r = σ(a_r + c_r), z = σ(a_z + c_z),
//! n = tanh(a_n + r c_n), h' = n + z (h - n).

mod backward;
mod forward;
mod scan;

pub(super) use backward::{ScanGrads, Wanted, backward};
pub(super) use forward::forward;
use scan::Direction;
pub(super) use scan::{Scan, ScanInput, Sizes};
