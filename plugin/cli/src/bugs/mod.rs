//! `playbot bugs`.

mod make;
mod score;
mod table;
mod testers;
mod verb;

pub use verb::{Args, run};
