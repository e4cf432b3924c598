//! Findings as files: what a detector found, the actions that lead there, and whether they still do.
//!
//! - A [`StoredFinding`] is a recording of one episode, up to the tick in which something was found. Its note holds the
//!   [`FindingHead`]: who found what, where, and with which state hash.
//! - [`recheck()`] plays the actions again in a World of their own and asks the detector's [`Check`]. [`Checks`] has them by
//!   name; a detector is added with [`Checks::with`].
//! - [`minimise()`] leaves out what is not needed: ddmin (Zeller and Hildebrandt, Simplifying and isolating failure-inducing
//!   input, 2002) over the actions.
//! - [`FindingFiles`] writes findings while levels are tested; [`regress()`] plays all findings of a folder again, with
//!   [`Pins`] for those that are known.

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
