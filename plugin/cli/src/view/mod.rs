//! `playbot view`.

mod caption;
pub mod film;
pub mod font;
mod options;
pub mod screen;
mod stage;
mod verb;

pub use verb::{Args, run};
