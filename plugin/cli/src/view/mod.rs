//! `playbot view`.

mod caption;
mod colours;
pub mod film;
pub mod font;
mod numbers;
mod options;
pub mod screen;
mod stage;
mod told;
mod verb;

pub use verb::{Args, run};
