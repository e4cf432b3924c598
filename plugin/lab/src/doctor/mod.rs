//! The examination of a game: does it play the same for the same actions? If not, it names the first difference, its
//! tick, and advice.
//!
//! Recording, replay, resume and training in many arenas need games that are a function of their level and their
//! actions. [`examine`] plays copies of a game with the same random actions and compares them after every tick, by
//! reflection: see [`Comparison`] for the pairs. No finding in some ticks of one level is no proof: more ticks and
//! other levels show more. Components and resources that are `Reflect` and have `#[reflect(Component)]` or
//! `#[reflect(Resource)]` are compared field by field. The rest shows only in observations, rewards and ends of
//! episodes.

mod archetypes;
mod arenas;
mod cause;
mod census;
mod compare;
mod examine;
mod field;
mod finding;
mod game_copy;
mod listing;
mod observed;
mod pairs;
mod report;
mod safety;
mod scope;
mod slow_clock;
mod text;
mod trial;
mod types;
mod values;

pub use cause::{Cause, CauseKind};
pub use examine::{DoctorOptions, examine};
pub use finding::{Finding, FindingKind};
pub use observed::{ConstantValue, NonFiniteValue, ObservationReport};
pub use report::{Comparison, ComparisonReport, Difference, DifferenceKind, DoctorReport};
pub use safety::{Safety, Verdict};
pub use types::TypesReport;
