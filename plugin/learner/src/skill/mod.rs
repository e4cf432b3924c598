//! The skill model: an autoencoder of action sequences.
//!
//! An encoder q(z | τ) turns a window τ of states and actions into a latent skill z, a decoder π(a | s, z) acts it out
//! again, and a prior p(z | s₀) says which skills a player would choose in a state. Training minimises
//! J = NLL + β KL(q ‖ p) (the SCORE paper's Eq. 2 with its sign put right; OPAL, Ajay et al. 2021).
//!
//! There is one pipeline everywhere: observations are used raw, and the decoder sees tanh(z) (or z, by
//! [`SkillConfig::tanh_latent`]) in training and in use.

mod checkpoint;
mod config;
mod dataset;
mod encoder;
mod loss;
mod model;
mod nets;
mod prior;
mod trainer;

pub use config::{Reduction, SkillConfig};
pub use dataset::{Dataset, DemoEpisode, Window};
pub use encoder::Encoder;
pub use loss::{SkillLoss, skill_loss};
pub(crate) use model::SkillDescription;
pub use model::SkillModel;
pub use nets::{SkillForward, SkillNets};
pub use prior::{Prior, SkillDraw};
pub use trainer::{SkillMetrics, SkillProgress, SkillTrainer};
