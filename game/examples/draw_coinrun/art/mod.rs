//! All pictures of CoinRun, made anew from their sources.

mod backdrop;
pub mod canvas;
mod pictures;
mod scenes;
mod sheet;
mod sprite_text;

pub use pictures::pictures;
