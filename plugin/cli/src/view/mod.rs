//! `playbot view`.

mod caption;
mod colours;
mod episode_world;
pub mod film;
pub mod font;
mod numbers;
mod options;
pub mod screen;
mod verb;
mod written_picture;

pub use verb::{Args, run};
