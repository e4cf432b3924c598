//! What trainings left behind: finding runs, reading their metrics, comparing them over seeds.
//!
//! - [`find_runs`] finds the folders of runs, [`RunRecord`] reads one of them. [`FoundRuns`] has what is left of others, too.
//! - [`RunCurves`] has the learning curves of a run by their TensorBoard tags.
//! - [`group_runs`] puts runs together that differ only in their seed, and [`GroupStatistics`] measures each group.
//!
//! Nothing here changes a run, so a training that goes on at the same time is not disturbed.

mod curves;
mod error;
mod find;
mod group;
mod group_statistics;
mod leftover;
mod record;
mod settings;

pub use curves::RunCurves;
pub use error::RunsError;
pub use find::{FoundRuns, find_runs};
pub use group::{RunGroup, group_runs};
pub use group_statistics::{GroupStatistics, mean_and_spread};
pub use leftover::Leftover;
pub use record::RunRecord;
pub use settings::{changed_settings, settings, with_defaults};
