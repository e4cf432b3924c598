//! Levels of a mode: from a seed, or from a file.

use std::sync::Arc;

use bevy::{ecs::system::SystemParam, prelude::*};
use playbot_lab::{
    game::{Game, level_designs},
    level_files::{LevelDesigns, is_level_files},
};

use super::{components::CoinRunMode, generate, level::Level};

/// The levels of a World.
#[derive(SystemParam)]
pub(super) struct Levels<'w> {
    mode: Res<'w, CoinRunMode>,
    designs: Option<Res<'w, LevelDesigns>>,
}

impl Levels<'_> {
    /// Returns a level, or an explanation why there is none.
    pub fn get(&self, level: u64) -> Result<Arc<Level>, String> {
        match &self.designs {
            Some(designs) => designs.get(level),
            None => generated(self.mode.0, level),
        }
    }
}

/// Returns a level of a mode that has been checked, or an explanation why there is none.
pub(super) fn level_of(game: &dyn Game, mode: &str, level: u64) -> Result<Arc<Level>, String> {
    if is_level_files(mode) {
        let designs = level_designs(game, mode);
        return designs.map_err(|error| error.to_string())?.get(level);
    }
    generated(mode.parse().map_err(|error: super::level::UnknownMode| error.to_string())?, level)
}

fn generated(mode: super::Mode, level: u64) -> Result<Arc<Level>, String> {
    match u32::try_from(level) {
        Ok(seed) => Ok(Arc::new(generate(mode, seed))),
        Err(_) => {
            Err(format!("level {level} does not exist: CoinRun's seeds have 32 bits, choose one up to {}", u32::MAX))
        }
    }
}
