//! The score of testers: how well they find planted defects.
//!
//! A [`ScorePlan`] runs [`Contestant`]s on all mutants and unmutated levels of a [`BugSet`](crate::bugs::BugSet), at
//! equal budgets and under the detectors of a test. A [`ScoreRun`] does so on all cores, and a [`ScoreJournal`] keeps
//! the finished jobs. A [`Score`] is the result. A [`ScoreTable`] joins several: recall and precision by class and
//! tester, the cost of a defect, and the testers that find most together.

mod case;
mod clock;
mod contestant;
mod error;
mod exploring;
mod file;
mod found;
mod job;
mod journal;
mod markdown;
mod mix;
mod numbers;
mod plan;
mod playing;
mod record;
mod rows;
mod run;
mod subject;
mod table;
mod tables;
mod tester_row;
#[cfg(test)]
pub(crate) mod testing;
mod trial;
mod usual_reward;

pub use clock::ClockKind;
pub use contestant::{Contestant, ContestantRecord, EXPLORE, EXPLORE_SKILLS, HOLD, Means, RANDOM};
pub use error::ScoreError;
pub use file::Score;
pub use found::{Found, RELIABLE, ScoredJob, judge};
pub use job::{JobFinding, JobResult};
pub use journal::ScoreJournal;
pub use numbers::Share;
pub use plan::{ScorePlan, TestedGame};
pub use record::{GameRecord, SCORE_FORMAT, ScoreBudget, ScoreRecord, SetRecord};
pub use run::{ScoreRun, ScoreWatch};
pub use subject::{Subject, SubjectKind};
pub use table::{ClassRow, FEW_FALSE, ScoreTable};
pub use tester_row::TesterRow;
pub use usual_reward::{FAR, FEWEST_SOUND};
