//! Enemies, which walk to and fro between walls and barriers.

use super::body::Body;
use super::constants::OVERLAP_MARGIN;
use super::motion::{advance, corners, mirrored};
use super::player::{PlayerState, PlayerStep};
use crate::coinrun::tile::TileGrid;

/// Moves one enemy. `crates` may be any subset that contains those within a tile of the enemy.
///
/// Enemies bounce off walls and barriers. Inner ground ([`Tile::Wall`](crate::coinrun::tile::Tile::Wall)) also counts
/// as "outside", which blocks. A turn there therefore loses a quarter of the speed: one of four parts was blocked.
///
/// The original has an oddity that is kept here. It asks whether a crate holds an enemy with the state of the player.
/// While a falling player is high enough above a crate that an enemy overlaps, the player is marked as standing on a
/// crate ([`PlayerState::lent_support`]), and the enemy counts as blocked vertically. If the enemy turns at inner
/// ground in that tick, both axes are blocked and its step ends early.
#[inline]
pub fn patrol(
    enemy: &mut Body,
    player_state: &mut PlayerState,
    player: &PlayerStep,
    tiles: &TileGrid,
    crates: &[Body],
) {
    let x_first = enemy.vx.abs() > enemy.vy.abs();
    let can_hold = player.vy < 0.0 && player.ay >= 0 && !crates.is_empty();
    advance(enemy, x_first, |enemy, dx, dy| {
        let blocked = bounce(enemy, tiles, dx, dy);
        if dx != 0.0 || !can_hold {
            return blocked;
        }
        let held =
            crates.iter().any(|block| enemy.overlaps(block, OVERLAP_MARGIN) && player.is_held_by(block, player.vy));
        player_state.lent_support |= held;
        blocked || held
    });
}

/// Moves an enemy along one axis, turning it at walls and barriers. Tells whether it was blocked.
#[inline]
fn bounce(enemy: &mut Body, tiles: &TileGrid, dx: f32, dy: f32) -> bool {
    let (x, y) = (enemy.x + dx, enemy.y + dy);
    let corners = corners(enemy, x, y);
    (enemy.x, enemy.y) = (x, y);
    if !tiles.turns_enemy(&corners) {
        return false;
    }
    if dx != 0.0 {
        enemy.x = mirrored(x, enemy.rx, dx > 0.0);
        enemy.vx = -enemy.vx;
    }
    tiles.is_outside(&corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::level::Level;
    use crate::coinrun::rules::begin_step;

    fn patrol_steps(text: &str, steps: usize) -> Vec<Body> {
        let level = Level::from_text(text).expect("a valid picture");
        let mut enemy = level.enemies()[0];
        let (mut player, mut state) = (Body::player(), PlayerState::default());
        let step = begin_step(&mut player, &mut state, &level.tiles, 4);
        let mut path = Vec::new();
        for _ in 0..steps {
            let crates = level.crates_near(enemy.x);
            patrol(&mut enemy, &mut state, &step, &level.tiles, crates);
            path.push(enemy);
        }
        path
    }

    #[test]
    fn turning_at_inner_ground_costs_a_quarter_of_the_speed() {
        let path = patrol_steps("#....C\n#.>.#.\n######\n", 12);
        assert!(path.iter().any(|enemy| enemy.vx == -0.112_500_004));
    }

    #[test]
    fn turning_at_surface_or_barrier_is_free() {
        for wall in ['=', '|'] {
            let path = patrol_steps(&format!("#....C\n#.>.{wall}.\n######\n"), 12);
            assert!(path.iter().any(|enemy| enemy.vx < 0.0));
            assert!(path.iter().all(|enemy| enemy.vx.abs() == 0.15));
        }
    }

    #[test]
    fn an_enemy_never_leaves_its_row() {
        let path = patrol_steps("#.....C\n#.>xx#.\n#######\n", 300);
        assert!(path.iter().all(|enemy| enemy.y == 1.5));
    }
}
