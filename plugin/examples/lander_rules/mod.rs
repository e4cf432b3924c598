//! The lander: what a shipped game and the laboratory share.

pub mod rules;
