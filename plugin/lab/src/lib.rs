//! Training, measurement and comparison of [`bevy_playbot`] bots, headless and on many levels.
//!
//! - [`Game`](game::Game) says how a game is built without a window, many arenas at a time.
//! - [`level_files`] are levels from files, in ranges like those that are generated from seeds.
//! - [`train`] learns from recordings and from play. [`demo`] verifies recordings by replay and makes data sets of
//!   them.
//! - [`eval`] measures policies, every level equally often. [`runs`] reads runs back and compares them, [`report`]
//!   draws them.
//! - [`verdict`] says for each level: solved, failed, or proved to be unsolvable. It also joins the results of shards
//!   and compares those of two states of a game. [`verdict_report`] writes them as a page.
//! - [`calibration`] compares results with recordings of people on the same levels.
//! - [`assertions`] are for a game's own `cargo test`: levels must be solved, recordings must replay.
//! - [`findings`] stores findings with the actions that lead to them, replays them and shortens them.
//! - [`detectors`] look for defects while bots play: agents that are stuck, leave their level or have positions that
//!   are no numbers. A game adds its own with [`detector`].
//! - [`bugs`] plants defects into games and levels, to measure which testers find them.
//! - [`explore`] searches a level without training, and reports which cells can be reached, and how.
//! - [`doctor`] checks whether a game plays the same for the same actions, and reports the differences.
//! - [`pipeline`] goes from recordings to a policy with five functions. [`policy_export`] writes the policy file that a
//!   game ships with and loads with [`policy_file`](bevy_playbot::policy_file).
//!
//! A game that only ships a bot needs nothing of this: it depends on `bevy_playbot` alone.

pub mod arrangement;
pub mod assertions;
pub mod benchmark;
#[doc(hidden)]
pub mod brief;
pub mod bugs;
pub mod calibration;
#[cfg(test)]
pub(crate) mod corridor;
pub mod defect;
pub mod demo;
pub mod detector;
pub mod detectors;
pub mod doctor;
pub mod drawing;
mod ended_episodes;
mod escape;
pub mod eval;
pub mod experiment_text;
pub mod explore;
pub mod findings;
pub mod floor_plan;
pub mod foreign;
pub mod game;
pub mod games;
pub mod held_out;
mod idle;
pub mod inspect;
pub mod level_files;
pub mod machine;
pub mod mode;
pub mod parallel;
pub mod pipeline;
pub mod policy_export;
pub mod prelude;
pub mod proof;
pub mod report;
pub mod runs;
pub mod sealed_file;
pub mod sensors;
#[doc(hidden)]
pub mod shell_word;
pub mod space_view;
pub mod split;
pub mod stage_clock;
mod text_file;
pub mod trace;
pub mod train;
pub mod verdict;
pub mod verdict_report;
pub mod worlds;
