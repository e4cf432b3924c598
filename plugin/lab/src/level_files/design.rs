//! Levels read from files.

use std::{any::Any, sync::Arc};

use bevy_playbot::state_hash::StateHash;

/// A level as read by its game.
#[derive(Clone, Debug)]
pub struct LevelDesign {
    level: Arc<dyn Any + Send + Sync>,
    hash: u64,
}

/// A level with the path of its file.
#[derive(Clone, Debug)]
pub(super) struct DrawnLevel {
    pub(super) path: String,
    pub(super) design: LevelDesign,
}

impl LevelDesign {
    /// Wraps a level of the game's own type.
    ///
    /// `content` is all of the level that affects play, in one canonical form. So the level has the same hash under
    /// any layout of its file.
    pub fn new<T: Any + Send + Sync>(level: T, content: &str) -> Self {
        Self { level: Arc::new(level), hash: StateHash::of(content.bytes().map(u64::from)).0 }
    }

    /// Returns a hash of the content.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Returns the level; `None` if it is of another type.
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
