//! The laboratory of [`bevy_playbot`]: everything that trains, measures and compares bots, headless and on many levels.
//!
//! - A [`Game`](game::Game) says how a game is built without a window, many arenas at a time.
//! - [`level_files`] are levels that somebody drew, in ranges like those that are made from seeds.
//! - [`train`] learns from recordings and from play; [`demo`] proves recordings by replay and makes data sets of them.
//! - [`eval`] measures, every level equally often; [`runs`] reads back and compares what was trained; [`report`] draws it.
//! - [`verdict`] says of each level whether bots solved it, failed, or nobody can; results of shards and of two states of a
//!   game are joined and compared there. [`verdict_report`] makes a page of them that people read.
//! - [`calibration`] holds results beside recordings of people on the same levels.
//! - [`assertions`] are for a game's own `cargo test`: levels that must be solved, recordings that must play again.
//! - [`findings`] keeps what was found with the actions that lead there, plays it again and makes it shorter.
//! - [`detectors`] look for defects while bots play: agents that are stuck, leave their level or are no numbers any more,
//!   and what a game adds with a [`detector`] of its own.
//! - [`bugs`] plants defects into games and levels, to measure which testers notice.
//! - [`explore`] finds its way through a level by itself, without training: what can be reached, and how.
//! - [`doctor`] finds out whether a game plays the same when it is given the same actions, and what differs if not.
//! - [`pipeline`] goes the whole road with five functions; [`policy_export`] makes the one file that a game ships with, for
//!   [`policy_file`](bevy_playbot::policy_file) to load there.
//!
//! A game that only ships a bot needs none of this: it depends on `bevy_playbot` alone.

pub mod arrangement;
pub mod assertions;
pub mod benchmark;
#[doc(hidden)]
pub mod brief;
pub mod bugs;
pub mod calibration;
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
pub mod mode;
pub mod parallel;
pub mod pipeline;
pub mod policy_export;
pub mod prelude;
pub mod proof;
pub mod report;
pub mod runs;
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
