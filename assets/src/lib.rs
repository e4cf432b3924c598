//! Files that are part of the program `playbot`: drawings, experiments, presets and a trained walker.
//!
//! Each file is a constant, so a misspelt name does not compile.
//!
//! ```
//! use playbot_assets::{PRESETS, experiments};
//!
//! assert_eq!(experiments::COINRUN.path, "assets/experiments/coinrun.ron");
//! assert!(PRESETS.iter().any(|preset| preset.name == "coinrun-ppo"));
//! ```

/// An experiment, or a preset: some of the keys of an experiment, for others to build on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExperimentFile {
    /// The file's name without `.ron`.
    pub name: &'static str,
    /// The file's path in the repository.
    pub path: &'static str,
    /// The RON text.
    pub text: &'static str,
}

impl ExperimentFile {
    /// Returns the description: the first line of the file.
    pub fn about(self) -> &'static str {
        self.text.lines().next().unwrap_or_default().trim_start_matches('/').trim()
    }
}

macro_rules! embedded {
    ($folder:literal, $name:literal) => {
        ExperimentFile {
            name: $name,
            path: concat!("assets/", $folder, "/", $name, ".ron"),
            text: include_str!(concat!("../", $folder, "/", $name, ".ron")),
        }
    };
}

macro_rules! presets {
    ($($name:literal),* $(,)?) => {
        [$(embedded!("presets", $name)),*]
    };
}

/// All presets: those of the paper and of its released code, and smaller ones.
pub const PRESETS: [ExperimentFile; 9] = presets![
    "coinrun-ppo",
    "coinrun-sac",
    "d4rl-ppo",
    "d4rl-sac",
    "maze-hour",
    "skill-paper",
    "skill-released",
    "score-released-coinrun",
    "score-released-d4rl",
];

/// Default experiments of the games.
pub mod experiments {
    use super::ExperimentFile;

    /// CoinRun's.
    pub const COINRUN: ExperimentFile = embedded!("experiments", "coinrun");
    /// Maze2D's.
    pub const MAZE2D: ExperimentFile = embedded!("experiments", "maze2d");
    /// AntMaze's.
    pub const ANTMAZE: ExperimentFile = embedded!("experiments", "antmaze");
}

/// A policy file in the safetensors format: the walker of AntMaze, trained in the game `ant`.
pub const ANT_WALKER: &[u8] = include_bytes!("../models/ant-walker.safetensors");

macro_rules! drawings {
    ($folder:literal: $($constant:ident = $name:literal,)*) => {
        $(
            #[doc = concat!("The PNG `", $folder, "/", $name, ".png`.")]
            pub const $constant: &[u8] = include_bytes!(concat!("../", $folder, "/", $name, ".png"));
        )*
    };
}

/// Drawings of CoinRun.
pub mod coinrun {
    /// Tiles and figures as text. The example `draw_coinrun` of `playbot_games` draws the PNGs from it.
    pub const SPRITES: &str = include_str!("../coinrun/sprites.txt");

    drawings! { "coinrun":
        FIGURES = "figures",
        GROUND_DIRT = "ground_dirt",
        GROUND_GRASS = "ground_grass",
        GROUND_PLANET = "ground_planet",
        GROUND_SAND = "ground_sand",
        GROUND_SNOW = "ground_snow",
        GROUND_STONE = "ground_stone",
        BACKDROP_AUTUMN = "backdrop_autumn",
        BACKDROP_BRICKS = "backdrop_bricks",
        BACKDROP_CAVE = "backdrop_cave",
        BACKDROP_CITY = "backdrop_city",
        BACKDROP_DESERT = "backdrop_desert",
        BACKDROP_DUSK = "backdrop_dusk",
        BACKDROP_FOREST = "backdrop_forest",
        BACKDROP_MEADOW = "backdrop_meadow",
        BACKDROP_NEBULA = "backdrop_nebula",
        BACKDROP_NIGHT = "backdrop_night",
        BACKDROP_RED_PLANET = "backdrop_red_planet",
        BACKDROP_RINGED = "backdrop_ringed",
        BACKDROP_SEA = "backdrop_sea",
        BACKDROP_STARS = "backdrop_stars",
        BACKDROP_SWAMP = "backdrop_swamp",
        BACKDROP_WINTER = "backdrop_winter",
    }
}

/// Drawings of Maze2D.
pub mod maze2d {
    drawings! { "maze2d":
        TILES = "tiles",
        BALL = "ball",
        GOAL = "goal",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_presets_is_a_preset() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/presets");
        let entries = std::fs::read_dir(folder).expect("part of the package");
        let mut files: Vec<_> =
            entries.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned()).collect();
        let mut presets = PRESETS.map(|preset| format!("{}.ron", preset.name)).to_vec();
        files.sort();
        presets.sort();
        assert_eq!(files, presets);
        assert!(PRESETS.iter().all(|preset| !preset.about().is_empty()));
    }
}
