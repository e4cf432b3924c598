//! Tests of CoinRun, the mazes and the ants as games of Bevy.

#![allow(clippy::disallowed_methods, reason = "tests compare with the system's functions")]

mod antmaze;
mod coinrun;
mod coinrun_picture;
mod maze2d;
mod maze2d_picture;
mod maze2d_training;
mod registry;
mod senses;
