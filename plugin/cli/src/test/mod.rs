//! `playbot test`.

mod detectors;
mod findings;
mod regress;
mod testers;
mod told;
mod verb;

pub use told::{Results, tell_results};
pub use verb::{Args, run};
