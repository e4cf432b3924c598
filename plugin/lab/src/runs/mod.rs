//! Runs on disk: finding them, reading their metrics, comparing them over seeds.
//!
//! - [`find_runs`] finds the folders of runs, and [`RunRecord`] reads one of them. [`FoundRuns`] has leftovers, too.
//! - [`RunCurves`] has the learning curves of a run by their TensorBoard tags.
//! - [`group_runs`] groups runs that differ only in their seed, and [`GroupStatistics`] measures each group.
//!
//! Runs are only read, so training may go on at the same time.

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
pub use settings::{changed_settings, settings, settings_that_differ, with_defaults};
