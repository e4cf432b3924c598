//! Dense layers with their activations, one after the other, as one operation for the flex backend.
//!
//! burn writes a product's result, reads it to add the bias, and reads it again for the activation. Each of these is
//! a node of the gradient graph. Here a few rows at a time go through all layers while they are in the cache, and
//! back again; one node gives all gradients. Threads synchronise five times in total, however many layers there are,
//! so small networks can be shared, too.
//!
//! A row of the output does not depend on the rest of the batch. Every sum is made by one thread in a fixed order, so
//! nothing depends on the number of threads.

mod backward;
mod forward;
mod op;
mod packed;
mod params;
mod sum_grads;
#[cfg(test)]
mod tests;

pub(super) use forward::product_into;
pub(in crate::nn) use op::{Dense, dense};
pub(super) use packed::{Matrix, Packed};
pub(super) use params::{LayerSums, param_grads};
pub(super) use sum_grads::SumGrads;
