//! `playbot explore`.

mod chart;
mod one_level;
mod recorded;
mod talents;
mod verb;

pub use talents::Talents;
pub use verb::{Args, run};
