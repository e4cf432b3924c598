//! Compute devices: the CPU, or a graphics card in a build that supports it.

mod guard;
mod kind;
mod probe;

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use guard::caught;
pub(crate) use guard::{guarded, update_on};
pub(crate) use crate::nn::is_host;
pub use kind::{DeviceKind, UnknownDevice};
