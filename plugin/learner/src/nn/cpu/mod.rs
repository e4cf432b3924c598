//! Kernels for the backends whose numbers are in host memory: tanh, probabilities of choices and recurrent layers;
//! and, for flex alone, dense layers and the convolutions of an image encoder.

pub(in crate::nn) mod dense;
pub(in crate::nn) mod fast_math;
mod gru_scan;
mod host_numbers;
mod kept_memory;
pub(in crate::nn) mod kernels;
mod known_gradient;
mod log_softmax;
mod outer;
mod relu;
pub(in crate::nn) mod share;
mod store;
mod tile;
pub(in crate::nn) mod trunk;

pub(in crate::nn) use kept_memory::KeptMemory;
pub(crate) use host_numbers::is_host;
pub(crate) use known_gradient::known_gradient;
