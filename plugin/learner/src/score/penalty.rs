//! The penalty for leaving the decoder, and the weight of each row: the decoder's confidence, α in the paper.

use crate::{
    ActionSpace, Actions, LearnError, MixedSpace, legacy,
    nn::{Dist, HostDist, argmax, categorical_at, categorical_log_prob, gaussian_log_prob, sample_gaussian},
    rng::unit,
    score::{ConfidenceKind, KlDirection, PenaltyForm, ScoreConfig},
};
use burn::tensor::Tensor;
use playbot_kernels::kept_memory::share;
use rand::Rng;

/// Rows that a thread takes at a time.
const ROWS: usize = 1024;

/// Number of products that take as long as a number of a row.
const OF_A_NUMBER: usize = 64;

/// Returns a value for each of `n` rows of `dim` numbers.
fn by_row<T: Copy + Default + Send>(n: usize, dim: usize, of_row: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let mut all = vec![T::default(); n];
    share(&mut all, ROWS, n * dim * OF_A_NUMBER, |piece, values| {
        (piece * ROWS..).zip(values).for_each(|(row, value)| *value = of_row(row));
    });
    all
}

/// Returns a row of `dim` numbers.
fn row_of(all: &[f32], dim: usize, row: usize) -> &[f32] {
    &all[row * dim..][..dim]
}

/// Returns the divergence of each row in the configured direction, in nats, `[n]`. Exactly 0 where the two are equal.
/// `decoder` is constant.
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
    /// The term that, times kl_coef, is added to the minimised loss, `[1]`.
    pub term: Tensor<1>,
}

/// Returns the penalty by [`ScoreConfig::penalty`], from the constant `decoder`, the `policy`, and the `weight` of
/// each row `[n]` from [`penalty_weights`].
///
/// # Errors
/// [`LearnError::Action`] if decoder and policy act in different kinds of spaces.
pub fn penalty(config: &ScoreConfig, decoder: &Dist, policy: &Dist, weight: Tensor<1>) -> Result<Penalty, LearnError> {
    let kl = decoder_kl(decoder, policy, config.direction())?;
    let term = match config.penalty {
        PenaltyForm::Mean => (kl.clone() * weight).mean(),
        PenaltyForm::LegacyD4rl => legacy::d4rl_penalty(kl.clone(), weight),
        PenaltyForm::LegacyCoinrun => legacy::coinrun_penalty(kl.clone(), weight),
    };
    Ok(Penalty { kl, term })
}

/// Returns one action per row, drawn from the decoder.
pub fn own_samples<R: Rng + ?Sized>(decoder: &HostDist, rng: &mut R) -> Actions {
    let dim = decoder.dim();
    let rows = decoder.head.chunks_exact(dim);
    let stds = decoder.log_std.as_deref().unwrap_or_default();
    match decoder.space {
        ActionSpace::Discrete(_) => {
            let draws: Vec<f64> = rows.map(|_| unit(rng)).collect();
            let of_row = |row: usize| categorical_at(row_of(&decoder.head, dim, row), draws[row]);
            Actions::Discrete(by_row(draws.len(), dim, of_row))
        }
        ActionSpace::Continuous(_) => {
            let values = rows.zip(stds.chunks_exact(dim)).flat_map(|(m, s)| sample_gaussian(m, s, rng)).collect();
            Actions::Continuous { dim, values }
        }
        ActionSpace::Mixed(MixedSpace { choices, numbers }) => {
            let (mut options, mut values) = (Vec::new(), Vec::new());
            for (row, head) in rows.enumerate() {
                options.extend(choices.ranges().map(|at| categorical_at(&head[at], unit(rng))));
                values.extend(sample_gaussian(&head[choices.options()..], row_of(stds, numbers, row), rng));
            }
            Actions::Mixed { choices: choices.sizes().len(), options, dim: numbers, values }
        }
    }
}

/// Returns the weight of each row of a rollout with these `actions`, by the form of the penalty and the kind of
/// confidence. `rng` draws the decoder's own samples where those are needed.
///
/// # Errors
/// [`LearnError::Action`] or [`LearnError::Shape`] if the actions do not fit the decoder.
pub fn penalty_weights<R: Rng + ?Sized>(
    config: &ScoreConfig,
    decoder: &HostDist,
    actions: &Actions,
    rng: &mut R,
) -> Result<Vec<f32>, LearnError> {
    match (config.penalty, config.confidence.resolved(decoder.log_std.is_some())) {
        (PenaltyForm::LegacyD4rl, _) => legacy::marginal_densities(decoder, actions),
        (PenaltyForm::LegacyCoinrun, _) => confidences(ConfidenceKind::PolicyAction, decoder, actions),
        (PenaltyForm::Mean, ConfidenceKind::OwnSample) => {
            confidences(ConfidenceKind::OwnSample, decoder, &own_samples(decoder, rng))
        }
        (PenaltyForm::Mean, kind) => confidences(kind, decoder, actions),
    }
}

/// Returns the confidence in each row for the given actions (of the decoder for [`ConfidenceKind::OwnSample`], else
/// of the rollout).
///
/// Discrete: the decoder's probability of the action, which [`ConfidenceKind::BoundedDensity`] divides by the largest
/// of the row. Continuous: exp(-½ · mean over dimensions of the squared z-score), in (0, 1]. For
/// [`ConfidenceKind::Density`] the density, the product over dimensions. For [`ConfidenceKind::BoundedDensity`] the
/// density relative to the mean's, exp(-½ · sum of the squared z-scores). Several choices and a vector: the product of
/// the confidences in each of them.
///
/// # Errors
/// [`LearnError::Action`] or [`LearnError::Shape`] if the actions do not fit the decoder.
pub fn confidences(kind: ConfidenceKind, decoder: &HostDist, actions: &Actions) -> Result<Vec<f32>, LearnError> {
    let (dim, kind, space) = (decoder.dim(), kind.resolved(decoder.log_std.is_some()), decoder.space);
    let n = decoder.head.len() / dim;
    if kind == ConfidenceKind::Off {
        return Ok(vec![1.0; n]);
    }
    LearnError::check("actions", n, actions.len())?;
    space.check(actions)?;
    let (choices, options, numbers) = (space.choices(), space.options(), space.numbers());
    let of_choice = |log_probs: &[f32], option: u32| {
        libm::expf(match kind {
            ConfidenceKind::BoundedDensity => log_probs[option as usize] - log_probs[argmax(log_probs) as usize],
            _ => categorical_log_prob(log_probs, option),
        })
    };
    let of_vector = |mean: &[f32], log_std: &[f32], action: &[f32]| match kind {
        ConfidenceKind::Density => libm::expf(gaussian_log_prob(mean, log_std, action)),
        ConfidenceKind::BoundedDensity => libm::exp(-0.5 * square_sum(mean, log_std, action)) as f32,
        _ => libm::exp(-0.5 * square_sum(mean, log_std, action) / numbers as f64) as f32,
    };
    Ok(by_row(n, dim, |row| {
        let head = row_of(&decoder.head, dim, row);
        let taken = choices.ranges().zip(actions.chosen(row));
        let of_choices = taken.map(|(at, &option)| of_choice(&head[at], option)).product();
        match &decoder.log_std {
            Some(stds) => of_choices * of_vector(&head[options..], row_of(stds, numbers, row), actions.vector(row)),
            None => of_choices,
        }
    }))
}

/// Returns Σ ((a - μ) / σ)².
fn square_sum(mean: &[f32], log_std: &[f32], action: &[f32]) -> f64 {
    let scores = mean.iter().zip(log_std).zip(action);
    scores.map(|((&m, &s), &a)| ((f64::from(a) - f64::from(m)) * libm::exp(-f64::from(s))).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Streams;

    fn close(got: &[f32], want: &[f64]) {
        assert_eq!(got.len(), want.len());
        let near = got.iter().zip(want).all(|(g, w)| (f64::from(*g) - w).abs() < 1e-6);
        assert!(near, "{got:?}, expected {want:?}");
    }

    #[test]
    fn discrete_by_hand() {
        let head = [0.5f32, 0.2, 0.3].map(f32::ln);
        let decoder =
            HostDist { space: ActionSpace::Discrete(3), head: [head, head].concat(), log_std: None, held: Vec::new() };
        let actions = Actions::Discrete(vec![2, 0]);
        let confidence = |kind| confidences(kind, &decoder, &actions).expect("they fit");
        close(&confidence(ConfidenceKind::PolicyAction), &[0.3, 0.5]);
        close(&confidence(ConfidenceKind::Density), &[0.3, 0.5]);
        close(&confidence(ConfidenceKind::BoundedDensity), &[0.6, 1.0]);
        close(&confidence(ConfidenceKind::Off), &[1.0, 1.0]);
    }

    #[test]
    fn continuous_by_hand() {
        // z-scores 1 and 2 in the first row, none in the second.
        let ln2 = std::f32::consts::LN_2;
        let log_std = Some(vec![0.0, ln2, 0.0, ln2]);
        let (space, head) = (ActionSpace::Continuous(2), vec![0.0, 1.0, 0.0, 1.0]);
        let decoder = HostDist { space, head, log_std, held: Vec::new() };
        let actions = Actions::Continuous { dim: 2, values: vec![1.0, -3.0, 0.0, 1.0] };
        let confidence = |kind| confidences(kind, &decoder, &actions).expect("they fit");
        close(&confidence(ConfidenceKind::PolicyAction), &[libm::exp(-1.25), 1.0]);
        close(&confidence(ConfidenceKind::BoundedDensity), &[libm::exp(-2.5), 1.0]);
        let top = 1.0 / (2.0 * std::f64::consts::TAU);
        close(&confidence(ConfidenceKind::Density), &[top * libm::exp(-2.5), top]);
    }

    #[test]
    fn by_default_a_gaussian_tells_actions_apart() {
        let (space, log_std) = (ActionSpace::Continuous(1), Some(vec![0.0, 0.0]));
        let decoder = HostDist { space, head: vec![0.0, 0.0], log_std, held: Vec::new() };
        let actions = Actions::Continuous { dim: 1, values: vec![0.0, 2.0] };
        let mut rng = Streams::new(1).stream("own", 0);
        let weights = penalty_weights(&ScoreConfig::default(), &decoder, &actions, &mut rng).expect("they fit");
        close(&weights, &[1.0, libm::exp(-2.0)]);
        let own = ConfidenceKind::OwnSample;
        assert_eq!(ConfidenceKind::Auto.resolved(false), own);
        assert_eq!(own.resolved(true), own, "who asks for it gets it");
    }

    #[test]
    fn legacy_forms_have_their_own_weights() {
        let (space, log_std) = (ActionSpace::Continuous(1), Some(vec![0.0]));
        let decoder = HostDist { space, head: vec![0.0], log_std, held: Vec::new() };
        let actions = Actions::Continuous { dim: 1, values: vec![0.0] };
        let config = |penalty| ScoreConfig { penalty, confidence: ConfidenceKind::Off, ..ScoreConfig::default() };
        let mut rng = Streams::new(1).stream("own", 0);
        let mut weights = |penalty| penalty_weights(&config(penalty), &decoder, &actions, &mut rng).expect("they fit");
        close(&weights(PenaltyForm::Mean), &[1.0]);
        close(&weights(PenaltyForm::LegacyD4rl), &[1.0 / std::f64::consts::TAU.sqrt()]);
    }
}
