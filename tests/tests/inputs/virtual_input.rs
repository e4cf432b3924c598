//! Tests of keys pressed by an agent's action: the time at which games see them, on both routes, at any rate of ticks
//! and frames.

mod gamepad;
mod keys;
mod mouse;
mod scripted;
