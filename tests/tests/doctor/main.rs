//! The doctor and games with planted faults.

mod foreign;
mod planted;
