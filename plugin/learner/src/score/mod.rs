//! SCORE: what ties an online policy to the skill decoder.
//!
//! Three switches over PPO: the policy reads the skill z ([`ScoreConfig::condition`]), starts as a copy of the decoder
//! ([`ScoreConfig::init_from_decoder`]), and its loss gains kl_coef · mean(α KL(decoder ‖ policy))
//! ([`ScoreConfig::kl`]; the SCORE paper's Eq. 3 as a loss to minimise), where α is the decoder's confidence.

mod alpha;
mod config;
mod decoder;
mod frozen;
mod penalty;
mod unsquash;

pub use alpha::{alphas, own_samples};
pub use config::{AlphaKind, KlDirection, PriorKind, ScoreConfig};
pub use decoder::DecoderBatch;
pub(crate) use decoder::DecoderRows;
pub(crate) use frozen::FrozenSkill;
pub use penalty::decoder_kl;
pub use unsquash::unsquashed;
