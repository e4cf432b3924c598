//! Levels of a mode: from a seed, or from a file.

use std::sync::Arc;

use bevy::{ecs::system::SystemParam, prelude::*};
use playbot_lab::{
    game::{Game, level_designs},
    level_files::{LevelDesigns, is_level_files},
};

use super::{
    components::AntMazeRules,
    level::{AntMazeLevel, generate},
    mode::AntMazeMode,
};
use crate::maze::MazeModeError;

/// The levels of a World.
#[derive(SystemParam)]
pub(super) struct Levels<'w> {
    rules: Res<'w, AntMazeRules>,
    designs: Option<Res<'w, LevelDesigns>>,
}

impl Levels<'_> {
    /// Returns a level, or an explanation why there is none.
    pub fn get(&self, level: u64) -> Result<Arc<AntMazeLevel>, String> {
        match &self.designs {
            Some(designs) => designs.get(level),
            None => generated(&self.rules.0, level),
        }
    }
}

/// Returns a level of a mode that has been checked, or an explanation why there is none.
pub(super) fn level_of(game: &dyn Game, mode: &str, level: u64) -> Result<Arc<AntMazeLevel>, String> {
    if is_level_files(mode) {
        let designs = level_designs(game, mode);
        return designs.map_err(|error| error.to_string())?.get(level);
    }
    generated(&mode.parse().map_err(|error: MazeModeError| error.to_string())?, level)
}

fn generated(mode: &AntMazeMode, level: u64) -> Result<Arc<AntMazeLevel>, String> {
    generate(mode, level).map(Arc::new).map_err(|error| error.to_string())
}
