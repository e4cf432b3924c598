//! `playbot view`.

mod caption;
pub mod film;
pub mod font;
mod numbers;
mod options;
pub mod screen;
mod stage;
mod verb;

pub use verb::{Args, run};
