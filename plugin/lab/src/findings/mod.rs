//! Findings as files: a detector's message, the actions that lead to it, and the check whether it still happens.
//!
//! - A [`StoredFinding`] is a recording of one episode, up to the tick of the finding. Its note is the [`FindingHead`]:
//!   tester, detector, message, tick and state hash.
//! - [`recheck()`] replays the actions in a World of their own and runs the detector's [`Check`]. [`Checks`] has them
//!   by name, and [`Checks::with`] adds one.
//! - [`minimise()`] leaves out actions that are not needed: ddmin (Zeller and Hildebrandt, Simplifying and isolating
//!   failure-inducing input, 2002).
//! - [`FindingFiles`] writes findings during a test. [`regress()`] replays all findings of a folder, with [`Pins`] for
//!   known ones.

mod actions;
mod breakage;
mod check;
mod checks;
mod course;
mod date;
mod ddmin;
mod detected;
mod error;
mod failure;
mod file_name;
mod folder;
mod head;
mod keep;
mod lengths;
mod look;
mod minimise;
mod moment;
mod pins;
mod play;
mod playable;
mod recheck;
mod regress;
mod scan;
mod seen_from;
mod settings;
mod solo;
mod status;
mod stored;
#[cfg(test)]
mod testing;

pub use breakage::Breakage;
pub(crate) use breakage::detector_of;
pub use check::Check;
pub use checks::Checks;
pub(crate) use course::{course_of, keeps_course};
pub use date::{Date, DateError};
pub use error::FindingError;
pub use folder::{FINDINGS, clear_findings, gather_findings, list_findings};
pub use head::FindingHead;
pub use keep::{FindingFiles, Played, SeenFinding, SeenLevel};
pub(crate) use lengths::{Lengths, actions_of, lengths};
pub use minimise::{Budget, Minimised, minimise};
pub use moment::{Moment, Watcher};
pub use pins::{PINS, Pin, PinState, Pins};
pub use play::Replayed;
pub use playable::Unplayable;
pub use recheck::{Recheck, Sighting, recheck};
pub use regress::{Regress, RegressRow, Regression, regress, regress_until};
pub(crate) use scan::scan;
pub use status::FindingStatus;
pub use stored::StoredFinding;
