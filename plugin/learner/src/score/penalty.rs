//! The divergence between decoder and policy.

use super::KlDirection;
use crate::LearnError;
use crate::nn::Dist;
use burn::tensor::Tensor;

/// The divergence of each row in the chosen direction, in nats, `[n]`. Exactly 0 where the two are equal.
///
/// The penalty is kl_coef · mean(α · this), to be added to a loss that is minimised; a plain mean over rows, not
/// divided by the sum of α. `decoder` is constant.
///
/// # Errors
/// [`LearnError::Action`] if the two act in different kinds of spaces.
pub fn decoder_kl(decoder: &Dist, policy: &Dist, direction: KlDirection) -> Result<Tensor<1>, LearnError> {
    match direction {
        KlDirection::DecoderPolicy => decoder.kl(policy),
        KlDirection::PolicyDecoder => policy.kl(decoder),
    }
}
