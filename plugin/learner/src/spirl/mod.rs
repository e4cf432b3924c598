//! SPiRL (Pertsch et al. 2021, "Accelerating reinforcement learning with learned skill priors"): a policy over skills.
//!
//! What acts is the decoder. What learns is π(z | s), which takes the place of the prior: it starts as a copy of it, acts once
//! for as many ticks as a skill is held, and pays for the divergence KL(π(z | s) ‖ p(z | s)) instead of earning entropy. Seen
//! from there a skill is one action whose reward is the discounted sum of what its ticks earned, and its successor is
//! discounted by γᵀ; PPO or SAC learn it as they learn any other action.

mod checkpoint;
mod config;
mod learner;
mod over_skills;
mod skill_steps;

pub use config::SpirlConfig;
pub use learner::SpirlLearner;
