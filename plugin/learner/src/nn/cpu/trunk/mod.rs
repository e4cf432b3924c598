//! All convolutions of an image encoder as one operation, for the flex backend.
//!
//! burn's convolutions write every window of an image before they multiply it, and every layer reads and writes the
//! whole batch. Here each image goes through all layers while it is in the cache, and the products read the windows
//! in place. Pixels lie with their channels last, in borders of zeros, so that a row of a window is contiguous. The
//! gradient of a layer's input is a convolution again (or, with strides, a sum of such rows).
//!
//! An image's features do not depend on the rest of the batch, and nothing depends on the number of threads.

mod backward;
mod forward;
mod grid;
mod group;
mod layer;
mod op;
mod plan;
mod points;
mod pool;
mod products;
mod shape;
mod stage;
#[cfg(test)]
mod tests;
mod winograd;
mod workspace;

pub use shape::window_places;
pub(in crate::nn) use stage::{Conv, Stage, forward as features};
