//! Distributions in host memory, row by row, with their derivatives: the formulas of [`Dist`](super::Dist) without a graph.

use super::HostDist;
use super::cpu::fast_math::exp_of;
use std::ops::Range;

/// The terms of a row that a loss reads, or the loss's derivatives by these.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RowTerms {
    /// Log-probability (or log-density) of the action.
    pub(crate) log_prob: f32,
    /// Entropy in nats.
    pub(crate) entropy: f32,
    /// Divergence from another distribution in nats; 0 without one.
    pub(crate) kl: f32,
}

/// Some rows of distributions, with an action each.
pub(crate) trait DistRows {
    /// Returns the terms of one row.
    fn terms(&self, row: usize) -> RowTerms;

    /// Writes the loss's derivatives by the row's log-probabilities or means into `head`, and adds those by its ln σ to
    /// `log_std`, from the derivatives by its terms.
    fn gradient(&self, row: usize, by: RowTerms, head: &mut [f32], log_std: &mut [f32]);
}

/// Categorical distributions.
#[derive(Debug)]
pub(crate) struct CategoricalRows<'a> {
    choices: usize,
    log_probs: &'a [f32],
    probs: Vec<f32>,
    actions: &'a [u32],
    other: Option<OtherChoices<'a>>,
    /// True if the divergence is KL(these ‖ other), and not KL(other ‖ these).
    from_these: bool,
}

#[derive(Debug)]
struct OtherChoices<'a> {
    log_probs: &'a [f32],
    /// The probabilities by which the divergence is weighted.
    probs: Vec<f32>,
}

impl<'a> CategoricalRows<'a> {
    /// Creates `rows` of a distribution with an action in each row, and of the compared distribution, if any:
    /// `from_these` for KL(these ‖ other), and not KL(other ‖ these).
    pub(crate) fn new(
        these: &'a HostDist,
        actions: &'a [u32],
        other: Option<&'a HostDist>,
        rows: Range<usize>,
        from_these: bool,
    ) -> Self {
        let choices = these.dim;
        let log_probs = |dist: &'a HostDist| &dist.head[rows.start * choices..rows.end * choices];
        let other = other.map(log_probs).map(|log_probs| OtherChoices {
            log_probs,
            probs: if from_these { Vec::new() } else { exp_of(log_probs) },
        });
        let log_probs = log_probs(these);
        Self { choices, log_probs, probs: exp_of(log_probs), actions: &actions[rows], other, from_these }
    }
}

impl DistRows for CategoricalRows<'_> {
    fn terms(&self, row: usize) -> RowTerms {
        let at = row * self.choices..(row + 1) * self.choices;
        let (l, p) = (&self.log_probs[at.clone()], &self.probs[at.clone()]);
        let kl = self.other.as_ref().map_or(0.0, |other| {
            let weights = if self.from_these { p } else { &other.probs[at.clone()] };
            let sign = if self.from_these { 1.0 } else { -1.0 };
            weights.iter().zip(l).zip(&other.log_probs[at]).map(|((w, l), o)| sign * w * (l - o)).sum()
        });
        let entropy = -p.iter().zip(l).map(|(p, l)| p * l).sum::<f32>();
        RowTerms { log_prob: l[self.actions[row] as usize], entropy, kl }
    }

    fn gradient(&self, row: usize, by: RowTerms, head: &mut [f32], _: &mut [f32]) {
        let at = row * self.choices..(row + 1) * self.choices;
        let (l, p) = (&self.log_probs[at.clone()], &self.probs[at.clone()]);
        for ((to, p), l) in head.iter_mut().zip(p).zip(l) {
            *to = -by.entropy * p * (l + 1.0);
        }
        head[self.actions[row] as usize] += by.log_prob;
        match &self.other {
            Some(other) if self.from_these => {
                for (((to, p), l), o) in head.iter_mut().zip(p).zip(l).zip(&other.log_probs[at]) {
                    *to += by.kl * p * (l - o + 1.0);
                }
            }
            Some(other) => head.iter_mut().zip(&other.probs[at]).for_each(|(to, q)| *to -= by.kl * q),
            None => {}
        }
    }
}

/// Independent normal distributions.
#[derive(Debug)]
pub(crate) struct GaussianRows<'a> {
    dim: usize,
    /// Means and ln σ, `[n, dim]` each.
    these: (&'a [f32], &'a [f32]),
    /// `[n, dim]`.
    actions: &'a [f32],
    /// Means and ln σ of the compared distribution, as `these`.
    other: Option<(&'a [f32], &'a [f32])>,
    /// True if the divergence is KL(these ‖ other), and not KL(other ‖ these).
    from_these: bool,
}

/// ln(2π)/2.
const HALF_LN_TAU: f32 = 0.918_938_5;

impl<'a> GaussianRows<'a> {
    /// Creates the rows as [`CategoricalRows::new`] does.
    pub(crate) fn new(
        these: &'a HostDist,
        actions: &'a [f32],
        other: Option<&'a HostDist>,
        rows: Range<usize>,
        from_these: bool,
    ) -> Self {
        let dim = these.dim;
        let at = rows.start * dim..rows.end * dim;
        let numbers = |dist: &'a HostDist| {
            (&dist.head[at.clone()], dist.log_std.as_deref().map_or(&[][..], |stds| &stds[at.clone()]))
        };
        Self { dim, these: numbers(these), actions: &actions[at.clone()], other: other.map(numbers), from_these }
    }

    /// Returns the numbers of each dimension of a row: mean, ln σ and action, and the other's mean and ln σ.
    fn dims(&self, row: usize) -> impl Iterator<Item = ([f32; 3], Option<[f32; 2]>)> {
        (row * self.dim..(row + 1) * self.dim).map(|at| {
            let other = self.other.map(|(means, stds)| [means[at], stds[at]]);
            ([self.these.0[at], self.these.1[at], self.actions[at]], other)
        })
    }
}

impl DistRows for GaussianRows<'_> {
    fn terms(&self, row: usize) -> RowTerms {
        let mut terms = RowTerms::default();
        for ([mean, log_std, action], other) in self.dims(row) {
            let score = (action - mean) * (-log_std).exp();
            terms.log_prob -= score * score * 0.5 + log_std + HALF_LN_TAU;
            terms.entropy += log_std + 0.5 + HALF_LN_TAU;
            if let Some([m, s]) = other {
                let (p, q) = if self.from_these { (log_std, s) } else { (s, log_std) };
                let distance = (mean - m) * (-q).exp();
                terms.kl += (((p - q) * 2.0).exp() + distance * distance - 1.0) * 0.5 + (q - p);
            }
        }
        terms
    }

    fn gradient(&self, row: usize, by: RowTerms, head: &mut [f32], log_std_grads: &mut [f32]) {
        for ((([mean, log_std, action], other), to), of_std) in self.dims(row).zip(head).zip(log_std_grads) {
            let inverse = (-log_std).exp();
            let score = (action - mean) * inverse;
            *to = by.log_prob * score * inverse;
            *of_std += by.log_prob * (score * score - 1.0) + by.entropy;
            match other {
                Some([m, s]) if self.from_these => {
                    let inverse = (-s).exp();
                    *to += by.kl * (mean - m) * inverse * inverse;
                    *of_std += by.kl * (((log_std - s) * 2.0).exp() - 1.0);
                }
                Some([m, s]) => {
                    let distance = (mean - m) * inverse;
                    *to += by.kl * distance * inverse;
                    *of_std += by.kl * (1.0 - ((s - log_std) * 2.0).exp() - distance * distance);
                }
                None => {}
            }
        }
    }
}
