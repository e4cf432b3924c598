//! Where the numbers are computed: the CPU, or a graphics card in a build that has it.

mod guard;
mod kind;
mod probe;

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use guard::caught;
pub(crate) use guard::{guarded, update_on};
pub(crate) use kind::is_host;
pub use kind::{DeviceKind, UnknownDevice};
