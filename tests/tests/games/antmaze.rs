//! Tests of AntMaze as a game: observations, rewards, ends, and determinism.

mod actions;
mod arena;
mod determinism;
mod episodes;
mod picture;
mod players;
