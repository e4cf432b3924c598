//! Maze games for agents that know where they are: the same games, with more added to what an agent is told.
//!
//! In the originals an agent knows its own state only. That will do on one map, which can be learned by heart; in a maze
//! that nobody has seen it leaves nothing but wandering about. [`Sighted`] agents see the way to the goal and the walls in
//! sight; they still have to look into dead ends, and what remembers nothing stays there. [`Mapped`] agents also know the
//! cells around them. [`Placed`] agents are told nothing new: they only tell places better apart, which helps on large maps.

pub mod mapped;
pub mod placed;
pub mod sighted;
mod with_senses;

pub use mapped::Mapped;
pub use placed::Placed;
pub use sighted::Sighted;
pub use with_senses::{Senses, Told, WithSenses};
