//! Contacts of the player after all movement, and the end of an episode.

use serde::{Deserialize, Serialize};

use super::body::Body;
use super::constants::{OVERLAP_MARGIN, TIMEOUT};
use crate::coinrun::tile::{SIZE, Tile, TileGrid};

/// The end of an episode.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The player reached the coin. Also when something deadly was touched in the same step.
    Coin,
    /// The player touched a saw.
    Saw,
    /// The player touched an enemy.
    Enemy,
    /// The player touched lava.
    Lava,
    /// The player left the level.
    LeftMap,
    /// The time was up.
    Timeout,
}

impl Outcome {
    /// Returns true if the coin was reached, which pays the reward.
    pub const fn is_success(self) -> bool {
        matches!(self, Outcome::Coin)
    }

    /// Returns the cause of a failure in words; `None` if the coin was reached.
    pub const fn cause(self) -> Option<&'static str> {
        match self {
            Outcome::Coin => None,
            Outcome::Saw => Some("saw"),
            Outcome::Enemy => Some("enemy"),
            Outcome::Lava => Some("lava"),
            Outcome::LeftMap => Some("left the map"),
            Outcome::Timeout => Some("time"),
        }
    }
}

/// Returns the end of the episode after step number `step` (from 1), if it ends. `saws` may be any subset that contains
/// those within a tile of the player.
#[inline]
pub fn touch<'a>(
    player: &Body,
    tiles: &TileGrid,
    saws: impl IntoIterator<Item = &'a Body>,
    enemies: impl IntoIterator<Item = &'a Body>,
    step: u32,
) -> Option<Outcome> {
    let (coin, lava) = touched_tiles(player, tiles);
    let hits = |body: &'a Body| body.overlaps(player, 0.0);
    if coin {
        Some(Outcome::Coin)
    } else if saws.into_iter().any(hits) {
        Some(Outcome::Saw)
    } else if enemies.into_iter().any(hits) {
        Some(Outcome::Enemy)
    } else if lava {
        Some(Outcome::Lava)
    } else if has_left(player) {
        Some(Outcome::LeftMap)
    } else {
        (step >= TIMEOUT).then_some(Outcome::Timeout)
    }
}

/// Returns whether the player's rectangle, a little shrunk, covers a coin tile and a lava tile.
#[inline]
fn touched_tiles(player: &Body, tiles: &TileGrid) -> (bool, bool) {
    let (rx, ry) = (player.rx + OVERLAP_MARGIN, player.ry + OVERLAP_MARGIN);
    let columns = (player.x - rx) as i32..=(player.x + rx) as i32;
    let (low, high) = ((player.y - ry) as i32, (player.y + ry) as i32);
    let (mut coin, mut lava) = (false, false);
    for x in columns {
        for y in low..=high {
            let tile = tiles.get(x, y);
            coin |= tile == Tile::Coin;
            lava |= tile.is_lava();
        }
    }
    (coin, lava)
}

#[inline]
fn has_left(player: &Body) -> bool {
    let size = SIZE as f32;
    player.x + player.rx < 0.0
        || player.y + player.ry < 0.0
        || player.x - player.rx > size
        || player.y - player.ry > size
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(player: Body, tiles: &TileGrid, saws: &[Body], enemies: &[Body]) -> Option<Outcome> {
        touch(&player, tiles, saws, enemies, 1)
    }

    #[test]
    fn the_coin_wins_over_everything() {
        let mut tiles = TileGrid::default();
        tiles.set(1, 1, Tile::Coin);
        tiles.set(1, 2, Tile::LavaTop);
        let saw = [Body::block([1, 1])];
        assert_eq!(ends(Body::player(), &tiles, &saw, &saw), Some(Outcome::Coin));
        assert_eq!(touch(&Body::player(), &tiles, &saw, [], TIMEOUT), Some(Outcome::Coin));
    }

    #[test]
    fn flush_bodies_do_not_touch() {
        let tiles = TileGrid::default();
        let player = Body::player();
        let beside = [Body::block([2, 1])];
        assert_eq!(ends(player, &tiles, &beside, &[]), None);
        let closer = Body { x: player.x + 0.001, ..player };
        assert_eq!(ends(closer, &tiles, &beside, &[]), Some(Outcome::Saw));
        assert_eq!(ends(closer, &tiles, &[], &beside), Some(Outcome::Enemy));
    }

    #[test]
    fn lava_the_border_and_the_clock_end_episodes() {
        let mut tiles = TileGrid::default();
        let player = Body::player();
        assert_eq!(touch(&player, &tiles, [], [], TIMEOUT), Some(Outcome::Timeout));
        assert_eq!(touch(&player, &tiles, [], [], TIMEOUT - 1), None);
        let gone = Body { x: 65.0, ..player };
        assert_eq!(ends(gone, &tiles, &[], &[]), Some(Outcome::LeftMap));
        tiles.set(1, 1, Tile::Lava);
        assert_eq!(ends(player, &tiles, &[], &[]), Some(Outcome::Lava));
    }
}
