//! Curved rays: where the player would go if a button were held.
//!
//! A person sees in which arc the figure will fly. A straight ray does not tell, so these sensors follow the player's
//! own motion through what is in view: tiles, crates and saws as they stand, enemies at their present speed. A path ends
//! at the edge of the view.
//!
//! Six paths of up to 20 steps are followed at every tick, so they take short cuts, each of which gives the numbers of
//! the rules to the bit:
//!
//! - with and without the jump button, a path is one path until a jump would work;
//! - a step through free space only adds, and so does one beside a straight wall or on level ground until it is blocked;
//!   only other steps ask the rules about each of their parts;
//! - what a step leaves as it was, no further step changes;
//! - what kills moves nobody, so it is looked for when the course is known, and only near it.

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
