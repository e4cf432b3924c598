//! SPiRL (Pertsch et al. 2021, "Accelerating reinforcement learning with learned skill priors"): a policy over skills.
//!
//! The decoder acts. The policy over skills, π(z | s), learns and takes the place of the prior. It starts as a copy
//! of the prior and acts once per skill interval. It pays for the divergence KL(π(z | s) ‖ p(z | s)) instead of
//! earning entropy. To this policy a skill is one action, whose reward is the discounted sum of its ticks' rewards
//! and whose next state is discounted by γᵀ. PPO or SAC learn it like any other action.

mod checkpoint;
mod config;
mod learner;
mod over_skills;
mod skill_steps;

pub use config::SpirlConfig;
pub use learner::SpirlLearner;
