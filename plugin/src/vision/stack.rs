//! The last pictures of an episode.

use bevy::prelude::*;

/// The state of the game that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
pub(super) struct Moment {
    /// Number of the episode of this agent.
    pub episode: u64,
    /// Its level.
    pub level: u64,
    /// Tick of the episode.
    pub tick: u32,
}

/// The last pictures of an agent's episode, in a ring. A state that is observed twice counts once.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(Component)]
pub(crate) struct PictureStack {
    ring: Vec<u8>,
    /// Bytes of a picture.
    size: usize,
    newest: usize,
    shown: Option<Moment>,
}

impl PictureStack {
    /// Adds the picture of a moment, which `paint` writes, and writes all pictures, oldest first.
    pub(super) fn push(&mut self, moment: Moment, count: usize, paint: impl FnOnce(&mut [u8]), out: &mut [u8]) {
        let size = out.len() / count;
        let goes_on = self.goes_on(moment) && (self.size, self.ring.len()) == (size, out.len());
        if !goes_on {
            self.size = size;
            self.ring.resize(out.len(), 0);
            self.newest = 0;
        } else if self.shown != Some(moment) {
            self.newest = (self.newest + 1) % count;
        }
        self.shown = Some(moment);
        let from = self.newest * size;
        paint(&mut self.ring[from..from + size]);
        if !goes_on {
            (1..count).for_each(|copy| self.ring.copy_within(..size, copy * size));
        }
        let oldest = (self.newest + 1) % count * size;
        let (wrapped, first) = self.ring.split_at(oldest);
        out[..first.len()].copy_from_slice(first);
        out[first.len()..].copy_from_slice(wrapped);
    }

    /// Returns whether the moment belongs to the episode of the last one. The first moment always
    /// starts anew.
    fn goes_on(&self, moment: Moment) -> bool {
        self.shown.is_some_and(|last| {
            (last.episode, last.level) == (moment.episode, moment.level) && moment.tick > 0 && moment.tick >= last.tick
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(stack: &mut PictureStack, episode: u64, tick: u32, picture: u8) -> [u8; 6] {
        let mut out = [0; 6];
        stack.push(Moment { episode, level: 0, tick }, 3, |bytes| bytes.fill(picture), &mut out);
        out
    }

    #[test]
    fn oldest_comes_first_and_the_first_picture_stands_in() {
        let stack = &mut PictureStack::default();
        assert_eq!(shown(stack, 0, 0, 1), [1; 6]);
        assert_eq!(shown(stack, 0, 1, 2), [1, 1, 1, 1, 2, 2]);
        assert_eq!(shown(stack, 0, 2, 3), [1, 1, 2, 2, 3, 3]);
        assert_eq!(shown(stack, 0, 3, 4), [2, 2, 3, 3, 4, 4]);
        assert_eq!(shown(stack, 1, 0, 5), [5; 6], "another episode");
    }

    #[test]
    fn a_state_counts_once() {
        let stack = &mut PictureStack::default();
        shown(stack, 0, 0, 1);
        shown(stack, 0, 1, 2);
        assert_eq!(shown(stack, 0, 1, 3), [1, 1, 1, 1, 3, 3], "only the newest is replaced");
        assert_eq!(shown(stack, 0, 2, 4), [1, 1, 3, 3, 4, 4]);
        shown(stack, 0, 0, 6);
        assert_eq!(shown(stack, 0, 0, 7), [7; 6], "an episode left in its first tick and begun again");
    }

    #[test]
    fn whoever_begins_to_look_in_the_middle_starts_anew() {
        let stack = &mut PictureStack::default();
        assert_eq!(shown(stack, 0, 5, 1), [1; 6]);
        assert_eq!(shown(stack, 2, 9, 2), [2; 6]);
    }
}
