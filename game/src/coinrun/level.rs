//! A level: tiles, starts of the bodies, and the few random numbers that play needs later.

use crate::coinrun::{
    rules::{Body, motion::NearBodies},
    tile::TileGrid,
};
use bevy_playbot::{level::LevelSource, state_hash::StateHash};
use rand_mt::Mt;
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

/// Difficulty of the level generator.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// No walking enemies outside pits, one set of pictures.
    Easy,
    /// All obstacles.
    Hard,
}

impl Mode {
    /// Returns the name of this mode, as `FromStr` reads it.
    pub const fn name(self) -> &'static str {
        match self {
            Mode::Easy => "easy",
            Mode::Hard => "hard",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The error of reading a [`Mode`].
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("unknown CoinRun mode `{0}`: the modes are `easy` and `hard`")]
pub struct UnknownMode(pub String);

impl FromStr for Mode {
    type Err = UnknownMode;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        [Mode::Easy, Mode::Hard]
            .into_iter()
            .find(|mode| mode.name() == name)
            .ok_or_else(|| UnknownMode(name.to_owned()))
    }
}

/// The parts from which a [`Level`] is put together.
#[derive(Clone, PartialEq, Debug)]
pub struct LevelParts {
    /// Mode of the generator.
    pub mode: Mode,
    /// Seed of the generator.
    pub seed: u32,
    /// The tiles.
    pub tiles: TileGrid,
    /// Cell of the coin.
    pub coin: [i32; 2],
    /// Bodies in creation order.
    pub spawns: Vec<Spawn>,
    /// Background picture, 0 to 61 (0 in easy mode).
    pub background: u8,
    /// Horizontal offset of the background, in `[0, 1]` of its spare width.
    pub background_offset: f32,
    /// Player colour, 0 to 4 (0 in easy mode).
    pub agent_theme: u8,
    /// Ground theme, 0 to 5 (0 in easy mode).
    pub ground_theme: u8,
    /// Bit `k` (bit `k % 64` of word `k / 64`) is set when step `k` moves along x first if both
    /// speeds are equal.
    pub tie_breaks: [u64; 16],
}

/// A complete level. Change its parts and build a new one rather than editing one in place: the
/// lists of near bodies are computed once.
#[derive(Clone, PartialEq, Debug)]
pub struct Level {
    parts: LevelParts,
    saws: NearBodies,
    crates: NearBodies,
}

impl std::ops::Deref for Level {
    type Target = LevelParts;

    fn deref(&self) -> &LevelParts {
        &self.parts
    }
}

impl Level {
    /// Completes a level from its parts.
    pub fn new(parts: LevelParts) -> Self {
        let saws: Vec<Body> = parts.spawns.iter().filter_map(Spawn::saw).collect();
        let crates: Vec<Body> = parts.spawns.iter().filter_map(Spawn::solid_crate).collect();
        Self { parts, saws: NearBodies::new(&saws), crates: NearBodies::new(&crates) }
    }

    /// Returns the parts, to build a changed level from.
    pub fn parts(&self) -> &LevelParts {
        &self.parts
    }

    /// Returns the enemies at the start, in creation order.
    pub fn enemies(&self) -> Vec<Body> {
        self.spawns.iter().filter_map(Spawn::enemy).collect()
    }

    /// Crates that a body centred at `x` (tiles) can touch in one step, in creation order.
    #[inline]
    pub fn crates_near(&self, x: f32) -> &[Body] {
        self.crates.near(x)
    }

    /// Saws that a body centred at `x` (tiles) can touch in one step, in creation order.
    #[inline]
    pub fn saws_near(&self, x: f32) -> &[Body] {
        self.saws.near(x)
    }

    /// Returns true if x moves first in step `step` (from 0) when both speeds are equal.
    #[inline]
    pub fn x_wins_tie(&self, step: u32) -> bool {
        let step = step as usize % 1024;
        self.tie_breaks[step / 64] >> (step % 64) & 1 == 1
    }

    /// Returns a hash of all that play meets: the tiles, the coin and the bodies, without pictures and tie-breaks.
    pub fn layout_hash(&self) -> u64 {
        let cell = |[x, y]: [i32; 2]| [x as u32 as u64, y as u32 as u64];
        let body = |spawn: &Spawn| match *spawn {
            Spawn::Saw(at) => (0, at),
            Spawn::Crate { cell, .. } => (1, cell),
            Spawn::Enemy { cell, dir, .. } => (3 + i64::from(dir), cell),
        };
        // Bodies of one kind have an order that play can depend on, and the order among kinds is none of a level's.
        let mut bodies: Vec<_> = self.spawns.iter().map(body).collect();
        bodies.sort_by_key(|(kind, _)| (*kind).min(2));
        let bodies = bodies.into_iter().flat_map(|(kind, at)| [kind as u64].into_iter().chain(cell(at)));
        let tiles = self.tiles.rows().into_iter().flat_map(String::into_bytes).map(u64::from);
        StateHash::of(cell(self.coin).into_iter().chain(bodies).chain(tiles)).0
    }

    /// Returns the level in the form of the reference data's JSON objects.
    pub fn to_golden_json(&self) -> GoldenLevel {
        let mut golden = GoldenLevel {
            mode: self.mode,
            seed: self.seed,
            coin: self.coin,
            background: self.background,
            agent_theme: self.agent_theme,
            ground_theme: self.ground_theme,
            saws: Vec::new(),
            crates: Vec::new(),
            enemies: Vec::new(),
            crate_sprites: Vec::new(),
            enemy_sprites: Vec::new(),
            rows: self.tiles.rows(),
        };
        for spawn in &self.spawns {
            match *spawn {
                Spawn::Saw(cell) => golden.saws.push(cell),
                Spawn::Enemy { cell, dir, sprite } => {
                    golden.enemies.push([cell[0], cell[1], i32::from(dir)]);
                    golden.enemy_sprites.push(sprite);
                }
                Spawn::Crate { cell, sprite } => {
                    golden.crates.push(cell);
                    golden.crate_sprites.push(sprite);
                }
            }
        }
        golden
    }
}

/// A level in the shape of the reference data. Cells are `[x, y]`; lists are in creation order.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct GoldenLevel {
    /// Mode of the generator.
    pub mode: Mode,
    /// Seed of the generator.
    pub seed: u32,
    /// Cell of the coin.
    pub coin: [i32; 2],
    /// Background picture.
    pub background: u8,
    /// Player colour.
    pub agent_theme: u8,
    /// Ground theme.
    pub ground_theme: u8,
    /// Cells of the saws.
    pub saws: Vec<[i32; 2]>,
    /// Cells of the crates.
    pub crates: Vec<[i32; 2]>,
    /// Cell and direction (1 right, -1 left) of each enemy.
    pub enemies: Vec<[i32; 3]>,
    /// Pictures of the crates.
    pub crate_sprites: Vec<u8>,
    /// Pictures of the enemies.
    pub enemy_sprites: Vec<u8>,
    /// 64 strings of 64 letters; the first is the bottom row.
    pub rows: Vec<String>,
}

/// A body that a level starts with. Cells are tile coordinates; the body's centre is the middle of
/// its cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Spawn {
    /// A saw. It never moves.
    Saw([i32; 2]),
    /// A patrolling enemy.
    Enemy {
        /// Start cell.
        cell: [i32; 2],
        /// Start direction: 1 right, -1 left.
        dir: i8,
        /// Picture, 0 to 8.
        sprite: u8,
    },
    /// A crate. It never moves.
    Crate {
        /// Cell.
        cell: [i32; 2],
        /// Picture, 0 to 3.
        sprite: u8,
    },
}

impl Spawn {
    pub(super) fn saw(&self) -> Option<Body> {
        match *self {
            Spawn::Saw(cell) => Some(Body::block(cell)),
            _ => None,
        }
    }

    pub(super) fn enemy(&self) -> Option<Body> {
        match *self {
            Spawn::Enemy { cell, dir, .. } => Some(Body::enemy(cell, dir)),
            _ => None,
        }
    }

    pub(super) fn solid_crate(&self) -> Option<Body> {
        match *self {
            Spawn::Crate { cell, .. } => Some(Body::block(cell)),
            _ => None,
        }
    }
}

// Procgen's choice of the next level.

/// One past the largest seed of the unlimited level set (0 to 2^31 - 2).
const UNLIMITED: u32 = i32::MAX as u32;

/// The set of level seeds that episodes are drawn from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LevelSet {
    /// First seed of the set. Not used when `num_levels` is 0.
    pub start_level: u32,
    /// Number of consecutive seeds; 0 means every seed below 2^31 - 1.
    pub num_levels: u32,
}

impl LevelSet {
    fn first(self) -> u32 {
        if self.num_levels == 0 { 0 } else { self.start_level }
    }

    fn len(self) -> u32 {
        if self.num_levels == 0 { UNLIMITED } else { self.num_levels }
    }
}

/// An endless sequence of level seeds for one environment, drawn with replacement.
///
/// An agent chooses its levels by it under `bevy_playbot::level::LevelQueue::Custom(Box::new(levels))`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ProcgenLevels {
    levels: LevelSet,
    generator: Mt,
}

impl ProcgenLevels {
    /// Returns a sequence whose own generator starts from `seed`.
    pub fn new(levels: LevelSet, seed: u32) -> Self {
        Self { levels, generator: Mt::new(seed) }
    }

    /// Returns the seed of the next level.
    pub fn next_level(&mut self) -> u32 {
        let offset = self.generator.next_u32() % self.levels.len();
        self.levels.first().wrapping_add(offset)
    }
}

impl LevelSource for ProcgenLevels {
    fn next_level(&mut self) -> Option<u64> {
        Some(Self::next_level(self).into())
    }

    fn clone_box(&self) -> Box<dyn LevelSource> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::generator::generate;
    use std::collections::BTreeSet;

    #[test]
    fn layouts_repeat_as_often_as_counted_from_their_text() {
        // Counted from the JSON of the levels by two other programs.
        let layouts = |mode, last| (0..=last).map(|seed| generate(mode, seed).layout_hash()).collect::<BTreeSet<_>>();
        let easy = layouts(Mode::Easy, 499);
        assert_eq!((easy.len(), layouts(Mode::Easy, 3999).len()), (422, 2840));
        assert_eq!([1087, 1999].map(|last| layouts(Mode::Hard, last).len()), [869, 1496]);
        let trained = layouts(Mode::Hard, 63);
        let seen = |others: &[&BTreeSet<u64>]| {
            let hashes = (64..=1087).map(|seed| generate(Mode::Hard, seed).layout_hash());
            hashes.filter(|hash| others.iter().any(|other| other.contains(hash))).count()
        };
        assert_eq!((seen(&[&trained]), seen(&[&easy]), seen(&[&trained, &easy])), (46, 222, 224));
        assert_eq!(generate(Mode::Hard, 81).layout_hash(), generate(Mode::Hard, 142).layout_hash());
    }

    #[test]
    fn pictures_and_tie_breaks_are_no_part_of_a_layout() {
        let level = generate(Mode::Hard, 7);
        let other = Level::new(LevelParts {
            background: level.background ^ 1,
            agent_theme: (level.agent_theme + 1) % 5,
            tie_breaks: [!0; 16],
            ..level.parts().clone()
        });
        assert_eq!(level.layout_hash(), other.layout_hash());
        let moved = Level::new(LevelParts { coin: [level.coin[0] + 1, level.coin[1]], ..level.parts().clone() });
        assert_ne!(level.layout_hash(), moved.layout_hash());
    }

    #[test]
    fn modes_read_back_and_errors_list_them() {
        assert_eq!("easy".parse(), Ok(Mode::Easy));
        assert_eq!(Mode::Hard.to_string().parse(), Ok(Mode::Hard));
        let error = "extreme".parse::<Mode>().expect_err("not a mode");
        assert!(error.to_string().contains("`easy` and `hard`"));
        assert_eq!(serde_json::to_string(&Mode::Easy).ok().as_deref(), Some("\"easy\""));
    }

    #[test]
    fn stays_in_the_set_and_covers_it() {
        let mut levels = ProcgenLevels::new(LevelSet { start_level: 64, num_levels: 64 }, 5);
        let mut seen = [false; 64];
        for _ in 0..2000 {
            seen[(levels.next_level() - 64) as usize] = true;
        }
        assert!(seen.iter().all(|&seen| seen));
    }

    #[test]
    fn zero_levels_means_all() {
        let mut levels = ProcgenLevels::new(LevelSet { start_level: 3, num_levels: 0 }, 0);
        let seeds: Vec<u32> = (0..1000).map(|_| levels.next_level()).collect();
        assert!(seeds.iter().all(|&seed| seed < UNLIMITED));
        assert!(seeds.iter().any(|&seed| seed > UNLIMITED / 2));
    }
}
