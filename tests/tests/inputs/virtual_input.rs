//! An agent's action presses keys: when games see it, on both routes, however ticks and frames fall.

mod gamepad;
mod keys;
mod mouse;
mod scripted;
