//! Networks as evidence: whether policy, prior and decoder depend on what they are given.

use crate::diagnose::play::mean;
use bevy_playbot::skill_prior::SkillPrior;
use playbot_learner::{
    ActionSpace, ActionValue, LearnError, ObsKind, Policy, PolicyOutput, Prior, SkillDraw, SkillModel, Streams,
    rng::normal,
};
use std::{
    collections::BTreeMap,
    f64::consts::{E, PI},
    ops::Range,
};

/// Most observations that networks are given, and skills for each.
const ROWS: usize = 256;
const SKILLS: usize = 8;

/// What a policy and its skills depend on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NetworkProbe {
    /// Observations that were given.
    pub rows: usize,
    /// Share of dead units in each hidden layer of the actor, see [`Policy::dead_units`].
    pub dead_units: Vec<f64>,
    /// Largest deviation of an output of the actor over the observations, with one skill.
    pub output_spread: f64,
    /// Mean information of the skill on the action in a state, nats; `None` without skills.
    pub skill_information: Option<f64>,
    /// Deviation of the prior's mean over the observations, averaged over z; `None` without a learned prior.
    pub prior_spread: Option<f64>,
}

/// Gives a policy observations and skills, and measures what its output depends on. `None` for
/// pictures.
///
/// # Errors
///
/// An output is not a number.
pub fn probe(
    policy: &Policy,
    prior: Option<&SkillPrior>,
    observations: &[&[f32]],
) -> Result<Option<NetworkProbe>, LearnError> {
    let ObsKind::Vector(width) = policy.observation() else { return Ok(None) };
    let rows = chosen(observations, width);
    if rows.is_empty() {
        return Ok(None);
    }
    let (count, flat) = (rows.len(), rows.concat());
    let latent = policy.latent();
    let mut found = NetworkProbe { rows: count, ..NetworkProbe::default() };
    let draws = match prior {
        Some(prior) => drawn(&prior.prior, &flat, count)?,
        None => Vec::new(),
    };
    let one: Vec<f32> = match draws.first() {
        Some(first) if latent > 0 => first[..latent].repeat(count),
        _ => vec![0.0; latent * count],
    };
    let dim = policy.action_space().dim();
    found.dead_units = policy.dead_units(&one, flat.as_slice(), count)?;
    found.output_spread = largest_spread(&policy.forward(&one, flat.as_slice(), count)?.head, dim);
    if latent > 0 && draws.len() > 1 {
        let outputs: Result<Vec<_>, _> = draws.iter().map(|z| policy.forward(z, flat.as_slice(), count)).collect();
        found.skill_information = Some(information(&outputs?, count));
    }
    if let Some(prior) = prior.filter(|prior| prior.prior.observation().is_some()) {
        let means = prior.prior.sample(flat.as_slice(), count, SkillDraw::Mean, &mut |_| 0.0)?;
        found.prior_spread = Some(mean_spread(&means, prior.prior.latent()));
    }
    Ok(Some(found))
}

/// How well a skill model knows its recordings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecoderProbe {
    /// Recorded steps that were given.
    pub rows: usize,
    /// Mean negative log-likelihood of the recorded actions under skills of the prior, nats.
    pub nll: f64,
    /// That of the frequencies of the actions, or of one normal distribution for all states.
    pub frequencies: f64,
    /// How much worse the decoder may be: a deviation σ that has not fallen yet costs half a nat in each dimension.
    pub margin: f64,
}

/// Gives a skill model recorded steps. `None` for pictures, or without steps.
///
/// # Errors
///
/// An output is not a number, or an action is not of the model's space.
pub fn probe_decoder(model: &SkillModel, steps: &[(&[f32], ActionValue)]) -> Result<Option<DecoderProbe>, LearnError> {
    let ObsKind::Vector(width) = model.observation() else { return Ok(None) };
    let every = steps.len().div_ceil(ROWS).max(1);
    let steps: Vec<_> = steps.iter().step_by(every).filter(|(row, _)| row.len() == width).collect();
    if steps.is_empty() {
        return Ok(None);
    }
    let (count, flat) = (steps.len(), steps.iter().flat_map(|(row, _)| row.iter().copied()).collect::<Vec<_>>());
    let (policy, space) = (model.policy(), model.action_space());
    let mut total = vec![0.0; count];
    let draws = drawn(&model.prior(), &flat, count)?;
    for z in &draws {
        let output = policy.forward(z, flat.as_slice(), count)?;
        for (row, (_, action)) in steps.iter().enumerate() {
            total[row] += libm::exp(f64::from(output.log_prob(row, action)?)) / draws.len() as f64;
        }
    }
    // The decoder learns the intended actions, and recordings have noise among discrete ones.
    let noise = if matches!(space, ActionSpace::Discrete(_)) { model.config().action_noise } else { 0.0 };
    let noisy = |likelihood: f64| (1.0 - noise) * likelihood + noise / space.options().max(1) as f64;
    let nll = mean(total.iter().map(|&likelihood| -libm::log(noisy(likelihood).max(1e-30)))).unwrap_or_default();
    let actions: Vec<_> = steps.iter().map(|(_, action)| action).collect();
    let margin = 0.05 * space.choices().sizes().len() as f64 + 0.5 * space.numbers() as f64;
    Ok(Some(DecoderProbe { rows: count, nll, frequencies: marginal_entropy(&actions), margin }))
}

/// Returns the entropy of the frequencies of each choice, and of a normal distribution with the mean and deviation of
/// each number.
fn marginal_entropy(actions: &[&ActionValue]) -> f64 {
    let count = actions.len() as f64;
    let Some(first) = actions.first() else { return 0.0 };
    let of_choice = |choice: usize| -> f64 {
        let mut counts = BTreeMap::<u32, f64>::new();
        for option in actions.iter().filter_map(|action| action.options().get(choice)) {
            *counts.entry(*option).or_default() += 1.0;
        }
        counts.values().map(|number| -number / count * libm::log(number / count)).sum()
    };
    let of_number = |at: usize| {
        let values = actions.iter().filter_map(|action| action.numbers().get(at).map(|value| f64::from(*value)));
        0.5 * libm::log(2.0 * PI * E * variance(values).max(1e-6))
    };
    let choices: f64 = (0..first.options().len()).map(of_choice).sum();
    choices + (0..first.numbers().len()).map(of_number).sum::<f64>()
}

/// Returns some of the observations of the right length, evenly.
fn chosen<'a>(observations: &[&'a [f32]], width: usize) -> Vec<&'a [f32]> {
    let fitting: Vec<_> = observations.iter().filter(|row| row.len() == width).copied().collect();
    fitting.iter().step_by(fitting.len().div_ceil(ROWS).max(1)).copied().collect()
}

/// Draws several skills for each observation, from a stream of their own.
fn drawn(prior: &Prior, flat: &[f32], count: usize) -> Result<Vec<Vec<f32>>, LearnError> {
    let mut stream = Streams::new(0).stream("diagnose", 0);
    (0..SKILLS).map(|_| prior.sample(flat, count, SkillDraw::Sample, &mut |_| normal(&mut stream))).collect()
}

fn variance(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let Some(average) = mean(values.clone()) else { return 0.0 };
    mean(values.map(|value| (value - average).powi(2))).unwrap_or_default()
}

fn spreads(values: &[f32], width: usize) -> impl Iterator<Item = f64> + '_ {
    let width = width.max(1);
    (0..width).map(move |at| variance(values.iter().skip(at).step_by(width).map(|value| f64::from(*value))).sqrt())
}

fn largest_spread(values: &[f32], width: usize) -> f64 {
    spreads(values, width).fold(0.0, f64::max)
}

fn mean_spread(values: &[f32], width: usize) -> f64 {
    mean(spreads(values, width)).unwrap_or_default()
}

/// Returns the mean over states of the information that the skill has on the action: the entropy of the mixture less the
/// mean entropy. For normal distributions it is that of their spread, ½ ln(1 + var(means) / σ²).
fn information(outputs: &[PolicyOutput], count: usize) -> f64 {
    let Some(first) = outputs.first() else { return 0.0 };
    let (dim, options, numbers) = (first.space.dim(), first.space.options(), first.space.numbers());
    let choices = first.space.choices();
    let entropy = |p: &[f64]| -> f64 { p.iter().filter(|p| **p > 0.0).map(|p| -p * libm::log(*p)).sum() };
    let of_choice = |at: Range<usize>| -> f64 {
        let each: Vec<Vec<f64>> = outputs
            .iter()
            .map(|output| output.head[at.clone()].iter().map(|log| libm::exp(f64::from(*log))).collect())
            .collect();
        let mixed: Vec<f64> =
            (0..at.len()).map(|option| mean(each.iter().map(|p| p[option])).unwrap_or_default()).collect();
        entropy(&mixed) - mean(each.iter().map(|p| entropy(p))).unwrap_or_default()
    };
    let of_number = |row: usize, number: usize| -> f64 {
        let spread = variance(outputs.iter().map(|output| f64::from(output.head[row * dim + options + number])));
        let sigma = first.log_std.get(row * numbers + number).copied().unwrap_or(0.0);
        0.5 * libm::log1p(spread / libm::exp(2.0 * f64::from(sigma)))
    };
    let of_row = |row: usize| -> f64 {
        let chosen: f64 = choices.ranges().map(|at| of_choice(row * dim + at.start..row * dim + at.end)).sum();
        chosen + (0..numbers).map(|number| of_number(row, number)).sum::<f64>()
    };
    mean((0..count).map(of_row)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn output(head: Vec<f32>) -> PolicyOutput {
        let values = vec![0.0; head.len() / 2];
        let (space, log_std, memory) = (ActionSpace::Discrete(2), Vec::new(), Vec::new());
        PolicyOutput { space, squashed: false, head, log_std, values, memory, held: Vec::new() }
    }

    #[test]
    fn skills_that_choose_the_action_have_all_information_and_equal_ones_none() {
        let sure = |first: f32| vec![first, -30.0 - first];
        let opposite = [output(sure(0.0)), output(sure(-30.0))];
        assert!((information(&opposite, 1) - std::f64::consts::LN_2).abs() < 1e-6);
        let equal = [output(vec![-0.5, -0.9]), output(vec![-0.5, -0.9])];
        assert!(information(&equal, 1).abs() < 1e-9);
    }

    #[test]
    fn the_spread_is_over_rows_and_by_value() {
        assert!((largest_spread(&[0.0, 5.0, 2.0, 5.0], 2) - 1.0).abs() < 1e-12);
        assert!((mean_spread(&[0.0, 5.0, 2.0, 5.0], 2) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn frequencies_have_the_entropy_of_a_coin() {
        let (heads, tails) = (ActionValue::Discrete(0), ActionValue::Discrete(1));
        assert!((marginal_entropy(&[&heads, &tails]) - std::f64::consts::LN_2).abs() < 1e-12);
        assert_eq!(marginal_entropy(&[&heads, &heads]), 0.0);
    }
}
