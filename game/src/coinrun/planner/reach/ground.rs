//! Sets of positions along x, and answers about a level at one height: room, obstacles, hazards and the coin.

use crate::coinrun::{
    level::{Level, Spawn},
    rules::{Body, FOOT_MARGIN, OVERLAP_MARGIN, corners},
    tile::{Corners, SIZE, Tile},
};
use bevy::platform::collections::HashMap;
use std::{
    ops::{BitAnd, BitOr, BitOrAssign, Not},
    sync::LazyLock,
};

// The sets of positions.

/// Number of bins over the width of a level. A bin is a little wider than an eighth of a tile, the longest displacement
/// of one part of a step. Four bins are a little wider than that of a whole step: rounding never leads further.
pub(crate) const BINS: usize = 508;

/// Width of a bin, tiles.
pub(crate) const WIDTH: f32 = SIZE as f32 / BINS as f32;

/// Bins that full speed crosses in a step.
pub(crate) const STEP_BINS: usize = 4;

const WORDS: usize = BINS.div_ceil(64);

/// A set of bins.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Bins([u64; WORDS]);

impl Bins {
    /// No bin.
    pub const NONE: Self = Self([0; WORDS]);

    /// Returns the bins for which a condition holds.
    pub fn of(mut holds: impl FnMut(usize) -> bool) -> Self {
        let mut bins = Self::NONE;
        for bin in (0..BINS).filter(|&bin| holds(bin)) {
            bins.0[bin / 64] |= 1 << (bin % 64);
        }
        bins
    }

    /// Returns the bin of a position.
    pub fn at(x: f32) -> Self {
        let place = ((x / WIDTH) as usize).min(BINS - 1);
        Self::of(|bin| bin == place)
    }

    /// Returns the ends of a bin, tiles from the left.
    pub fn ends(bin: usize) -> [f32; 2] {
        [bin as f32 * WIDTH, (bin + 1) as f32 * WIDTH]
    }

    /// Returns true if no bin is in it.
    pub fn is_empty(&self) -> bool {
        *self == Self::NONE
    }

    /// Returns the distance from the nearest bin to that of a position, in bins; an empty set is far away.
    pub fn distance(&self, x: f32) -> usize {
        let is_in = |bin: usize| self.0[bin / 64] >> (bin % 64) & 1 == 1;
        let there = ((x / WIDTH) as usize).min(BINS - 1);
        let near = (0..BINS).find(|&far| {
            let left = there.checked_sub(far).is_some_and(is_in);
            left || there + far < BINS && is_in(there + far)
        });
        near.unwrap_or(BINS)
    }

    /// Returns these bins and those at most so many bins away.
    #[must_use]
    pub fn spread(mut self, by: usize) -> Self {
        for _ in 0..by {
            self = self.spread_by_one();
        }
        self
    }

    fn spread_by_one(self) -> Self {
        let words = self.0;
        let mut spread = words;
        for word in 0..WORDS {
            let from_left = if word > 0 { words[word - 1] >> 63 } else { 0 };
            let from_right = words.get(word + 1).map_or(0, |next| next << 63);
            spread[word] |= words[word] << 1 | from_left | words[word] >> 1 | from_right;
        }
        // Nothing lies behind the last bin.
        spread[WORDS - 1] &= u64::MAX >> (WORDS * 64 - BINS);
        Self(spread)
    }
}

impl BitAnd for Bins {
    type Output = Self;

    fn bitand(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(other.0).for_each(|(word, other)| *word &= other);
        self
    }
}

impl BitOr for Bins {
    type Output = Self;

    fn bitor(mut self, other: Self) -> Self {
        self |= other;
        self
    }
}

impl BitOrAssign for Bins {
    fn bitor_assign(&mut self, other: Self) {
        self.0.iter_mut().zip(other.0).for_each(|(word, other)| *word |= other);
    }
}

impl Not for Bins {
    type Output = Self;

    fn not(mut self) -> Self {
        self.0.iter_mut().for_each(|word| *word = !*word);
        self
    }
}

// The answers about a level.

/// Shift of a bin's ends when its columns are computed: more than rounding does.
const SLACK: f32 = 1e-4;

/// Pairs of columns of the two sides of a player, for each bin.
type Columns = Vec<Vec<[i32; 2]>>;

/// The rows of a player's corners: low and high.
pub(super) type Rows = [i32; 2];

/// A level for the search, with cached answers.
pub(super) struct ReachableGround<'a> {
    level: &'a Level,
    answers: HashMap<Question, Bins>,
    /// Crates, and the bins in which a player may overlap each.
    pub crates: Vec<(Body, Bins)>,
    saws: Vec<(Body, Bins)>,
    /// Enemies may lend support; see [`patrol`](crate::coinrun::rules::patrol).
    pub enemies_lend: bool,
}

/// A player at the left border, at the bottom.
static PLAYER: LazyLock<Body> = LazyLock::new(|| Body { x: 0.0, y: 0.0, ..Body::player() });

static CORNER_COLUMNS: LazyLock<Columns> = LazyLock::new(|| columns(corners(&PLAYER, 0.0, 0.0).right));

static BODY_COLUMNS: LazyLock<Columns> = LazyLock::new(|| columns(PLAYER.rx + OVERLAP_MARGIN));

/// A question about a level. Corners are the same corners in both rows of a question. A player free in one row and
/// stopped by the other does not slide down beside a wall as if on steps.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Question {
    Room(Rows),
    Passes(Rows, Rows),
    Stops(Rows, i32),
    /// A body that covers these rows is free of lava.
    Dry(Rows),
    /// It covers the coin.
    Coin(Rows),
}

/// Contacts of a player at a height.
#[derive(Clone, Copy)]
pub(super) struct Touched {
    /// Bins in which a player may survive: not all of their positions touch a fixed hazard.
    pub alive: Bins,
    /// Bins in which a player may touch the coin.
    pub coin: Bins,
}

impl<'a> ReachableGround<'a> {
    pub fn new(level: &'a Level) -> Self {
        let blocks = |kind: fn(&Spawn) -> Option<Body>| level.spawns.iter().filter_map(kind);
        let crates: Vec<_> = blocks(Spawn::solid_crate).map(|block| (block, beside(&block, &PLAYER, true))).collect();
        let has_enemies = blocks(Spawn::enemy).next().is_some();
        Self {
            level,
            answers: HashMap::default(),
            enemies_lend: has_enemies && !crates.is_empty(),
            crates,
            saws: blocks(Spawn::saw).map(|saw| (saw, beside(&saw, &PLAYER, false))).collect(),
        }
    }

    /// Returns the player's body with its centre at this height.
    pub fn body(&self, y: f32) -> Body {
        Body { y, ..*PLAYER }
    }

    /// Returns the rows of the corners of a player at this height.
    pub fn rows(&self, y: f32) -> Rows {
        let Corners { low, high, .. } = corners(&PLAYER, 0.0, y);
        [low.floor() as i32, high.floor() as i32]
    }

    /// Returns the row in which a player at this height looks for support.
    pub fn feet(&self, y: f32) -> i32 {
        (y - (PLAYER.ry + FOOT_MARGIN)).floor() as i32
    }

    /// Returns the bins in which all corners may be free, for corners in these rows.
    pub fn room(&mut self, rows: Rows) -> Bins {
        self.ask(Question::Room(rows))
    }

    /// Returns the bins in which all corners may be free in both rows.
    pub fn passes(&mut self, here: Rows, there: Rows) -> Bins {
        self.ask(Question::Passes(here, there))
    }

    /// Returns the bins in which all corners may be free, with a wall in this row below or above one of them.
    pub fn stops(&mut self, here: Rows, row: i32) -> Bins {
        self.ask(Question::Stops(here, row))
    }

    fn ask(&mut self, question: Question) -> Bins {
        let (tiles, columns) = (&self.level.tiles, &*CORNER_COLUMNS);
        let is_wall = |column, row| tiles.get(column, row).is_wall();
        let covers = |pair: [i32; 2], [low, high]: Rows, is_one: fn(Tile) -> bool| {
            pair.iter().any(|&column| (low..=high).any(|row| is_one(tiles.get(column, row))))
        };
        let is_free = |pair: [i32; 2], rows: Rows| !pair.iter().any(|&x| rows.iter().any(|&row| is_wall(x, row)));
        *self.answers.entry(question).or_insert_with(|| match question {
            Question::Room(rows) => any(columns, |pair| is_free(pair, rows)),
            Question::Passes(here, there) => any(columns, |pair| is_free(pair, here) && is_free(pair, there)),
            Question::Stops(here, row) => {
                any(columns, |pair| is_free(pair, here) && pair.iter().any(|&column| is_wall(column, row)))
            }
            Question::Dry(rows) => any(&BODY_COLUMNS, |pair| !covers(pair, rows, Tile::is_lava)),
            Question::Coin(rows) => any(&BODY_COLUMNS, |pair| covers(pair, rows, |tile| tile == Tile::Coin)),
        })
    }

    /// Returns the contacts of a player at this height.
    pub fn touched(&mut self, y: f32) -> Touched {
        let reach = PLAYER.ry + OVERLAP_MARGIN;
        let rows = [(y - reach) as i32, (y + reach) as i32];
        let (dry, coin) = (self.ask(Question::Dry(rows)), self.ask(Question::Coin(rows)));
        let body = self.body(y);
        let saws = self.saws.iter().filter(|(saw, _)| Body { x: saw.x, ..body }.overlaps(saw, -SLACK));
        Touched { alive: saws.fold(dry, |alive, (_, deadly)| alive & !*deadly), coin }
    }
}

/// Returns the pairs of columns at this distance to the left and to the right of each bin's positions.
fn columns(reach: f32) -> Columns {
    let of_bin = |bin| {
        let [first, last] = Bins::ends(bin);
        let range = |offset: f32| (first + offset - SLACK).floor() as i32..=(last + offset + SLACK).floor() as i32;
        let pairs = range(-reach).flat_map(|left| range(reach).map(move |right| [left, right]));
        // The player is less than a tile wide.
        pairs.filter(|[left, right]| (0..=1).contains(&(right - left))).collect()
    };
    (0..BINS).map(of_bin).collect()
}

fn any(columns: &Columns, holds: impl Fn([i32; 2]) -> bool) -> Bins {
    Bins::of(|bin| columns[bin].iter().any(|&pair| holds(pair)))
}

/// Returns the bins in which a player overlaps a block along x: at some of their positions, or at all.
fn beside(block: &Body, player: &Body, at_some: bool) -> Bins {
    let reach = block.rx + player.rx;
    Bins::of(|bin| {
        let [first, last] = Bins::ends(bin);
        if at_some {
            first - SLACK < block.x + reach && last + SLACK > block.x - reach
        } else {
            first - SLACK > block.x - reach && last + SLACK < block.x + reach
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::rules::WALK_SPEED;

    #[test]
    fn bins_spread_to_both_sides_and_not_beyond_the_level() {
        let bins = Bins::of(|bin| [0, 63, 300, 507].contains(&bin)).spread(2);
        let expected =
            Bins::of(|bin| [0, 1, 2, 61, 62, 63, 64, 65, 505, 506, 507].contains(&bin) || bin.abs_diff(300) <= 2);
        assert_eq!(bins, expected);
        assert_eq!(Bins::at(64.0), Bins::of(|bin| bin == BINS - 1));
        let bins = Bins::of(|bin| [10, 40].contains(&bin));
        let distance = |bin: usize| bins.distance((bin as f32 + 0.5) * WIDTH);
        assert_eq!([3, 10, 22, 30, 507].map(distance), [7, 0, 12, 10, 467]);
        assert_eq!(Bins::NONE.distance(3.0), BINS);
    }

    #[test]
    fn full_speed_stays_within_the_bins_of_a_step() {
        // Rounding adds at most a few millionths of a tile.
        assert!(WALK_SPEED + 1e-4 < STEP_BINS as f32 * WIDTH && WALK_SPEED / 4.0 + 1e-5 < WIDTH);
    }

    fn ground(text: &str) -> Level {
        Level::from_text(text).expect("a valid picture")
    }

    #[test]
    fn there_is_room_between_walls_and_none_in_them() {
        let level = ground("#..#..\n#A.#.C\n######\n");
        let mut ground = ReachableGround::new(&level);
        let rows = ground.rows(Body::player().y);
        assert_eq!(rows, [1, 2]);
        let room = ground.room(rows);
        let is_in = |x: f32| !(room & Bins::at(x)).is_empty();
        assert!(is_in(1.5) && is_in(2.45) && is_in(4.55) && !is_in(2.7) && !is_in(3.5) && !is_in(1.2));
        let stops = ground.stops(rows, 0);
        assert!(!(stops & Bins::at(2.0)).is_empty() && (stops & Bins::at(3.5)).is_empty(), "the floor");
        assert!((ground.stops(rows, 1)).is_empty(), "a wall beside is not below");
        assert!(ground.room([-1, 0]).is_empty(), "everything outside is a wall");
    }

    #[test]
    fn what_certainly_kills_is_not_survived() {
        let level = ground("#......\n#A..^.C\n#######\n");
        let Touched { alive, coin } = ReachableGround::new(&level).touched(Body::player().y);
        let is_in = |bins: Bins, x: f32| !(bins & Bins::at(x)).is_empty();
        assert!(is_in(alive, 2.0) && is_in(alive, 3.4) && is_in(alive, 5.7));
        assert!(!is_in(alive, 4.0) && !is_in(alive, 5.0));
        assert!(is_in(coin, 5.8) && !is_in(coin, 4.0));
    }
}
