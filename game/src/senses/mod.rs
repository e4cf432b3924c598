//! Maze games with more observations: the same games, whose agents see goal, walls, a map, or their position in finer
//! detail.
//!
//! In the originals an agent observes its own state only. That is enough on one map, which can be learned by heart. In
//! an unknown maze it leaves nothing but wandering about. [`Sighted`] agents observe the direction of the goal and the
//! distances of walls. They still have to look into dead ends, where a policy without memory stays. [`Mapped`] agents
//! also observe the cells around them. [`Placed`] agents get no new information: positional encoding only separates
//! positions better, which helps on large maps.

pub mod mapped;
pub mod placed;
pub mod sighted;
mod with_senses;

pub use mapped::Mapped;
pub use placed::Placed;
pub use sighted::Sighted;
pub use with_senses::{Senses, Told, WithSenses};
