//! Tests of a game's levels: which can be solved, and what is wrong with them.
//!
//! Testers are bots, policies and explorers. They play every level of a range without a window, and detectors watch
//! them. Every level gets a verdict: solved, not solved by any tester, or proved unsolvable. Results are the same bytes
//! on any number of threads and machines. Most programs use this crate through `playbot`, as `playbot::test`.
//!
//! The modules, in reading order:
//!
//! - [`assertions`]: assertions about levels, for a game's own `cargo test`. Begin here; it has an example.
//! - [`verdict`]: verdicts on a range of levels, their results as a file, and comparison with earlier ones.
//! - [`detectors`]: the detectors that every game has, and their settings.
//! - [`findings`]: findings as files that replay, get shorter, and become tests.
//! - [`explore`]: exploration of a level without training.
//! - [`verdict_report`]: results as one HTML page, with pictures of the worst levels.
//! - [`history`]: levels and findings over the builds of a game.
//! - [`quick`]: the verdict on a level while somebody draws it.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod assertions;
pub mod detectors;
pub mod explore;
pub mod findings;
pub mod history;
pub mod quick;
pub mod verdict;
pub mod verdict_report;
