//! `playbot view`.

mod caption;
mod colours;
pub mod episode_world;
pub mod film;
pub mod font;
pub mod numbers;
mod options;
pub mod screen;
mod verb;
mod written_picture;

pub use verb::{Args, run};
