//! Distributions over actions (and over latents), as pure functions of tensors.

use crate::{
    ActionSpace, Actions, Choices, LearnError, MixedSpace,
    device::{read, send},
    nn::params::{host, matrix, vector},
};
use burn::tensor::{Device, Int, Tensor, TensorData, activation::log_softmax};
use playbot_kernels::{
    elementwise::exp_of,
    host_numbers::is_host,
    host_ops::{self, exp},
    kept_memory::{OF_A_MOVE, share},
};
use std::ops::Range;

/// Rows that a thread gathers at a time.
const ROWS: usize = 256;

/// ln(2π)/2.
const HALF_LN_TAU: f32 = 0.918_938_5;

/// A batch of distributions, one per row.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one per batch, and it is never stored")]
pub enum Dist {
    /// Choices with these normalised log-probabilities, `[n, choices]`.
    Categorical {
        /// Log-softmax of the logits.
        log_probs: Tensor<2>,
    },
    /// Independent normal distributions.
    Gaussian {
        /// `[n, dim]`.
        mean: Tensor<2>,
        /// Logarithm of the standard deviation, `[n, dim]`, or `[1, dim]` for all rows alike.
        log_std: Tensor<2>,
        /// 0 for rows whose numbers are held from an earlier tick, and 1 for the others, `[n]`. Nothing is drawn in
        /// such a row: its log-density, entropy and divergence are 0. `None` if all are drawn.
        free: Option<Tensor<1>>,
    },
    /// Independent parts: a categorical distribution for each of several choices, and a Gaussian for the vector, if
    /// there is one. Log-probabilities, entropies and divergences are the sums over the parts.
    Joint(Vec<Self>),
}

/// A batch of actions on a device, one per row.
#[derive(Clone, Debug)]
pub enum ActionBatch {
    /// Indices, `[n, 1]`.
    Discrete(Tensor<2, Int>),
    /// Vectors, `[n, dim]`.
    Continuous(Tensor<2>),
    /// The parts of each action, in the order of [`Dist::Joint`].
    Joint(Vec<Self>),
}

impl ActionBatch {
    /// Moves `actions` to `device`.
    pub fn new(actions: &Actions, device: &Device) -> Self {
        let n = actions.len();
        let indices = |of: Vec<i64>| Self::Discrete(send(TensorData::new(of, [n, 1]), device));
        match actions {
            Actions::Discrete(values) => indices(values.iter().map(|&a| i64::from(a)).collect()),
            Actions::Continuous { dim, values } => Self::Continuous(matrix(values.clone(), n, *dim, device)),
            Actions::Mixed { choices, options, dim, values } => {
                let choice =
                    |at: usize| indices(options.iter().skip(at).step_by(*choices).map(|&a| i64::from(a)).collect());
                let vector = (*dim > 0).then(|| Self::Continuous(matrix(values.clone(), n, *dim, device)));
                Self::Joint((0..*choices).map(choice).chain(vector).collect())
            }
        }
    }

    /// Returns some of the rows, which may repeat.
    pub(crate) fn select(&self, rows: &Tensor<1, Int>) -> Self {
        match self {
            Self::Discrete(actions) => Self::Discrete(actions.clone().select(0, rows.clone())),
            Self::Continuous(actions) => Self::Continuous(actions.clone().select(0, rows.clone())),
            Self::Joint(parts) => Self::Joint(parts.iter().map(|part| part.select(rows)).collect()),
        }
    }

    /// Reads the actions of all rows to the host.
    ///
    /// # Errors
    /// [`LearnError::Device`] if a tensor cannot be read.
    pub(crate) fn to_host(&self) -> Result<Actions, LearnError> {
        Ok(match self {
            Self::Discrete(index) => {
                let numbers = read::<u32, _, _>(index.clone())?.try_into_vec();
                Actions::Discrete(numbers.map_err(|e| LearnError::Device(e.to_string()))?)
            }
            Self::Continuous(action) => Actions::Continuous { dim: action.dims()[1], values: host(action.clone())? },
            Self::Joint(parts) => {
                let parts = parts.iter().map(Self::to_host).collect::<Result<Vec<_>, _>>()?;
                let mut taken: Vec<Vec<u32>> = Vec::new();
                let (mut dim, mut values) = (0, Vec::new());
                for part in parts {
                    match part {
                        Actions::Discrete(indices) => taken.push(indices),
                        Actions::Continuous { dim: width, values: numbers } => (dim, values) = (width, numbers),
                        Actions::Mixed { .. } => {
                            return Err(LearnError::Action("a part of an action has parts".to_owned()));
                        }
                    }
                }
                let rows = taken.first().map_or(0, Vec::len);
                let options = (0..rows).flat_map(|row| taken.iter().map(move |indices| indices[row])).collect();
                Actions::Mixed { choices: taken.len(), options, dim, values }
            }
        })
    }
}

impl Dist {
    /// Creates the categorical distributions of `logits` `[n, choices]`.
    pub fn categorical(logits: Tensor<2>) -> Self {
        let on_host = is_host(&logits.device()) && !logits.dims().contains(&0);
        Self::Categorical { log_probs: if on_host { host_ops::log_softmax(logits) } else { log_softmax(logits, 1) } }
    }

    /// Returns the log-probability (or log-density, summed over dimensions) of one action per row, `[n]`.
    ///
    /// # Errors
    /// [`LearnError::Action`] if the actions are of the other kind.
    pub fn log_prob(&self, actions: &ActionBatch) -> Result<Tensor<1>, LearnError> {
        match (self, actions) {
            (Self::Categorical { log_probs }, ActionBatch::Discrete(index)) => {
                Ok(log_probs.clone().gather(1, index.clone()).squeeze_dim(1))
            }
            (Self::Gaussian { mean, log_std, free }, ActionBatch::Continuous(action)) => {
                let score = (action.clone() - mean.clone()) * exp(log_std.clone().neg());
                let terms = score.square() * 0.5 + log_std.clone() + HALF_LN_TAU;
                Ok(of_free(terms.sum_dim(1).squeeze_dim(1).neg(), free.as_ref()))
            }
            (Self::Joint(parts), ActionBatch::Joint(actions)) if parts.len() == actions.len() => {
                sum_of(parts.iter().zip(actions).map(|(part, action)| part.log_prob(action)))
            }
            _ => Err(LearnError::Action("distribution and actions differ in kind".to_owned())),
        }
    }

    /// Returns the entropy in nats, `[n]` (or `[1]` if it is the same for all rows), summed over dimensions. That of
    /// a Gaussian is Σ (ln σ + ½ ln 2πe), which may be negative.
    pub fn entropy(&self) -> Tensor<1> {
        match self {
            Self::Categorical { log_probs } => {
                let terms = exp(log_probs.clone()) * log_probs.clone();
                terms.sum_dim(1).squeeze_dim(1).neg()
            }
            Self::Gaussian { log_std, free, .. } => {
                of_free((log_std.clone() + (0.5 + HALF_LN_TAU)).sum_dim(1).squeeze_dim(1), free.as_ref())
            }
            Self::Joint(parts) => {
                let parts = parts.iter().map(Self::entropy);
                parts.reduce(|sum, part| sum + part).expect("there is a part, or there would be no action")
            }
        }
    }

    /// Returns KL(self ‖ other) in nats per row, `[n]`, summed over dimensions. Exactly 0 for equal parameters.
    ///
    /// Categorical: Σ p (ln p - ln q). Gaussian, per dimension:
    /// ln σ_q - ln σ_p + (σ_p² / σ_q² + (μ_p - μ_q)² / σ_q² - 1) / 2.
    ///
    /// # Errors
    /// [`LearnError::Action`] if the two are of different kinds.
    pub fn kl(&self, other: &Self) -> Result<Tensor<1>, LearnError> {
        match (self, other) {
            (Self::Categorical { log_probs: p }, Self::Categorical { log_probs: q }) => {
                let terms = exp(p.clone()) * (p.clone() - q.clone());
                Ok(terms.sum_dim(1).squeeze_dim(1))
            }
            (Self::Gaussian { mean: mp, log_std: lp, free }, Self::Gaussian { mean: mq, log_std: lq, free: other }) => {
                let ratio = exp((lp.clone() - lq.clone()) * 2.0);
                let distance = ((mp.clone() - mq.clone()) * exp(lq.clone().neg())).square();
                let terms = (ratio + distance - 1.0) * 0.5 + (lq.clone() - lp.clone());
                Ok(of_free(terms.sum_dim(1).squeeze_dim(1), free.as_ref().or(other.as_ref())))
            }
            (Self::Joint(these), Self::Joint(others)) if these.len() == others.len() => {
                sum_of(these.iter().zip(others).map(|(this, other)| this.kl(other)))
            }
            _ => Err(LearnError::Action("the distributions differ in kind".to_owned())),
        }
    }

    /// Returns the distributions with these numbers `[n, options]` added to the logarithms of all choices, whose
    /// probabilities then add up to 1 again.
    #[must_use]
    pub(crate) fn with_offsets(self, offsets: &Tensor<2>) -> Self {
        let mut first = 0;
        let mut shifted = |part| match part {
            Self::Categorical { log_probs } => {
                let [_, options] = log_probs.dims();
                first += options;
                Self::categorical(log_probs + offsets.clone().narrow(1, first - options, options))
            }
            other => other,
        };
        match self {
            Self::Joint(parts) => Self::Joint(parts.into_iter().map(shifted).collect()),
            one => shifted(one),
        }
    }

    /// Returns the distributions with the rows whose numbers are held: 0 for these and 1 for the others, `[n]`, or `None`.
    #[must_use]
    pub fn with_free(self, rows: Option<&Tensor<1>>) -> Self {
        match self {
            Self::Gaussian { mean, log_std, .. } => Self::Gaussian { mean, log_std, free: rows.cloned() },
            Self::Joint(parts) => Self::Joint(parts.into_iter().map(|part| part.with_free(rows)).collect()),
            choices @ Self::Categorical { .. } => choices,
        }
    }

    /// Returns the same numbers without gradients.
    #[must_use]
    pub(crate) fn detach(self) -> Self {
        match self {
            Self::Categorical { log_probs } => Self::Categorical { log_probs: log_probs.detach() },
            Self::Gaussian { mean, log_std, free } => {
                Self::Gaussian { mean: mean.detach(), log_std: log_std.detach(), free }
            }
            Self::Joint(parts) => Self::Joint(parts.into_iter().map(Self::detach).collect()),
        }
    }

    /// Returns some of the rows, which may repeat.
    pub(crate) fn select(&self, rows: &Tensor<1, Int>) -> Self {
        let of = |values: &Tensor<2>| values.clone().select(0, rows.clone());
        match self {
            Self::Categorical { log_probs } => Self::Categorical { log_probs: of(log_probs) },
            Self::Gaussian { mean, log_std, free } => {
                let free = free.as_ref().map(|free| free.clone().select(0, rows.clone()));
                Self::Gaussian { mean: of(mean), log_std: of(log_std), free }
            }
            Self::Joint(parts) => Self::Joint(parts.iter().map(|part| part.select(rows)).collect()),
        }
    }

    /// Reads the distributions of all rows to the host.
    ///
    /// # Errors
    /// [`LearnError::Device`] if a tensor cannot be read.
    pub fn to_host(self) -> Result<HostDist, LearnError> {
        match self {
            Self::Categorical { log_probs } => {
                let [_, choices] = log_probs.dims();
                let space = ActionSpace::Discrete(choices);
                Ok(HostDist { space, head: host(log_probs.inner())?, log_std: None, held: Vec::new() })
            }
            Self::Gaussian { mean, log_std, free } => {
                let [n, dim] = mean.dims();
                let mut stds = host(log_std.inner())?;
                if stds.len() == dim {
                    stds = stds.repeat(n);
                }
                let free = free.map_or(Ok(Vec::new()), |free| host(free.inner()))?;
                let held = free.into_iter().map(|free| free == 0.0).collect();
                let space = ActionSpace::Continuous(dim);
                Ok(HostDist { space, head: host(mean.inner())?, log_std: Some(stds), held })
            }
            Self::Joint(parts) => joined(parts.into_iter().map(Self::to_host).collect::<Result<Vec<_>, _>>()?),
        }
    }
}

/// Returns the terms `[n]`, or `[1]` if they are the same for all rows, without those of rows that are not free.
fn of_free(terms: Tensor<1>, free: Option<&Tensor<1>>) -> Tensor<1> {
    match free {
        Some(free) => terms * free.clone(),
        None => terms,
    }
}

/// Returns the sum of numbers per row.
fn sum_of(parts: impl Iterator<Item = Result<Tensor<1>, LearnError>>) -> Result<Tensor<1>, LearnError> {
    let sum = parts.reduce(|sum, part| Ok(sum? + part?));
    sum.unwrap_or_else(|| Err(LearnError::Action("a distribution without parts".to_owned())))
}

/// Puts the columns of parts side by side.
fn joined(mut parts: Vec<HostDist>) -> Result<HostDist, LearnError> {
    let sizes: Vec<usize> = parts.iter().map(|part| part.space.options()).filter(|&size| size > 0).collect();
    let numbers = parts.iter().map(|part| part.space.numbers()).sum();
    let space = ActionSpace::Mixed(MixedSpace { choices: Choices::new(&sizes)?, numbers });
    let rows = parts.first().map_or(0, |part| part.head.len() / part.space.dim().max(1));
    let mut head = Vec::with_capacity(rows * space.dim());
    for row in 0..rows {
        for part in &parts {
            let dim = part.space.dim();
            head.extend_from_slice(&part.head[row * dim..(row + 1) * dim]);
        }
    }
    // The vector is the last part, if there is one.
    let (log_std, held) = parts.pop().map_or_else(Default::default, |part| (part.log_std, part.held));
    Ok(HostDist { space, head, log_std, held })
}

/// A batch of distributions in host memory.
#[derive(Clone, Debug, PartialEq)]
pub struct HostDist {
    /// The space of the actions.
    pub space: ActionSpace,
    /// Log-probabilities or means, `n * dim`. In a mixed space those of each choice, and then the means.
    pub head: Vec<f32>,
    /// Logarithms of the standard deviations, `n * numbers`; `None` without a vector.
    pub log_std: Option<Vec<f32>>,
    /// True for rows whose numbers are held from an earlier tick, `n`; empty if all are drawn.
    pub held: Vec<bool>,
}

impl HostDist {
    /// Returns the columns of the head: choices, or dimensions.
    pub fn dim(&self) -> usize {
        self.space.dim()
    }

    /// Returns the distributions of `rows` as constants on `device`.
    pub fn rows(&self, rows: &[usize], device: &Device) -> Dist {
        let dim = self.dim();
        let gather = |values: &[f32], dim: usize| {
            let mut out = vec![0.0; rows.len() * dim];
            let products = out.len() * OF_A_MOVE;
            share(&mut out, ROWS * dim, products, |piece, to| {
                for (to, &row) in to.chunks_exact_mut(dim).zip(&rows[piece * ROWS..]) {
                    to.copy_from_slice(&values[row * dim..(row + 1) * dim]);
                }
            });
            matrix(out, rows.len(), dim, device)
        };
        let gaussian = |mean| Dist::Gaussian {
            mean,
            log_std: gather(self.log_std.as_deref().unwrap_or_default(), self.space.numbers()),
            free: (!self.held.is_empty())
                .then(|| vector(rows.iter().map(|&row| if self.held[row] { 0.0 } else { 1.0 }).collect(), device)),
        };
        let head = gather(&self.head, dim);
        match self.space {
            ActionSpace::Discrete(_) => Dist::Categorical { log_probs: head },
            ActionSpace::Continuous(_) => gaussian(head),
            ActionSpace::Mixed(MixedSpace { choices, numbers }) => {
                let choice =
                    |at: Range<usize>| Dist::Categorical { log_probs: head.clone().narrow(1, at.start, at.len()) };
                let mut parts: Vec<Dist> = choices.ranges().map(choice).collect();
                if numbers > 0 {
                    parts.push(gaussian(head.clone().narrow(1, choices.options(), numbers)));
                }
                Dist::Joint(parts)
            }
        }
    }
}

// Distributions in host memory, row by row, with their derivatives: the formulas of `Dist` without a graph.

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
        Self::of_options(these, &actions[rows.clone()], other, rows, from_these)
    }

    /// Does [`Self::new`] with the options of these rows alone, of which a row may have several.
    fn of_options(
        these: &'a HostDist,
        actions: &'a [u32],
        other: Option<&'a HostDist>,
        rows: Range<usize>,
        from_these: bool,
    ) -> Self {
        let choices = these.dim();
        let log_probs = |dist: &'a HostDist| &dist.head[rows.start * choices..rows.end * choices];
        let other = other.map(log_probs).map(|log_probs| OtherChoices {
            log_probs,
            probs: if from_these { Vec::new() } else { exp_of(log_probs) },
        });
        let log_probs = log_probs(these);
        Self { choices, log_probs, probs: exp_of(log_probs), actions, other, from_these }
    }
}

impl DistRows for CategoricalRows<'_> {
    fn terms(&self, row: usize) -> RowTerms {
        self.terms_at(row * self.choices..(row + 1) * self.choices, self.actions[row])
    }

    fn gradient(&self, row: usize, by: RowTerms, head: &mut [f32], _: &mut [f32]) {
        self.gradient_at(row * self.choices..(row + 1) * self.choices, self.actions[row], by, head);
    }
}

impl CategoricalRows<'_> {
    /// Returns the terms of the choice whose log-probabilities lie at `at`.
    fn terms_at(&self, at: Range<usize>, action: u32) -> RowTerms {
        let (l, p) = (&self.log_probs[at.clone()], &self.probs[at.clone()]);
        let kl = self.other.as_ref().map_or(0.0, |other| {
            let weights = if self.from_these { p } else { &other.probs[at.clone()] };
            let sign = if self.from_these { 1.0 } else { -1.0 };
            weights.iter().zip(l).zip(&other.log_probs[at]).map(|((w, l), o)| sign * w * (l - o)).sum()
        });
        let entropy = -p.iter().zip(l).map(|(p, l)| p * l).sum::<f32>();
        RowTerms { log_prob: l[action as usize], entropy, kl }
    }

    /// Writes the derivatives by the log-probabilities at `at` into `head`.
    fn gradient_at(&self, at: Range<usize>, action: u32, by: RowTerms, head: &mut [f32]) {
        let (l, p) = (&self.log_probs[at.clone()], &self.probs[at.clone()]);
        for ((to, p), l) in head.iter_mut().zip(p).zip(l) {
            *to = -by.entropy * p * (l + 1.0);
        }
        head[action as usize] += by.log_prob;
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
    /// Columns of the head, and the first one that is a mean.
    columns: (usize, usize),
    /// The head, `[n, columns]`, and ln σ, `[n, dim]`.
    these: (&'a [f32], &'a [f32]),
    /// `[n, dim]`.
    actions: &'a [f32],
    /// Head and ln σ of the compared distribution, as `these`.
    other: Option<(&'a [f32], &'a [f32])>,
    /// True for rows whose numbers are held, of which nothing counts; empty if none are.
    held: &'a [bool],
    /// True if the divergence is KL(these ‖ other), and not KL(other ‖ these).
    from_these: bool,
}

/// ln(2π)/2.
const HALF_LN_TAU_F32: f32 = 0.918_938_5;

impl<'a> GaussianRows<'a> {
    /// Creates the rows as [`CategoricalRows::new`] does.
    pub(crate) fn new(
        these: &'a HostDist,
        actions: &'a [f32],
        other: Option<&'a HostDist>,
        rows: Range<usize>,
        from_these: bool,
    ) -> Self {
        let dim = these.space.numbers();
        let columns = (these.dim(), these.space.options());
        let at = |width: usize| rows.start * width..rows.end * width;
        let numbers = |dist: &'a HostDist| {
            (&dist.head[at(columns.0)], dist.log_std.as_deref().map_or(&[][..], |stds| &stds[at(dim)]))
        };
        let actions = &actions[at(dim)];
        let held = if these.held.is_empty() { &[][..] } else { &these.held[rows.clone()] };
        Self { dim, columns, these: numbers(these), actions, other: other.map(numbers), held, from_these }
    }

    fn is_held(&self, row: usize) -> bool {
        self.held.get(row).copied().unwrap_or(false)
    }

    /// Returns the numbers of each dimension of a row: mean, ln σ and action, and the other's mean and ln σ.
    fn dims(&self, row: usize) -> impl Iterator<Item = ([f32; 3], Option<[f32; 2]>)> {
        let mean = row * self.columns.0 + self.columns.1;
        (row * self.dim..(row + 1) * self.dim).zip(mean..).map(|(at, mean)| {
            let other = self.other.map(|(means, stds)| [means[mean], stds[at]]);
            ([self.these.0[mean], self.these.1[at], self.actions[at]], other)
        })
    }
}

impl DistRows for GaussianRows<'_> {
    fn terms(&self, row: usize) -> RowTerms {
        let mut terms = RowTerms::default();
        if self.is_held(row) {
            return terms;
        }
        for ([mean, log_std, action], other) in self.dims(row) {
            let score = (action - mean) * libm::expf(-log_std);
            terms.log_prob -= score * score * 0.5 + log_std + HALF_LN_TAU_F32;
            terms.entropy += log_std + 0.5 + HALF_LN_TAU_F32;
            if let Some([m, s]) = other {
                let (p, q) = if self.from_these { (log_std, s) } else { (s, log_std) };
                let distance = (mean - m) * libm::expf(-q);
                terms.kl += (libm::expf((p - q) * 2.0) + distance * distance - 1.0) * 0.5 + (q - p);
            }
        }
        terms
    }

    fn gradient(&self, row: usize, by: RowTerms, head: &mut [f32], log_std_grads: &mut [f32]) {
        if self.is_held(row) {
            return head[..self.dim].fill(0.0);
        }
        for ((([mean, log_std, action], other), to), of_std) in self.dims(row).zip(head).zip(log_std_grads) {
            let inverse = libm::expf(-log_std);
            let score = (action - mean) * inverse;
            *to = by.log_prob * score * inverse;
            *of_std += by.log_prob * (score * score - 1.0) + by.entropy;
            match other {
                Some([m, s]) if self.from_these => {
                    let inverse = libm::expf(-s);
                    *to += by.kl * (mean - m) * inverse * inverse;
                    *of_std += by.kl * (libm::expf((log_std - s) * 2.0) - 1.0);
                }
                Some([m, s]) => {
                    let distance = (mean - m) * inverse;
                    *to += by.kl * distance * inverse;
                    *of_std += by.kl * (1.0 - libm::expf((s - log_std) * 2.0) - distance * distance);
                }
                None => {}
            }
        }
    }
}

/// Several choices and a vector, each drawn by itself.
#[derive(Debug)]
pub(crate) struct JointRows<'a> {
    choices: Choices,
    /// Columns of the head.
    dim: usize,
    /// The head, of which only the columns of the choices are read.
    all: CategoricalRows<'a>,
    vector: Option<GaussianRows<'a>>,
}

impl<'a> JointRows<'a> {
    /// Creates the rows as [`CategoricalRows::new`] does, from the options and the numbers of the actions.
    pub(crate) fn new(
        these: &'a HostDist,
        (options, values): (&'a [u32], &'a [f32]),
        other: Option<&'a HostDist>,
        rows: Range<usize>,
        from_these: bool,
    ) -> Self {
        let (choices, dim) = (these.space.choices(), these.dim());
        let count = choices.sizes().len();
        let vector =
            (these.space.numbers() > 0).then(|| GaussianRows::new(these, values, other, rows.clone(), from_these));
        let options = &options[rows.start * count..rows.end * count];
        let all = CategoricalRows::of_options(these, options, other, rows, from_these);
        Self { choices, dim, all, vector }
    }

    /// Returns the columns of each choice of a row within the row, and the option taken.
    fn taken(&self, row: usize) -> impl Iterator<Item = (Range<usize>, u32)> {
        let count = self.choices.sizes().len();
        self.choices.ranges().zip(self.all.actions[row * count..].iter().copied())
    }
}

impl DistRows for JointRows<'_> {
    fn terms(&self, row: usize) -> RowTerms {
        let first = row * self.dim;
        let mut sum = self.vector.as_ref().map_or_else(RowTerms::default, |vector| vector.terms(row));
        for (at, option) in self.taken(row) {
            let terms = self.all.terms_at(first + at.start..first + at.end, option);
            sum.log_prob += terms.log_prob;
            sum.entropy += terms.entropy;
            sum.kl += terms.kl;
        }
        sum
    }

    fn gradient(&self, row: usize, by: RowTerms, head: &mut [f32], log_std: &mut [f32]) {
        let first = row * self.dim;
        for (at, option) in self.taken(row) {
            let to = &mut head[at.clone()];
            self.all.gradient_at(first + at.start..first + at.end, option, by, to);
        }
        if let Some(vector) = &self.vector {
            vector.gradient(row, by, &mut head[self.choices.options()..], log_std);
        }
    }
}
