//! Order of the levels in a window.

use bevy::prelude::*;
use playbot_lab::prelude::*;

/// The levels of a session. A won level is followed by the next, a lost one comes again, and the first follows the
/// last.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
pub struct Playlist {
    levels: LevelSplit,
    current: u64,
}

impl Playlist {
    /// Takes levels, and the first one to play.
    pub fn new(levels: LevelSplit, first: u64) -> Self {
        let current = first.clamp(levels.first, levels.last);
        Self { levels, current }
    }

    /// Returns the mode of the levels.
    pub fn mode(&self) -> &str {
        &self.levels.mode
    }

    /// Goes on to the next level.
    pub(super) fn advance(&mut self) {
        self.current = if self.current == self.levels.last { self.levels.first } else { self.current + 1 };
    }

    /// Returns the current level, as an agent's queue.
    pub(super) fn queue(&self) -> LevelQueue {
        LevelQueue::Always(self.current)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_the_last_level_comes_the_first() {
        let mut playlist = Playlist::new("hard:3..5".parse().expect("a split"), 4);
        let mut levels = Vec::new();
        for _ in 0..4 {
            levels.push(playlist.current);
            playlist.advance();
        }
        assert_eq!(levels, [4, 5, 3, 4]);
    }
}
