//! The comparison of test results with recordings of people: do levels that are hard for bots cost people time and
//! lives, too?
//!
//! [`Calibration::read`] takes the results of a test and recordings of people on the same levels. For each level it has
//! [`Numbers`] of the people and of every tester. For every tester and [`Measure`] it has an [`Agreement`]: rank
//! correlations over the levels, with 95 % intervals.
//!
//! ```
//! use playbot_lab::calibration::spearman;
//!
//! // Seconds that people took on ten levels, and a bot.
//! let people = [12.0, 9.0, 30.0, 14.0, 55.0, 21.0, 17.0, 40.0, 11.0, 26.0];
//! let bot = [4.0, 3.5, 9.0, 6.0, 20.0, 5.0, 7.0, 15.0, 3.0, 8.0];
//! let found = spearman(&people, &bot).expect("both vary");
//! assert!(found.value > 0.9 && found.interval.is_some_and(|[low, _]| low > 0.6));
//! ```

mod agreement;
mod error;
mod level_names;
mod numbers;
mod page;
mod people;
mod rank;
mod read;
mod tables;
mod tau;
mod tries;
mod words;

pub use agreement::{Agreement, FEW_LEVELS, Measure};
pub use error::CalibrationError;
pub use numbers::{CalibratedLevel, Numbers};
pub use rank::{RankCorrelation, spearman};
pub use read::Calibration;
pub use tau::kendall;
