//! A level from its mode and seed.

use super::{
    builder::{Builder, Built},
    draw::Draw,
    themes::{AGENT_THEMES, BACKGROUNDS, GROUND_THEMES},
};
use crate::coinrun::level::{Level, LevelParts, Mode};

/// Returns the level of this mode and seed. Equal arguments give equal levels.
pub fn generate(mode: Mode, seed: u32) -> Level {
    let mut draw = Draw::new(seed);
    let background_offset = draw.unit();
    let mut background = draw.below(BACKGROUNDS as i32) as u8;
    // The original draws a random start position and then overwrites it.
    draw.unit();
    draw.unit();
    let (mut agent_theme, mut ground_theme) = (0, 0);
    match mode {
        Mode::Easy => background = 0,
        Mode::Hard => {
            agent_theme = draw.below(AGENT_THEMES as i32) as u8;
            ground_theme = draw.below(GROUND_THEMES as i32) as u8;
        }
    }
    let Built { tiles, coin, spawns } = Builder::new(mode, &mut draw).build();
    Level::new(LevelParts {
        mode,
        seed,
        tiles,
        coin,
        spawns,
        background,
        background_offset,
        agent_theme,
        ground_theme,
        tie_breaks: draw.tie_breaks(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{
        spawn::Spawn,
        tile::{SIZE, Tile},
    };

    #[test]
    fn corners_and_pits_keep_their_floor() {
        let level = generate(Mode::Hard, 1);
        assert_eq!(level.tiles.get(0, 0), Tile::Wall);
        assert_eq!(level.tiles.get(SIZE - 1, 0), Tile::Wall);
        assert_eq!(level.tiles.get(1, SIZE - 1), Tile::Wall);
        assert_eq!(level.tiles.get(1, 0), Tile::WallTop);
        // Ground of height 3 owns the bottom row, the pit from x = 24 on does not.
        assert_eq!(level.tiles.get(5, 0), Tile::Wall);
        assert_eq!(level.tiles.get(24, 0), Tile::WallTop);
    }

    #[test]
    fn the_coin_replaces_the_last_barrier() {
        for seed in 0..100 {
            let level = generate(Mode::Hard, seed);
            let [x, y] = level.coin;
            assert_eq!(level.tiles.get(x, y), Tile::Coin);
            assert_eq!(level.tiles.get(x, y - 1), Tile::WallTop);
            assert_eq!(level.tiles.get(x + 1, y), Tile::Wall);
        }
    }

    #[test]
    fn easy_and_hard_share_no_layout_draws() {
        let easy = generate(Mode::Easy, 0);
        let hard = generate(Mode::Hard, 0);
        assert_eq!(easy.coin, [21, 9]);
        assert_eq!(hard.coin, [16, 5]);
        assert_eq!((easy.background, easy.agent_theme), (0, 0));
    }

    #[test]
    fn easy_levels_have_no_enemies_outside_pits() {
        for seed in 0..200 {
            let level = generate(Mode::Easy, seed);
            for spawn in &level.spawns {
                if let Spawn::Enemy { cell, .. } = spawn {
                    assert_eq!(cell[1], 1);
                }
            }
        }
    }
}
