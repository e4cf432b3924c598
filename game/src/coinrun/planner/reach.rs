//! A proof that the coin cannot be reached: a search over a little more than the rules allow.
//!
//! Heights and vertical speeds are followed exactly, by the rules' own arithmetic, or, where too many are possible,
//! within limits. Positions along x are bins, of which a state holds any number at once. Within a step the player may
//! go to every bin that full speed reaches. So no path is missed, and the search ends: if it has not met the coin by
//! then, no player will.
//!
//! The folder, in reading order:
//!
//! - `ground`: sets of positions along x, and answers about a level at one height.
//! - `step`: one step with exact height and speed, for all positions at once.
//! - `loose`: players that were stopped in the midst of a step.

mod ground;
mod loose;
mod step;

use crate::coinrun::{
    planner::reach::{
        ground::{Bins, ReachableGround},
        loose::out_of_wall,
        step::step,
    },
    rules::corners,
    sim::Sim,
};
use bevy::platform::collections::HashMap;
use std::{cmp::Ordering, collections::BinaryHeap};

/// The search gives up after so many steps; levels need some thousands.
const MOST_STEPS: usize = 100_000;

/// Returns true if no sequence of actions leads from the state of `sim` to the coin.
///
/// `true` is a proof, `false` proves nothing. The search follows heights and vertical speeds exactly until walls stop a
/// step half-way. Positions along x have bins of an eighth of a tile, within which everything counts as possible. The
/// player may turn at full speed. The search includes walls, crates, lava and saws, and neither enemies nor the time.
pub fn coin_is_unreachable(sim: &Sim) -> bool {
    let (level, player, memory) = (sim.level(), sim.player(), sim.player_state());
    let mut ground = ReachableGround::new(level);
    let mut known = Known::default();
    let (place, coin) = (Bins::at(player.x), level.coin[0] as f32 + 0.5);
    let mut after = Vec::new();
    if level.tiles.blocks_player(&corners(player, player.x, player.y)) {
        out_of_wall(&mut ground, player.y, place, &mut after);
    } else {
        let is_held = memory.on_crate || memory.lent_support;
        after.push((State::Exact(Exact { y: player.y, vy: player.vy + 0.0, is_held }), place));
    }
    let mut open = BinaryHeap::new();
    for _ in 0..MOST_STEPS {
        for (next, places) in after.drain(..) {
            let touched = match next {
                State::Exact(state) => ground.touched(state.y),
                State::Loose(state) => loose::touched(&mut ground, state.level),
            };
            if !(places & touched.coin).is_empty() {
                return false;
            }
            let new = known.add(next, places & touched.alive);
            if !new.is_empty() {
                open.push(Open { state: next, places: new, distance: new.distance(coin) });
            }
        }
        let Some(Open { state, places, .. }) = open.pop() else { return true };
        match state {
            State::Exact(state) => step(&mut ground, state, places, &mut after),
            State::Loose(state) => loose::step(&mut ground, state, places, &mut after),
        }
    }
    false
}

/// A state to go on from. The one nearest to the coin goes first: if there is a path, it is found soon.
struct Open {
    state: State,
    places: Bins,
    /// Distance from the coin along x, in bins.
    distance: usize,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.distance == other.distance
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance.cmp(&self.distance)
    }
}

/// Visited states.
#[derive(Default)]
struct Known {
    exact: HashMap<(u32, u32, bool), Bins>,
    loose: HashMap<Loose, Bins>,
}

impl Known {
    /// Adds positions; returns the new ones.
    fn add(&mut self, state: State, places: Bins) -> Bins {
        let known = match state {
            State::Exact(state) => self.exact.entry(state.key()).or_default(),
            State::Loose(state) => {
                // A player that may rise faster may do the same.
                let faster =
                    (state.lift + 1..=loose::FASTEST).filter_map(|lift| self.loose.get(&Loose { lift, ..state }));
                let covered = faster.fold(Bins::NONE, |covered, places| covered | *places);
                let known = self.loose.entry(state).or_default();
                *known |= covered & places;
                known
            }
        };
        let new = places & !*known;
        *known |= places;
        new
    }
}

// State of a player in the search, apart from its position along x.

/// A state of the search.
#[derive(Clone, Copy, PartialEq, Debug)]
enum State {
    /// Height and speed are known.
    Exact(Exact),
    /// They are known within limits.
    Loose(Loose),
}

/// Exact height and speed.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Exact {
    /// Height of the centre, tiles.
    pub y: f32,
    /// Vertical speed, tiles per step.
    pub vy: f32,
    /// True if something other than a wall gives support.
    pub is_held: bool,
}

impl Exact {
    /// Returns the key that distinguishes it from others.
    pub fn key(&self) -> (u32, u32, bool) {
        (self.y.to_bits(), self.vy.to_bits(), self.is_held)
    }
}

/// A height and an upper limit of the speed upwards, in tenths of a tile.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
struct Loose {
    /// Tenth of a tile of the centre.
    pub level: i32,
    /// Its largest rise in the last step.
    pub lift: i32,
}

/// Adds positions to the known ones of an equal key.
fn put<T: PartialEq>(all: &mut Vec<(T, Bins)>, thing: T, places: Bins) {
    if places.is_empty() {
        return;
    }
    match all.iter_mut().find(|(known, _)| *known == thing) {
        Some((_, known)) => *known |= places,
        None => all.push((thing, places)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use crate::coinrun::{
        generator::generate,
        level::{Level, LevelParts, Mode, Spawn},
        planner::{Plan, PlannerConfig, plan},
        rules::{CORNER, FOOT_MARGIN, PLAYER_HALF_WIDTH},
        tile::{Tile, TileGrid},
    };

    fn start(text: &str) -> Sim {
        Sim::new(Arc::new(Level::from_text(text).expect("a valid picture")))
    }

    /// Returns a level with a wall of this height between the start and the coin.
    fn tower(height: usize) -> String {
        let rows = "#...#.....#\n".repeat(height - 1);
        format!("#.........#\n{rows}#A..#....C#\n#=========#\n")
    }

    /// Returns a level with a pit of this width and depth on the path to the coin.
    fn pit(width: usize, bottom: &str) -> String {
        let row =
            |ground: &str, gap: &str| format!("#{}{}{}#\n", ground.repeat(12), gap.repeat(width), ground.repeat(4));
        let air = row(".", ".").repeat(9);
        let coin = format!("#{}{}..C.#\n", ".".repeat(12), ".".repeat(width));
        // The start is at the bottom; steps lead up to the pit's edge.
        let steps = |free: usize| format!("#{}{}{}====#\n", ".".repeat(free), "=".repeat(12 - free), ".".repeat(width));
        let start = format!("#A..={}{}====#\n", "=".repeat(8), bottom.repeat(width));
        let bottom = format!("#{}#\n", "=".repeat(16 + width));
        [air, coin, steps(8).repeat(4), steps(4).repeat(4), start, bottom].concat()
    }

    #[test]
    fn pits_are_jumped_up_to_the_longest_jump_and_not_beyond() {
        // Nine tiles are too far, by less than what a bin may hide.
        for width in 4..=14 {
            let sims = ["^", "="].map(|bottom| start(&pit(width, bottom)));
            match width {
                ..9 => assert!(sims.iter().all(|sim| matches!(plan(sim, &PlannerConfig::default()), Plan::Found(_)))),
                9 => {}
                _ => assert!(sims.iter().all(coin_is_unreachable), "{width}"),
            }
        }
    }

    #[test]
    fn a_tower_that_no_jump_clears_is_proved_and_a_low_one_is_jumped() {
        assert!(coin_is_unreachable(&start(&tower(30))));
        assert_eq!(plan(&start(&tower(30)), &PlannerConfig::default()), Plan::ProvedUnsolvable);
        // A jump lifts by 6.4 tiles.
        assert!(coin_is_unreachable(&start(&tower(7))));
        assert!(matches!(plan(&start(&tower(6)), &PlannerConfig::default()), Plan::Found(_)));
    }

    #[test]
    fn the_player_looks_for_support_where_walls_stop_it() {
        let corner = PLAYER_HALF_WIDTH * CORNER;
        assert_eq!(PLAYER_HALF_WIDTH - FOOT_MARGIN, corner);
    }

    #[test]
    fn generated_levels_are_never_called_unsolvable() {
        for seed in 0..150 {
            for mode in [Mode::Easy, Mode::Hard] {
                let sim = Sim::new(Arc::new(generate(mode, seed)));
                assert!(!coin_is_unreachable(&sim), "{mode} {seed}");
            }
        }
    }

    #[test]
    fn boxes_of_rock_keep_the_player_out_and_holes_let_it_in() {
        let level = |upper: &str, lower: &str| {
            let air = "#...............#\n".repeat(9);
            let roof = "#......######...#\n".repeat(2);
            start(&format!("{air}{roof}#......{upper}...#\n#A.....{lower}...#\n#======######===#\n"))
        };
        assert!(coin_is_unreachable(&level("##.C##", "##..##")));
        assert!(coin_is_unreachable(&level("##.C..", "##..##")), "a hole too low to pass");
        assert!(!coin_is_unreachable(&level("##.C..", "##....")));
    }

    #[test]
    fn who_starts_where_there_is_no_room_stays_there_unless_a_wall_ends() {
        let level = |roof: &str| {
            let air = "#...........#\n".repeat(8);
            start(&format!("{air}{roof}\n#A........C.#\n#===========#\n"))
        };
        assert!(coin_is_unreachable(&level("#####.......#")));
        assert!(coin_is_unreachable(&level("###.........#")));
        assert!(!coin_is_unreachable(&level("#...........#")));
    }

    /// Returns a level of random walls, ledges, crates, saws and lava, with room at the start.
    fn random_level(rng: &mut ChaCha8Rng) -> LevelParts {
        let mut tiles = TileGrid::default();
        tiles.fill(0, 0, 64, 1, Tile::WallTop);
        tiles.fill(0, 0, 1, 64, Tile::Wall);
        tiles.fill(20, 0, 44, 64, Tile::Wall);
        let cell = |rng: &mut ChaCha8Rng| [rng.random_range(3..20), rng.random_range(1..16)];
        for _ in 0..rng.random_range(0..16) {
            let ([x, y], length) = (cell(rng), rng.random_range(1..6));
            let tile = if rng.random_bool(0.1) { Tile::LavaTop } else { Tile::WallTop };
            if rng.random_bool(0.6) { tiles.fill(x, y, length, 1, tile) } else { tiles.fill(x, y, 1, length, tile) }
        }
        let mut spawns: Vec<Spawn> =
            (0..rng.random_range(0..6)).map(|_| Spawn::Crate { cell: cell(rng), sprite: 0 }).collect();
        spawns.extend((0..rng.random_range(0..2)).map(|_| Spawn::Enemy { cell: cell(rng), dir: 1, sprite: 0 }));
        spawns.extend((0..rng.random_range(0..2)).map(|_| Spawn::Saw(cell(rng))));
        LevelParts { tiles, spawns, ..generate(Mode::Hard, 0).parts().clone() }
    }

    #[test]
    fn wherever_somebody_got_is_not_called_unreachable() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut walks, mut proofs) = (0, 0);
        for _ in 0..150 {
            let mut parts = random_level(&mut rng);
            let mut sim = Sim::new(Arc::new(Level::new(parts.clone())));
            let (mut action, mut last) = (4, sim.clone());
            for _ in 0..rng.random_range(20..400) {
                if rng.random_bool(0.2) {
                    action = rng.random_range(0..9);
                }
                sim.step(action);
                if sim.end().is_some() {
                    break;
                }
                last = sim.clone();
            }
            let cell = [last.x() as i32, last.y() as i32];
            let before = sim.level().tiles.get(cell[0], cell[1]);
            if before.is_wall() || cell == [1, 1] {
                continue;
            }
            parts.tiles.set(cell[0], cell[1], Tile::Coin);
            parts.coin = cell;
            let level = Arc::new(Level::new(parts.clone()));
            assert!(!coin_is_unreachable(&Sim::new(level.clone())), "{cell:?}\n{}", level.to_text());
            walks += 1;
            // Another cell.
            parts.tiles.set(cell[0], cell[1], before);
            parts.coin = [rng.random_range(2..20), rng.random_range(1..20)];
            parts.tiles.set(parts.coin[0], parts.coin[1], Tile::Coin);
            proofs += u32::from(coin_is_unreachable(&Sim::new(Arc::new(Level::new(parts)))));
        }
        assert!(walks > 100 && proofs > 10, "{walks} walks, {proofs} proofs");
    }
}
