//! The contract of a detector, which looks for one kind of defect while testers play.
//!
//! ```
//! use playbot_lab::detector::{Detector, EachTick, Moment};
//!
//! /// A game's own detector: no agent may owe money.
//! fn debt() -> Box<dyn Detector> {
//!     Box::new(EachTick::new("debt", "an agent owes money", |moment: &Moment<'_>| {
//!         let purse = moment.observation.first().copied().unwrap_or_default();
//!         (purse < 0.0).then(|| format!("the purse holds {purse}"))
//!     }))
//! }
//! assert_eq!(debt().name(), "debt");
//! ```
//!
//! [`TestTools::detectors`](crate::game::TestTools::detectors) names a game's own; [`detectors`](crate::detectors) has
//! those that every game gets.

mod contract;
mod each_tick;
mod moment;
mod proofs;
mod setting;

pub use contract::{Detector, LevelAhead, Watch, WorldWatch};
pub use each_tick::EachTick;
pub use moment::{Moment, WorldMoment};
pub use proofs::{NoProofs, Proofs};
pub use setting::Setting;
