//! Mutation testing of games: planted defects, what testers find of them, and how verdicts agree with people.
//!
//! A mutant is a level or a game with one planted defect, made from a random seed. A tester that finds many mutants,
//! and nothing in unmutated levels, can be trusted with real ones. Most programs use this crate through `playbot`, as
//! `playbot::mutation`.
//!
//! The modules, in reading order:
//!
//! - [`bugs`]: the planted defects, of levels and of games, and the files of mutants.
//! - [`score`]: scores of testers: recall, false findings, and the time until a defect is found.
//! - [`calibration`]: the comparison of test results with recordings of people.

pub mod bugs;
pub mod calibration;
mod scatter;
pub mod score;
