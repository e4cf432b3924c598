//! Tests of the doctor on games with planted faults.

mod agents;
mod foreign;
mod messages;
mod planted;
mod replays;
mod snapshots;
