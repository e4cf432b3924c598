//! `playbot explore`.

mod chart;
mod failed;
mod recorded;
mod talents;
mod verb;

pub use talents::Talents;
pub use verb::{Args, run};
