//! `playbot test`.

mod testers;
mod told;
mod verb;

pub use told::{Results, tell_results};
pub use verb::{Args, run};
