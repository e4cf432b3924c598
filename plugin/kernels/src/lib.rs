//! Layers of neural networks on CPUs, as operations of [burn](https://burn.dev).
//!
//! The operations are for the backends whose numbers are in host memory (flex and ndarray). Other backends, such as
//! graphics cards, compute the same layers by burn's own tensors, which are also the oracle of the tests. The numbers have
//! the same bits on any number of threads and on every processor.
//!
//! The modules, in reading order:
//!
//! - [`host_ops`]: tanh, log-softmax and recurrent layers, for both backends.
//! - [`dense`]: the dense layers of a network as one operation, for flex.
//! - [`trunk`]: the convolutions of an image encoder as one operation, for flex.
//! - [`pool`]: mean and maximum over groups of rows, for both backends.
//! - [`elementwise`]: activations over slices, written for vector instructions.
//! - [`instructions`]: the vector instructions of the loops, on which no number depends.
//! - [`host_numbers`]: conversion between tensors and numbers in host memory.
//! - [`among_workers`]: the threads on which the loops run.
//! - [`kept_memory`]: memory and weights that one pass hands to the next.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod among_workers;
pub mod dense;
pub mod elementwise;
mod gru_scan;
pub mod host_numbers;
pub mod host_ops;
pub mod instructions;
pub mod kept_memory;
pub mod pool;
mod tile;
pub mod trunk;

pub use crate::{host_numbers::known_gradient, kept_memory::KeptMemory};
