//! Levels of a mode: from a seed, or from a file.

use std::sync::Arc;

use bevy::{ecs::system::SystemParam, prelude::*};
use playbot_lab::{
    game::{Game, level_designs},
    level_files::{LevelDesigns, is_level_files},
};

use super::{components::Maze2dRules, level::Maze2dLevel, level_text::DrawnLevel, mode::Maze2dMode};
use crate::maze::MazeModeError;

/// The levels of a World, each with its rules.
#[derive(SystemParam)]
pub(super) struct Levels<'w> {
    rules: Res<'w, Maze2dRules>,
    designs: Option<Res<'w, LevelDesigns>>,
}

impl Levels<'_> {
    /// Returns a level and its rules, or an explanation why there is none.
    pub fn get(&self, level: u64) -> Result<(Arc<Maze2dLevel>, Maze2dMode), String> {
        match &self.designs {
            Some(designs) => drawn(designs, level),
            None => generated(self.rules.0.clone(), level),
        }
    }
}

/// Returns a level of a mode that has been checked, and its rules, or an explanation why there is none.
pub(super) fn level_of(game: &dyn Game, mode: &str, level: u64) -> Result<(Arc<Maze2dLevel>, Maze2dMode), String> {
    if is_level_files(mode) {
        let designs = level_designs(game, mode);
        return drawn(&designs.map_err(|error| error.to_string())?, level);
    }
    generated(mode.parse().map_err(|error: MazeModeError| error.to_string())?, level)
}

pub(super) fn drawn(designs: &LevelDesigns, level: u64) -> Result<(Arc<Maze2dLevel>, Maze2dMode), String> {
    let drawn = designs.get::<DrawnLevel>(level)?;
    Ok((Arc::new(drawn.level.clone()), drawn.rules.clone()))
}

fn generated(rules: Maze2dMode, level: u64) -> Result<(Arc<Maze2dLevel>, Maze2dMode), String> {
    let level = Maze2dLevel::new(&rules, level).map_err(|error| error.to_string())?;
    Ok((Arc::new(level), rules))
}
