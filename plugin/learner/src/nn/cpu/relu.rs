//! The rectifier of one number, and its gradient.

/// The number if it is positive, otherwise 0; NaN stays NaN.
#[inline(always)]
pub(super) fn relu(x: f32) -> f32 {
    if x < 0.0 { 0.0 } else { x }
}

/// The gradient of [`relu`], where it gave `value`.
#[inline(always)]
pub(super) fn relu_backward(value: f32, grad: f32) -> f32 {
    if value <= 0.0 { 0.0 } else { grad }
}
