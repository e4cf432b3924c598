//! Queues of the levels that agents play.
//!
//! ```
//! use bevy_playbot::{prelude::*, streams::AgentStreams};
//!
//! /// A rule of the game: every second level.
//! #[derive(Clone, Debug)]
//! struct Even(u64);
//!
//! impl LevelSource for Even {
//!     fn next_level(&mut self) -> Option<u64> {
//!         self.0 += 2;
//!         Some(self.0)
//!     }
//!
//!     fn clone_box(&self) -> Box<dyn LevelSource> {
//!         Box::new(self.clone())
//!     }
//! }
//!
//! let mut random = AgentStreams::new(1, 0).level;
//! let mut three_of = |mut queue: LevelQueue| [0; 3].map(|_| queue.next_level(&mut random));
//! assert_eq!(three_of(LevelQueue::list([3, 5])), [Some(3), Some(5), None]);
//! assert_eq!(three_of(LevelQueue::rounds([3, 5])), [Some(3), Some(5), Some(3)]);
//! assert_eq!(three_of(LevelQueue::Custom(Box::new(Even(0)))), [Some(2), Some(4), Some(6)]);
//! ```

use std::sync::Arc;

use bevy::prelude::*;

use crate::carry_over::ReflectCarryComponent;
use rand::{Rng, RngExt};

/// Source of level numbers for one agent.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug)]
pub enum LevelQueue {
    /// The same level forever.
    Always(u64),
    /// These levels, each once, in order. The agent idles afterwards.
    List {
        /// The levels; `levels[next..]` remain to be played.
        levels: Arc<[u64]>,
        /// Index of the next level.
        next: usize,
    },
    /// These levels over and over, in order. At least one.
    Rounds {
        /// The levels.
        levels: Arc<[u64]>,
        /// Index of the next level.
        next: usize,
    },
    /// Levels `first..=last`, uniformly and with replacement, from the agent's own random stream.
    Uniform {
        /// Lowest level.
        first: u64,
        /// Highest level, included.
        last: u64,
    },
    /// A rule of the game.
    Custom(Box<dyn LevelSource>),
}

impl Default for LevelQueue {
    fn default() -> Self {
        Self::Always(0)
    }
}

impl LevelQueue {
    /// Creates a queue over a list of levels, each played once.
    pub fn list(levels: impl Into<Arc<[u64]>>) -> Self {
        Self::List { levels: levels.into(), next: 0 }
    }

    /// Creates a queue that goes through a list of levels again and again.
    pub fn rounds(levels: impl Into<Arc<[u64]>>) -> Self {
        Self::Rounds { levels: levels.into(), next: 0 }
    }

    /// Returns the next level, or `None` when no level is left.
    pub fn next_level(&mut self, rng: &mut impl Rng) -> Option<u64> {
        match self {
            Self::Always(level) => Some(*level),
            Self::List { levels, next } => {
                let level = levels.get(*next).copied();
                *next += usize::from(level.is_some());
                level
            }
            Self::Rounds { levels, next } => {
                let level = levels.get(*next).copied();
                *next = (*next + 1) % levels.len().max(1);
                level
            }
            Self::Uniform { first, last } => Some(rng.random_range(*first..=*last)),
            Self::Custom(source) => source.next_level(),
        }
    }
}

/// A game's own choice of levels.
pub trait LevelSource: Send + Sync + std::fmt::Debug {
    /// Returns the next level, or `None` when no level is left.
    fn next_level(&mut self) -> Option<u64>;

    /// Returns a copy that will yield the same levels.
    fn clone_box(&self) -> Box<dyn LevelSource>;
}

impl Clone for Box<dyn LevelSource> {
    fn clone(&self) -> Self {
        self.clone_box()
    }
}
