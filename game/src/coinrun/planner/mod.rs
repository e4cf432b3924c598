//! A player that searches with the rules for actions that reach the coin.
//!
//! [`plan`] looks for a sequence of actions from any state of an episode. [`Demonstrator`] plays such plans while its
//! actions are disturbed. [`coin_is_unreachable`] proves that a level cannot be won.

mod config;
mod demonstrator;
mod hazard;
mod plan;
mod reach;
mod search;

pub use config::PlannerConfig;
pub use demonstrator::Demonstrator;
pub use plan::{Plan, plan};
pub use reach::coin_is_unreachable;
