//! Verdicts of bots and policies on each level of a range.
//!
//! - A [`TestPlan`] names levels, [`Tester`]s, episodes and a seed. [`run_tests`] plays them on all cores, and makes
//!   a [`LevelVerdict`] of each level: solved, bot failed, or proved unsolvable.
//! - [`LevelMaps`] show where agents went in a level: visits, lost time, skills, and the path of a failure. A
//!   [`MapScope`] names the levels with maps.
//! - A [`TestFolder`] keeps verdicts as they come in, so a killed test can be resumed. [`TestFolder::finish`] writes
//!   `results.json`, which is the same on any number of threads, and reports for people and other programs.
//! - [`merge()`] joins the results of shards to those of the whole range, byte for byte.
//! - [`Comparison`] reports changes since earlier results, apart from noise.

mod change;
mod compare;
mod defects;
mod ends;
mod error;
mod false_discovery;
mod finding_files;
mod finish_time;
mod fisher;
mod folder;
mod in_turn;
mod interval;
mod journal;
mod judge;
mod junit;
mod level_maps;
mod level_name;
mod level_pars;
mod level_verdict;
mod map_scope;
mod merge;
mod overview;
mod places;
mod plan;
mod plan_memory;
mod play;
mod played;
mod report_files;
mod rerun;
mod results;
mod run;
mod shard;
mod skill_name;
mod squares;
mod summary;
mod test_world;
mod tester;
#[cfg(test)]
mod testing;
mod walk;
mod walked;
mod watched;

pub use change::{Change, FindingChange};
pub use compare::{Comparison, FALSE_DISCOVERY_RATE};
pub use ends::END_SQUARES;
pub use error::TestError;
pub use false_discovery::benjamini_hochberg;
pub use finish_time::FinishTime;
pub use fisher::{Trials, fisher_exact};
pub use folder::{Earlier, TestFolder};
pub(crate) use in_turn::test_in_turn;
pub use interval::wilson;
pub use level_maps::{FailureWay, LevelMaps, SkillTicks};
pub use level_name::{hash_of_files, level_name};
pub use level_pars::LevelPars;
pub use level_verdict::{EndPlace, Finding, LevelOutcome, LevelVerdict, Score, TesterVerdict};
pub use map_scope::MapScope;
pub use merge::merge;
pub use overview::{MOST_WORST, Overview, TesterTotal};
pub use places::Places;
pub use plan::{TestPlan, TestRecord};
pub use report_files::{AGAINST, JUNIT, SUMMARY, write_reports};
pub use rerun::rerun_commands;
pub use results::{RESULTS, ResultLines, results_folder};
pub use run::{TestEnd, TestWatch, run_tests, run_tests_keeping};
pub use shard::{Shard, ShardError};
pub use tester::{TestedRun, Tester, TesterRecord};
