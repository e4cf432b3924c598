//! The skill model: an autoencoder of action sequences.
//!
//! An encoder q(z | τ) turns a window τ of states and actions into a latent skill z. A decoder π(a | s, z) turns z
//! back into actions. A prior p(z | s₀) says which skills a demonstrator would choose in a state. Training minimises
//! J = NLL + β KL(q ‖ p) (the SCORE paper's Eq. 2 with its sign corrected; OPAL, Ajay et al. 2021).
//!
//! Observations are vectors or images ([`crate::ObsKind`]). For images each of the three networks has its own trunk
//! of convolutions ([`SkillConfig::cnn`]), before the layers that would read a vector.
//!
//! There is one pipeline everywhere. The networks see observations raw (pixels divided by 255) or through one frozen
//! normaliser ([`SkillConfig::norm_obs`]). The decoder sees tanh(z) (or z, by [`SkillConfig::tanh_latent`]). This
//! holds in training, in use, and in the policies that are tied to it.

mod action_input;
mod checkpoint;
mod config;
mod dataset;
mod description;
mod encoder;
mod held_out;
mod loss;
mod metrics;
mod model;
mod nets;
mod prior;
mod source;
mod state_heads;
mod trainer;
mod windows;

pub use action_input::ActionInput;
pub use config::{Reduction, SkillConfig};
pub use dataset::{Dataset, DemoEpisode};
pub(crate) use description::SkillDescription;
pub use encoder::{Encoder, StateNet};
pub use held_out::HeldOutMetrics;
pub use loss::{SkillLoss, skill_loss};
pub use metrics::SkillMetrics;
pub use model::SkillModel;
pub(crate) use nets::Actors;
pub use nets::{SkillForward, SkillNets};
pub use prior::{Prior, SkillDraw};
pub(crate) use source::SKILL_STATS;
pub use source::SkillSource;
pub use state_heads::StateHeads;
pub use trainer::{SkillProgress, SkillTrainer};
pub use windows::{Window, WindowRule};
