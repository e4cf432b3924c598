//! Verdicts on levels: detectors, findings, exploration, comparison, their reports, and assertions for `cargo test`.

pub mod assertions;
pub mod detectors;
pub mod explore;
pub mod findings;
pub mod verdict;
pub mod verdict_report;
