//! All pictures of CoinRun, made anew from their sources.

mod backdrop;
mod canvas;
mod pictures;
mod scenes;
mod sheet;
mod sprite_text;

pub use canvas::Canvas;
pub use pictures::pictures;
