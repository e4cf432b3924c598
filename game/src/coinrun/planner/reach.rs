//! A proof that the coin cannot be reached: a flood fill that allows more than the rules do.

use crate::coinrun::{level::Level, sim::Sim, spawn::Spawn, tile::SIZE};

/// A jump lifts the player's centre by 6.4 tiles, so by at most this many rows.
const JUMP_ROWS: i32 = 7;

const CELLS: usize = (SIZE * SIZE) as usize;

/// Whether no sequence of actions whatever leads from the state of `sim` to the coin.
///
/// `true` is a proof, `false` says nothing. The fill follows the cell of the player's centre and
/// ignores hazards, time and momentum. The centre may go to every neighbour cell that is not deep
/// in a wall, as long as it stays at most a jump above a place that may have given support on the
/// way.
pub fn coin_is_unreachable(sim: &Sim) -> bool {
    let start = [sim.x() as i32, sim.y() as i32];
    !FloodFill::new(sim.level()).reaches_coin(start)
}

struct FloodFill<'a> {
    level: &'a Level,
    crates: Vec<[i32; 2]>,
    /// For each cell, the highest row that a player who has been there may still get to. -1 for a
    /// cell that was not visited.
    ceiling: Vec<i32>,
    queue: Vec<[i32; 2]>,
}

impl<'a> FloodFill<'a> {
    fn new(level: &'a Level) -> Self {
        let crate_cell = |spawn: &Spawn| match *spawn {
            Spawn::Crate { cell, .. } => Some(cell),
            _ => None,
        };
        Self {
            level,
            crates: level.spawns.iter().filter_map(crate_cell).collect(),
            ceiling: vec![-1; CELLS],
            queue: Vec::new(),
        }
    }

    fn reaches_coin(mut self, start: [i32; 2]) -> bool {
        // Whatever the velocity at the start is, it lifts no higher than a jump.
        self.visit(start, start[1] + JUMP_ROWS);
        while let Some([x, y]) = self.queue.pop() {
            if self.touches_coin(x, y) {
                return true;
            }
            let ceiling = self.ceiling[(y * SIZE + x) as usize];
            for next in [[x - 1, y], [x + 1, y], [x, y - 1], [x, y + 1]] {
                if next[1] <= ceiling {
                    self.visit(next, ceiling);
                }
            }
        }
        false
    }

    fn visit(&mut self, [x, y]: [i32; 2], ceiling: i32) {
        let inside = (0..SIZE).contains(&x) && (0..SIZE).contains(&y);
        if !inside || self.is_deep_in_wall(x, y) {
            return;
        }
        let lift = if self.may_stand(x, y) { y + JUMP_ROWS } else { 0 };
        let highest = ceiling.max(lift);
        let known = &mut self.ceiling[(y * SIZE + x) as usize];
        if highest > *known {
            *known = highest;
            self.queue.push([x, y]);
        }
    }

    /// Whether the player's centre can certainly not be in this cell. The tested corners are less
    /// than a tile apart horizontally but more than a tile vertically, so the centre can slip
    /// through a wall that is one tile thick, and through nothing else.
    fn is_deep_in_wall(&self, x: i32, y: i32) -> bool {
        (y - 1..=y + 1).all(|row| self.level.tiles.get(x, row).is_wall())
    }

    /// Whether something near the feet of a player in this cell might carry it: a crate, or a wall
    /// with a free cell on it. The side of a wall does not carry: the points that look for support
    /// are in the same columns as the corners that walls keep out.
    fn may_stand(&self, x: i32, y: i32) -> bool {
        let columns = x - 1..=x + 1;
        let is_wall = |column, row| self.level.tiles.get(column, row).is_wall();
        let is_floor = |column| (y - 1..=y).any(|row| is_wall(column, row) && !is_wall(column, row + 1));
        let on_wall = columns.clone().any(is_floor);
        let on_crate = |cell: &[i32; 2]| columns.contains(&cell[0]) && (y - 2..=y).contains(&cell[1]);
        on_wall || self.crates.iter().any(on_crate)
    }

    fn touches_coin(&self, x: i32, y: i32) -> bool {
        let [coin_x, coin_y] = self.level.coin;
        (x - coin_x).abs() <= 1 && (y - coin_y).abs() <= 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use crate::coinrun::generator::generate;
    use crate::coinrun::level::Mode;
    use crate::coinrun::planner::{Plan, PlannerConfig, plan};
    use crate::coinrun::rules::{CORNER, FOOT_MARGIN, PLAYER_HALF_WIDTH};

    fn start(text: &str) -> Sim {
        let level = Level::from_text(text).expect("a valid picture");
        Sim::new(Arc::new(level))
    }

    /// A level with a wall of this height between the start and the coin.
    fn tower(height: usize) -> String {
        let rows = "#...#.....#\n".repeat(height - 1);
        format!("#.........#\n{rows}#A..#....C#\n#=========#\n")
    }

    #[test]
    fn a_tower_that_no_jump_clears_is_proved() {
        assert!(coin_is_unreachable(&start(&tower(30))));
        let result = plan(&start(&tower(30)), &PlannerConfig::default());
        assert_eq!(result, Plan::ProvedUnsolvable);
    }

    #[test]
    fn the_player_looks_for_support_where_walls_stop_it() {
        let corner = PLAYER_HALF_WIDTH * CORNER;
        assert_eq!(PLAYER_HALF_WIDTH - FOOT_MARGIN, corner);
    }

    #[test]
    fn a_low_tower_is_jumped() {
        let result = plan(&start(&tower(5)), &PlannerConfig::default());
        assert!(matches!(result, Plan::Found(_)), "{result:?}");
    }

    #[test]
    fn generated_levels_are_never_called_unsolvable() {
        for seed in 0..500 {
            for mode in [Mode::Easy, Mode::Hard] {
                let sim = Sim::new(Arc::new(generate(mode, seed)));
                assert!(!coin_is_unreachable(&sim), "{mode} {seed}");
            }
        }
    }
}
