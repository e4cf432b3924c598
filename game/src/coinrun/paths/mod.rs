//! Curved rays: the player's paths under held buttons.
//!
//! A person foresees the arc of a jump, which a straight ray does not show. These sensors therefore follow the player's
//! own motion through the view: tiles, crates and saws as they stand, enemies at their present speed. A path ends at
//! the edge of the view.
//!
//! Six paths of up to 20 steps are followed at every tick, so they take short cuts, each of which gives the numbers of
//! the rules to the bit:
//!
//! - with and without the jump button, a path is one path until a jump would work;
//! - a step through free space only adds, and so does one beside a straight wall or on level ground until it is
//!   blocked; only other steps apply the rules to each of their parts;
//! - state that one step leaves unchanged stays unchanged in every further step;
//! - hazards do not move the player, so they are tested once the course is known, and only near it.

mod course;
mod dangers;
mod ground;
mod held;
mod near_crates;
#[cfg(test)]
mod plain;
mod slide;
mod step;
mod surroundings;
mod sweep;
mod swept;
mod walker;

pub use held::{HELD, NAMES, STEPS, VALUES};
pub use surroundings::Surroundings;
