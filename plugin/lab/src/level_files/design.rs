//! A level that somebody drew.

use std::{any::Any, sync::Arc};

use bevy_playbot::state_hash::StateHash;

/// A level as its game has read it.
#[derive(Clone, Debug)]
pub struct LevelDesign {
    level: Arc<dyn Any + Send + Sync>,
    hash: u64,
}

/// A drawn level and where it is from.
#[derive(Clone, Debug)]
pub(super) struct DrawnLevel {
    pub(super) path: String,
    pub(super) design: LevelDesign,
}

impl LevelDesign {
    /// A level of the game's own type. `content` is all that is played of it, written in one way only, so that the same
    /// level has the same hash however its file is laid out.
    pub fn new<T: Any + Send + Sync>(level: T, content: &str) -> Self {
        Self { level: Arc::new(level), hash: StateHash::of(content.bytes().map(u64::from)).0 }
    }

    /// A hash of what is played.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// The level; `None` if it is of another type.
    pub fn level<T: Any + Send + Sync>(&self) -> Option<Arc<T>> {
        self.level.clone().downcast().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_given_out_as_what_it_is_and_hashed_by_its_content() {
        let design = LevelDesign::new(7u8, "seven");
        assert_eq!((design.level::<u8>().as_deref(), design.level::<u16>()), (Some(&7), None));
        assert_eq!(design.hash(), LevelDesign::new((), "seven").hash());
        assert_ne!(design.hash(), LevelDesign::new(7u8, "sevem").hash());
    }
}
