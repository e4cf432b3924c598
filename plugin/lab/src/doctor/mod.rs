//! Does a game play the same when it is given the same actions? If not: what differs first, when, and what to do.
//!
//! Recording, replay, resume and training in many arenas all rest on games that are a function of their level and their
//! actions. [`examine`] plays copies of a game with the same random actions and compares them after every tick, by
//! reflection: see [`Comparison`] for what is compared with what. That nothing was found in some ticks of one level does not
//! prove that there is nothing; more ticks and other levels say more. Components and resources that are `Reflect` and carry
//! `#[reflect(Component)]` or `#[reflect(Resource)]` are compared field by field; the rest shows only in what agents
//! observe, get and end with.

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
