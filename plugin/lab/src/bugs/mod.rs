//! Planted defects: games and levels that are broken on purpose, to measure which testers find them. A level or game
//! without one is called *unmutated*; reports and files call such levels *sound levels*.
//!
//! - A [`DefectKind`] says how a defect is planted, into a level or into the rules of a game. Every game has
//!   [general ones](general_defects), and those of its own [`TestTools::defects`](crate::game::TestTools::defects):
//!   [`defect_kinds`].
//! - A [`Mutant`] is a game with one of them in its rules.
//! - [`make_bugs`] plants a [`BugSet`], which is kept in a folder and reproducible from a seed.
//! - [`score`] measures which testers find them.

mod effect;
mod error;
mod general;
mod kinds;
mod make;
mod mutant;
mod place;
pub mod score;
mod set;
mod set_text;
mod sound;

pub use crate::defect::{ChangeLevel, ChangeRules, DefectKind, Plant};
pub use error::BugError;
pub use general::general_defects;
pub use kinds::defect_kinds;
pub use make::{Made, MakePlan, NoPlace, Source, make_bugs};
pub use mutant::{Mutant, PlantedRules};
pub use set::{BugGame, BugSet, PlantedBug, PlantedPart, SoundLevels};
