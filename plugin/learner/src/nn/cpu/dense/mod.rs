//! A dense layer with its activation as one operation, for the flex backend.
//!
//! burn writes what a product gives, reads it to add the bias, and reads it again for the activation; each of these is a
//! node of the gradient graph of its own. Here the sums start from the bias, and the activation is taken while they are
//! in the cache. Gradients of weights, biases and input come from one node.
//!
//! A row of the output does not depend on the rest of the batch, every sum is made by one thread in an order of its own, and
//! so nothing depends on the number of threads.

mod backward;
mod forward;
mod op;
mod packed;
mod share;
#[cfg(test)]
mod tests;

pub(super) use backward::SumGrads;
pub(super) use forward::product_into;
pub(in crate::nn) use op::dense;
pub(super) use packed::Packed;
