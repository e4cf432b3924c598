//! AntMaze as a game: what is seen, paid and ended, and that it is the same every time.

mod actions;
mod arena;
mod determinism;
mod episodes;
mod picture;
mod players;
