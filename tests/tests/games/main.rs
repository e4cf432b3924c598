//! Tests of CoinRun, the mazes and the ants as games of Bevy.

mod antmaze;
mod coinrun;
mod coinrun_picture;
mod maze2d;
mod maze2d_picture;
mod maze2d_training;
mod registry;
mod senses;
