//! The rectifier of one number, and its gradient.

/// Returns the number if it is positive, otherwise 0; NaN stays NaN.
#[inline(always)]
pub(super) fn relu(x: f32) -> f32 {
    if x < 0.0 { 0.0 } else { x }
}

/// Returns the gradient of [`relu`] where its result was `value`.
#[inline(always)]
pub(super) fn relu_backward(value: f32, grad: f32) -> f32 {
    if value <= 0.0 { 0.0 } else { grad }
}
