//! Planted defects, what testers find of them, and how verdicts agree with people.

pub mod bugs;
pub mod calibration;
mod scatter;
pub mod score;
