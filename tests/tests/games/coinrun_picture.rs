//! Tests of CoinRun's picture: sprites and tiles follow the game, and nothing else changes.

mod arena;
mod arenas;
mod puffs;
mod sprites;
