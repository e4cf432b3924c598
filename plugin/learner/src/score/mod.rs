//! SCORE: what ties an online policy to the skill decoder.
//!
//! Three switches over PPO or SAC: the policy reads the skill z ([`ScoreConfig::condition`]), starts as a copy of the
//! decoder ([`ScoreConfig::init_from_decoder`]; not where SAC squashes actions), and its loss gains kl_coef times a
//! penalty ([`ScoreConfig::kl`]). The penalty is mean(α KL(decoder ‖ policy)) (the SCORE paper's Eq. 3 as a loss to
//! minimise), where α is the decoder's confidence, or one of the other forms of [`PenaltyForm`].

mod alpha;
mod config;
mod decoder;
mod frozen;
mod legacy;
mod penalty;
mod unsquash;

pub use alpha::{alphas, own_samples, row_weights};
pub use config::{AlphaKind, KlDirection, PenaltyForm, PriorKind, ScoreConfig};
pub use decoder::DecoderBatch;
pub(crate) use decoder::DecoderRows;
pub(crate) use frozen::{FrozenSkill, present_stats};
pub use legacy::{legacy_coinrun, legacy_d4rl, marginal_densities};
pub use penalty::{Penalty, decoder_kl, penalty};
pub use unsquash::unsquashed;
