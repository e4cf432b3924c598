//! Levels as JSON: the output of `playbot level coinrun --json`, and level files.

use playbot_lab::level_files::{
    JsonStep::{Index, Key},
    LevelDesign, LevelTextError, read_json_object,
};
use serde::{Deserialize, Serialize};

use super::{
    creation_order,
    generator::{AGENT_THEMES, BACKGROUNDS, CRATE_SPRITES, ENEMY_SPRITES, GROUND_THEMES},
    level::{GoldenLevel, Level, LevelParts, Mode},
    level_tiles::LevelTiles,
    spawn::Spawn,
    tie_breaks,
    tile::SIZE,
};

/// A level in a file. Cells are `[x, y]` from the bottom left; only the rows are required.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a level: an object with `rows`")]
pub(super) struct LevelText {
    rows: Vec<String>,
    #[serde(default)]
    coin: Option<[i32; 2]>,
    #[serde(default)]
    saws: Vec<[i32; 2]>,
    #[serde(default)]
    crates: Vec<[i32; 2]>,
    #[serde(default)]
    enemies: Vec<[i32; 3]>,
    #[serde(default)]
    crate_sprites: Option<Vec<u8>>,
    #[serde(default)]
    enemy_sprites: Option<Vec<u8>>,
    /// A letter for each body; see [`creation_order`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    order: Option<String>,
    #[serde(default)]
    background: u8,
    #[serde(default)]
    background_offset: f32,
    #[serde(default)]
    agent_theme: u8,
    #[serde(default)]
    ground_theme: u8,
    #[serde(default)]
    tie_breaks: Option<String>,
    /// Origin of a generated level. Play does not need it.
    #[serde(default = "hard")]
    mode: Mode,
    #[serde(default)]
    seed: u32,
}

fn hard() -> Mode {
    Mode::Hard
}

impl Level {
    /// Converts the level to a file's form, with all fields that play and pictures need.
    pub(super) fn to_level_text(&self) -> LevelText {
        let GoldenLevel {
            mode,
            seed,
            coin,
            background,
            agent_theme,
            ground_theme,
            saws,
            crates,
            enemies,
            crate_sprites,
            enemy_sprites,
            rows,
        } = self.to_golden_json();
        LevelText {
            rows,
            coin: Some(coin),
            saws,
            crates,
            enemies,
            crate_sprites: Some(crate_sprites),
            enemy_sprites: Some(enemy_sprites),
            order: creation_order::to_text(&self.spawns),
            background,
            background_offset: self.background_offset,
            agent_theme,
            ground_theme,
            tie_breaks: Some(tie_breaks::to_text(&self.tie_breaks)),
            mode,
            seed,
        }
    }
}

/// Parses a level file.
///
/// # Errors
///
/// The mistake, with its line.
pub(super) fn parse(text: &str) -> Result<LevelDesign, LevelTextError> {
    let level = read_json_object::<LevelText>(text)?.into_level(text)?;
    // The origin of a level is no part of its content.
    let content = LevelText { mode: Mode::Hard, seed: 0, ..level.to_level_text() };
    Ok(LevelDesign::new(level, &serde_json::json!(content).to_string()))
}

impl LevelText {
    fn into_level(self, text: &str) -> Result<Level, LevelTextError> {
        self.check_numbers(text)?;
        self.check_cells(text)?;
        let LevelTiles { tiles, coin } = LevelTiles::read(&self.rows, self.coin, text)?;
        let tie_breaks = match &self.tie_breaks {
            Some(digits) => tie_breaks::from_text(digits).ok_or_else(|| {
                let what =
                    "`tie_breaks` are 256 digits, 0 to 9 and a to f, one for every four steps; leave them out for none";
                LevelTextError::at(text, &[Key("tie_breaks")], what)
            })?,
            None => Default::default(),
        };
        let crate_sprites = sprites(self.crate_sprites, "crate", self.crates.len(), CRATE_SPRITES, text)?;
        let enemy_sprites = sprites(self.enemy_sprites, "enemy", self.enemies.len(), ENEMY_SPRITES, text)?;
        let saws = self.saws.into_iter().map(Spawn::Saw);
        let crates = self.crates.into_iter().zip(crate_sprites).map(|(cell, sprite)| Spawn::Crate { cell, sprite });
        let enemies = self.enemies.into_iter().zip(enemy_sprites).map(|([x, y, dir], sprite)| Spawn::Enemy {
            cell: [x, y],
            dir: if dir < 0 { -1 } else { 1 },
            sprite,
        });
        let listed: Vec<Spawn> = saws.chain(crates).chain(enemies).collect();
        let spawns = match &self.order {
            Some(order) => creation_order::arrange(order, &listed).ok_or_else(|| {
                let what = "`order` has one letter for each body, s for a saw, c for a crate and e for an enemy; leave it out \
                            for all saws, then all crates, then all enemies";
                LevelTextError::at(text, &[Key("order")], what)
            })?,
            None => listed,
        };
        Ok(Level::new(LevelParts {
            mode: self.mode,
            seed: self.seed,
            tiles,
            coin,
            spawns,
            background: self.background,
            background_offset: self.background_offset,
            agent_theme: self.agent_theme,
            ground_theme: self.ground_theme,
            tie_breaks,
        }))
    }

    fn check_numbers(&self, text: &str) -> Result<(), LevelTextError> {
        for (key, value, count) in [
            ("background", self.background, BACKGROUNDS),
            ("agent_theme", self.agent_theme, AGENT_THEMES),
            ("ground_theme", self.ground_theme, GROUND_THEMES),
        ] {
            if u32::from(value) >= count {
                let what = format!("`{key}` is {value}: choose one from 0 to {}", count - 1);
                return Err(LevelTextError::at(text, &[Key(key)], what));
            }
        }
        if !(0.0..=1.0).contains(&self.background_offset) {
            let what = format!("`background_offset` is {}: it lies between 0 and 1", self.background_offset);
            return Err(LevelTextError::at(text, &[Key("background_offset")], what));
        }
        Ok(())
    }

    /// Checks that all inhabitants are inside the level, and that enemies have a direction.
    fn check_cells(&self, text: &str) -> Result<(), LevelTextError> {
        let enemies: Vec<[i32; 2]> = self.enemies.iter().map(|&[x, y, _]| [x, y]).collect();
        for (key, what, cells) in
            [("saws", "saw", &self.saws), ("crates", "crate", &self.crates), ("enemies", "enemy", &enemies)]
        {
            let outside = |cell: &[i32; 2]| cell.iter().any(|along| !(0..SIZE).contains(along));
            if let Some(index) = cells.iter().position(outside) {
                let [x, y] = cells[index];
                let what = format!("the {what} at [{x}, {y}] is outside the level: x and y go from 0 to {}", SIZE - 1);
                return Err(LevelTextError::at(text, &[Key(key), Index(index)], what));
            }
        }
        match self.enemies.iter().position(|[.., dir]| ![-1, 1].contains(dir)) {
            Some(index) => {
                let [x, y, dir] = self.enemies[index];
                let what = format!(
                    "the enemy at [{x}, {y}] walks in direction {dir}: write [x, y, 1] for right or [x, y, -1] for left"
                );
                Err(LevelTextError::at(text, &[Key("enemies"), Index(index)], what))
            }
            None => Ok(()),
        }
    }
}

/// Returns the pictures of the bodies of one kind: the first one for all if none are named.
fn sprites(
    named: Option<Vec<u8>>,
    kind: &str,
    bodies: usize,
    pictures: u32,
    text: &str,
) -> Result<Vec<u8>, LevelTextError> {
    let Some(named) = named else { return Ok(vec![0; bodies]) };
    let key = format!("{kind}_sprites");
    if named.len() != bodies {
        let what =
            format!("`{key}` has {} entries for {bodies} bodies: give each its own, or leave it out", named.len());
        return Err(LevelTextError::at(text, &[Key(&key)], what));
    }
    match named.iter().position(|&sprite| u32::from(sprite) >= pictures) {
        Some(index) => {
            let what = format!("`{key}` has picture {}: choose one from 0 to {}", named[index], pictures - 1);
            Err(LevelTextError::at(text, &[Key(&key), Index(index)], what))
        }
        None => Ok(named),
    }
}
