//! How a game of [`bevy_playbot`] runs headless: games, Worlds, levels, sensors, players and the doctor.

pub mod arrangement;
pub mod benchmark;
pub mod brief;
pub mod defect;
pub mod demo;
pub mod detector;
pub mod doctor;
pub mod drawing;
pub mod eval;
pub mod floor_plan;
pub mod foreign;
pub mod game;
pub mod games;
pub mod inspect;
pub mod level_files;
pub mod machine;
pub mod mode;
pub mod parallel;
pub mod prelude;
pub mod sealed_file;
pub mod sensors;
pub mod split;
pub mod trace;
pub mod trails;
pub mod worlds;
