//! Tests of foreign games and their adapters.

mod actions;
mod agents;
mod assets;
mod choices;
mod clocks;
mod experiments;
mod faults;
mod headless;
mod lines;
mod loading;
mod models;
mod namesakes;
mod play;
#[cfg(unix)]
mod prints;
mod randomised;
mod rebuild;
mod resets;
mod restarts;
mod rivals;
mod snapshots;
mod starts;
