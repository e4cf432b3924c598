//! The penalty for leaving the decoder.

use super::{KlDirection, PenaltyForm, ScoreConfig, legacy_coinrun, legacy_d4rl};
use crate::LearnError;
use crate::nn::Dist;
use burn::tensor::Tensor;

/// The divergence of each row in the chosen direction, in nats, `[n]`. Exactly 0 where the two are equal. `decoder` is
/// constant.
///
/// # Errors
/// [`LearnError::Action`] if the two act in different kinds of spaces.
pub fn decoder_kl(decoder: &Dist, policy: &Dist, direction: KlDirection) -> Result<Tensor<1>, LearnError> {
    match direction {
        KlDirection::DecoderPolicy => decoder.kl(policy),
        KlDirection::PolicyDecoder => policy.kl(decoder),
    }
}

/// The penalty of a minibatch.
#[derive(Clone, Debug)]
pub struct Penalty {
    /// The divergence of each row, not weighted, in nats, `[n]`.
    pub kl: Tensor<1>,
    /// What times kl_coef is added to a loss that is minimised, `[1]`.
    pub term: Tensor<1>,
}

/// The penalty by [`ScoreConfig::penalty`], from the constant `decoder`, the `policy`, and the `weight` of each row `[n]`
/// that [`penalty_weights`](super::penalty_weights) gives.
///
/// # Errors
/// [`LearnError::Action`] if decoder and policy act in different kinds of spaces.
pub fn penalty(config: &ScoreConfig, decoder: &Dist, policy: &Dist, weight: Tensor<1>) -> Result<Penalty, LearnError> {
    let kl = decoder_kl(decoder, policy, config.direction())?;
    let term = match config.penalty {
        PenaltyForm::Mean => (kl.clone() * weight).mean(),
        PenaltyForm::LegacyD4rl => legacy_d4rl(kl.clone(), weight),
        PenaltyForm::LegacyCoinrun => legacy_coinrun(kl.clone(), weight),
    };
    Ok(Penalty { kl, term })
}
