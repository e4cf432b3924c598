//! Defects of rules that can be planted into any game, through the plugin's components of agents: episode, action,
//! reward and observation.

mod action_changes;
mod breakage;
mod chance;
mod dead_action;
mod endings;
mod entity_leak;
mod frozen;
mod history;
mod list;
mod moves;
mod not_a_number;
mod reward_farm;
mod state_leak;
#[cfg(test)]
pub(super) mod testing;
mod when;

pub use list::general_defects;
