//! Paths to cells. They share their beginnings: each is a piece of its own after a path that was known before.

use playbot_learner::{ActionSpace, Actions};

/// Actions from the start of a level, with the state hash after each.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// The action of each tick.
    pub actions: Actions,
    /// The folded [state hash](bevy_playbot::state_hash::StateHash::folded) after each tick.
    pub hashes: Vec<u32>,
}

impl Route {
    /// Creates a route without a tick.
    pub(super) fn empty(space: &ActionSpace) -> Self {
        Self { actions: Actions::empty(space), hashes: Vec::new() }
    }

    /// Returns the number of ticks.
    pub fn len(&self) -> usize {
        self.hashes.len()
    }

    /// Returns whether it has no ticks, as the path to the start.
    pub fn is_empty(&self) -> bool {
        self.hashes.is_empty()
    }

    /// Appends the first ticks of another route.
    fn extend(&mut self, piece: &Self, ticks: usize) {
        let ticks = ticks.min(piece.len());
        self.actions.extend_rows(&piece.actions, 0, ticks).expect("all actions are those of one game");
        self.hashes.extend_from_slice(&piece.hashes[..ticks]);
    }
}

/// A path: the first ticks up to the end of a segment, or up to a tick within it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Way {
    segment: usize,
    /// Its length, from the start of the level.
    pub ticks: u32,
}

impl Way {
    /// The path to the start of the level.
    pub const START: Self = Self { segment: 0, ticks: 0 };

    /// Returns the first ticks of this path.
    pub fn cut(self, ticks: u32) -> Self {
        Self { ticks: ticks.min(self.ticks), ..self }
    }
}

/// The actions after a path that was known before.
struct Segment {
    parent: Way,
    piece: Route,
}

/// All paths of an exploration. Segments stay when a shorter path is found, since other paths may go through them.
pub(super) struct Ways {
    space: ActionSpace,
    segments: Vec<Segment>,
}

impl Ways {
    /// Creates it with the path to the start alone.
    pub fn new(space: ActionSpace) -> Self {
        let start = Segment { parent: Way::START, piece: Route::empty(&space) };
        Self { space, segments: vec![start] }
    }

    /// Adds a path of this many ticks, which extends a known one by the beginning of a piece.
    pub fn extend(&mut self, parent: Way, piece: &Route, ticks: u32) -> Way {
        if ticks <= parent.ticks {
            return parent.cut(ticks);
        }
        let mut kept = Route::empty(&self.space);
        kept.extend(piece, (ticks - parent.ticks) as usize);
        self.segments.push(Segment { parent, piece: kept });
        Way { segment: self.segments.len() - 1, ticks }
    }

    /// Returns a whole path.
    pub fn route(&self, way: Way) -> Route {
        let mut pieces = Vec::new();
        let mut rest = way;
        while rest.ticks > 0 {
            let Segment { parent, piece } = &self.segments[rest.segment];
            if rest.ticks > parent.ticks {
                pieces.push((piece, (rest.ticks - parent.ticks) as usize));
            }
            rest = parent.cut(rest.ticks);
        }
        let mut route = Route::empty(&self.space);
        for (piece, ticks) in pieces.into_iter().rev() {
            route.extend(piece, ticks);
        }
        route
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(actions: &[u32]) -> Route {
        Route { actions: Actions::Discrete(actions.to_vec()), hashes: actions.iter().map(|a| a + 100).collect() }
    }

    #[test]
    fn ways_go_on_behind_others_and_are_whole_again() {
        let mut ways = Ways::new(ActionSpace::Discrete(10));
        let first = ways.extend(Way::START, &piece(&[1, 2, 3, 4]), 3);
        assert_eq!(ways.route(first), piece(&[1, 2, 3]));
        let second = ways.extend(first.cut(2), &piece(&[7, 8, 9]), 4);
        assert_eq!(ways.route(second), piece(&[1, 2, 7, 8]), "what is not needed is not kept");
        let third = ways.extend(second, &piece(&[5]), 5);
        assert_eq!(ways.route(third), piece(&[1, 2, 7, 8, 5]));
        assert_eq!(ways.route(third.cut(1)), piece(&[1]));
        assert_eq!(ways.route(first), piece(&[1, 2, 3]), "others change nothing");
        assert!(ways.route(Way::START).is_empty());
    }

    #[test]
    fn a_way_that_is_no_longer_than_its_beginning_needs_no_segment() {
        let mut ways = Ways::new(ActionSpace::Continuous(2));
        let actions = Actions::Continuous { dim: 2, values: vec![0.5, -0.5, 1.0, 0.0] };
        let first = ways.extend(Way::START, &Route { actions, hashes: vec![1, 2] }, 2);
        assert_eq!(ways.extend(first, &Route::empty(&ActionSpace::Continuous(2)), 1), first.cut(1));
        assert_eq!(ways.segments.len(), 2);
        assert_eq!(ways.route(first.cut(1)).hashes, [1]);
    }
}
