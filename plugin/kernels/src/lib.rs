//! Kernels for the backends whose numbers are in host memory: tanh, probabilities of choices and recurrent layers;
//! and, for flex alone, dense layers and the convolutions of an image encoder.

pub mod among_workers;
pub mod dense;
pub mod elementwise;
mod gru_scan;
pub mod host_numbers;
pub mod kept_memory;
pub mod kernels;
mod tile;
pub mod trunk;

pub use crate::{host_numbers::known_gradient, kept_memory::KeptMemory};
