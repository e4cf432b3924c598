//! Loops of our own for the backends whose numbers are in host memory: tanh, the recurrent part of a GRU layer, and the
//! convolutions of an image encoder.

pub(in crate::nn) mod fast_math;
mod gru_scan;
pub(in crate::nn) mod kernels;
pub(in crate::nn) mod trunk;
