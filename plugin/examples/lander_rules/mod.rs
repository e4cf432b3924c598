//! The lander: the part that a shipped game and its training share.

pub mod rules;
