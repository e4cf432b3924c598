//! Checks of whether observations decide actions, by nearest neighbours in recordings and a probe network.

use crate::diagnose::{
    advice::Advice,
    evidence::Evidence,
    finding::{LearningFinding, Sign},
    observation::{ColumnStatistics, statistics},
    play::{PlayedEpisode, mean},
    recordings::replayed_episodes,
};
use bevy_playbot::action::ActionValue;
use playbot_learner::{
    Streams,
    rng::{ChaCha8Rng, normal, shuffle},
};
use playbot_report::{counted, percent, readable, whole};
use std::collections::BTreeMap;

/// Most steps among which neighbours are looked for, and most of which they are.
const STEPS: usize = 2000;
const ASKED: usize = 400;

/// Width of an observation from which on fewer steps are compared, and their numbers.
const WIDE: usize = 100;
const WIDE_STEPS: usize = 700;
const WIDE_ASKED: usize = 160;

/// Most inputs of the probe network.
const MOST_INPUTS: usize = 300;

/// Fewest pairs about which anything is said.
const FEWEST: usize = 150;

/// Largest distance between equal observations, in deviations.
const EQUAL: f64 = 1e-4;

/// Agreement beyond chance, 0 to 1, below which actions do not depend on observations.
const NO_AGREEMENT: f64 = 0.05;

/// Share of equal observations with other actions that no demonstrator has who acts by what is observed.
const MOST_DISAGREEMENT: f64 = 0.5;

/// How far the action of the nearest observation in another episode agrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Pairs of steps that were compared.
    pub pairs: usize,
    /// Agreement beyond chance: 1 if neighbours always do the same, 0 if they agree as steps drawn at random.
    pub beyond_chance: f64,
    /// Agreement of steps drawn at random.
    pub chance: f64,
    /// Pairs whose observations are equal.
    pub equal: usize,
    /// Share of these whose actions differ.
    pub differing: f64,
    /// Agreement of an action with the one before it beyond chance: demonstrators keep on doing what they do.
    pub persistence: f64,
}

/// Share of actions that the full state predicts beyond the observation, from which on it decides.
const MORE_BY_STATE: f64 = 0.25;

/// One recorded step with the number of its episode.
type Step<'a> = (usize, &'a [f32], &'a ActionValue);

/// Compares each of some steps with the nearest one of another episode. `None` for too few steps.
pub fn agreement(episodes: &[(Vec<&[f32]>, Vec<ActionValue>)]) -> Option<Agreement> {
    let all: Vec<Step<'_>> = episodes
        .iter()
        .enumerate()
        .flat_map(|(number, (rows, actions))| rows.iter().zip(actions).map(move |(row, action)| (number, *row, action)))
        .collect();
    let is_wide = all.first().is_some_and(|(_, row, _)| row.len() > WIDE);
    let (most, asked) = if is_wide { (WIDE_STEPS, WIDE_ASKED) } else { (STEPS, ASKED) };
    let steps: Vec<Step<'_>> = all.iter().step_by(all.len().div_ceil(most).max(1)).copied().collect();
    let columns = statistics(steps.iter().map(|(_, row, _)| *row));
    let scales: Vec<f64> = columns.iter().map(|column| column.deviation.max(1e-9)).collect();
    let distance = |one: &[f32], other: &[f32], most: f64| {
        let mut sum = 0.0;
        for ((one, other), scale) in one.iter().zip(other).zip(&scales) {
            sum += (f64::from(*one - *other) / scale).powi(2);
            if sum > most {
                return f64::INFINITY;
            }
        }
        sum
    };
    let (mut agreed, mut pairs, mut equal, mut differing) = (0.0, 0_usize, 0_usize, 0_usize);
    for (number, row, action) in steps.iter().step_by((steps.len() / asked).max(1)) {
        let mut nearest: Option<(f64, &ActionValue)> = None;
        for (other, other_row, other_action) in &steps {
            if other == number || other_row.len() != row.len() {
                continue;
            }
            let far = distance(row, other_row, nearest.map_or(f64::INFINITY, |(far, _)| far));
            if nearest.is_none_or(|(most, _)| far < most) {
                nearest = Some((far, other_action));
            }
        }
        let Some((far, other_action)) = nearest else { continue };
        pairs += 1;
        agreed += likeness(action, other_action);
        if far.sqrt() <= EQUAL {
            equal += 1;
            differing += usize::from(action != &other_action);
        }
    }
    let chance = chance(&steps.iter().map(|(_, _, action)| *action).collect::<Vec<_>>());
    let agreed = agreed / pairs.max(1) as f64;
    let is_continuous = steps.first().is_some_and(|(_, _, action)| action.options().is_empty());
    let beyond = |agreed: f64| match is_continuous {
        true => 1.0 - agreed / chance.max(1e-12),
        false => (agreed - chance) / (1.0 - chance).max(1e-12),
    };
    let beyond_chance = beyond(agreed);
    let following = episodes.iter().flat_map(|(_, actions)| actions.windows(2));
    let persistence = beyond(mean(following.map(|pair| likeness(&pair[0], &pair[1]))).unwrap_or(chance));
    let differing = differing as f64 / equal.max(1) as f64;
    (pairs >= FEWEST).then_some(Agreement { pairs, beyond_chance, chance, equal, differing, persistence })
}

/// Returns 1 for equal discrete actions and 0 for others, or the squared distance of continuous ones.
fn likeness(one: &ActionValue, other: &ActionValue) -> f64 {
    if one.options().is_empty() {
        let distances = one.numbers().iter().zip(other.numbers());
        return distances.map(|(one, other)| f64::from(one - other).powi(2)).sum();
    }
    f64::from(u8::from(one.options() == other.options()))
}

/// Returns the mean likeness of two steps drawn at random.
fn chance(actions: &[&ActionValue]) -> f64 {
    let count = actions.len().max(1) as f64;
    let Some(first) = actions.first() else { return 0.0 };
    if !first.options().is_empty() {
        let mut counts = BTreeMap::<&[u32], f64>::new();
        actions.iter().for_each(|action| *counts.entry(action.options()).or_default() += 1.0);
        return counts.values().map(|number| (number / count).powi(2)).sum();
    }
    let columns = (0..first.numbers().len()).map(|at| {
        let values =
            || actions.iter().filter_map(move |action| action.numbers().get(at).map(|value| f64::from(*value)));
        let average = mean(values()).unwrap_or_default();
        2.0 * mean(values().map(|value| (value - average).powi(2))).unwrap_or_default()
    });
    columns.sum()
}

/// Returns the share of recorded discrete actions that a probe network predicts from observations, and from observations
/// with the full state. `None` without replays, without a state, or for too few steps.
fn probed(evidence: &Evidence) -> Option<(f64, f64)> {
    let set = evidence.recordings.as_ref()?;
    let episodes: Vec<&PlayedEpisode> = replayed_episodes(set).collect();
    let all = || episodes.iter().flat_map(|episode| &episode.actions);
    // Combinations of several choices are numbered as they are found.
    let combinations: BTreeMap<&[u32], usize> = all()
        .filter(|action| action.options().len() > 1)
        .map(|action| action.options())
        .zip(std::iter::repeat(0))
        .collect();
    let combinations: BTreeMap<&[u32], usize> = combinations.into_keys().zip(0..).collect();
    let class = |action: &ActionValue| match action.options() {
        [] => None,
        [number] => Some(*number as usize),
        several => combinations.get(several).copied(),
    };
    let actions = all().filter_map(class).max()? + 1;
    let steps = |is_asked: bool, with_state: bool| -> ProbeSteps {
        let chosen = episodes.iter().enumerate().filter(|(number, _)| (number % 4 == 3) == is_asked);
        let of_episode = |(_, episode): (usize, &&PlayedEpisode)| -> ProbeSteps {
            // The state before an action is the one after the tick before it.
            let rows = episode.rows().zip(&episode.actions).skip(1).zip(&episode.states);
            let labelled = rows.filter_map(|((row, action), state)| {
                let more = if with_state { state.as_slice() } else { &[] };
                Some(([row, more].concat(), class(action)?))
            });
            labelled.collect()
        };
        chosen.flat_map(of_episode).collect()
    };
    let has_state = episodes.iter().all(|episode| episode.states.first().is_some_and(|state| !state.is_empty()));
    let is_narrow = |episode: &PlayedEpisode| episode.width + episode.states.first().map_or(0, Vec::len) <= MOST_INPUTS;
    if !has_state || !episodes.iter().all(|episode| is_narrow(episode)) {
        return None;
    }
    let seen = accuracy(&steps(false, false), &steps(true, false), actions)?;
    let known = accuracy(&steps(false, true), &steps(true, true), actions)?;
    Some((seen, known))
}

/// Checks whether the recorded actions depend on what was observed.
pub fn check(evidence: &Evidence) -> Vec<LearningFinding> {
    let Some(set) = &evidence.recordings else { return Vec::new() };
    let seen = set.seen();
    let Some(found) = agreement(&seen) else { return Vec::new() };
    let noise = set.episodes.iter().map(|episode| episode.noise).fold(0.0, f64::max);
    let is_discrete = seen.iter().any(|(_, actions)| matches!(actions.first(), Some(ActionValue::Discrete(_))));
    let is_one = is_discrete && found.chance > 0.95 || !is_discrete && found.chance < 1e-6;
    // Neighbours among hundreds of values say little, but random actions do not last either.
    if !is_one && found.beyond_chance < NO_AGREEMENT && found.persistence < NO_AGREEMENT {
        let (cause, advice) = match is_discrete && noise > 0.5 {
            true => (format!("{} of the recorded actions are random", percent(noise)), [Advice::LessNoise].as_slice()),
            false => (
                "the demonstrator acts at random, or by something that agents do not observe".to_owned(),
                [Advice::LessNoise, Advice::ObserveMore].as_slice(),
            ),
        };
        return vec![LearningFinding::new(
            Sign::Contradictory,
            format!(
                "in {} of steps with nearly the same observation, actions agree {} of the way from chance to always",
                counted(found.pairs as u64, "pair"),
                percent(found.beyond_chance.max(0.0))
            ),
            cause,
            advice,
        )];
    }
    if is_discrete && found.equal >= FEWEST / 3 && found.differing > MOST_DISAGREEMENT.max(3.0 * noise) {
        return vec![LearningFinding::new(
            Sign::PartialObservation,
            format!(
                "{} of {} pairs of equal observations have different actions (noise {})",
                percent(found.differing),
                whole(found.equal as f64),
                readable(noise)
            ),
            "the demonstrator sees something that the observation does not hold",
            &[Advice::ObserveMore, Advice::RecordAgain],
        )];
    }
    match probed(evidence) {
        Some((seen, known)) if known - seen > MORE_BY_STATE => vec![LearningFinding::new(
            Sign::PartialObservation,
            format!(
                "a probe network predicts {} of the recorded actions from the observation, and {} with the full state",
                percent(seen),
                percent(known)
            ),
            "what decides is in the state of the game, and not in the observation",
            &[Advice::ObserveMore],
        )],
        _ => Vec::new(),
    }
}

// The probe: a small network that is asked to predict recorded actions, to see what decides them.

/// Hidden units, passes over the steps, and the step size of plain stochastic gradient descent.
const HIDDEN: usize = 24;
const PASSES: usize = 25;
const RATE: f32 = 0.05;

/// Most steps that are learned from.
const PROBE_STEPS: usize = 1000;

/// Steps to learn from: inputs of equal length, and the number of the action.
pub type ProbeSteps = Vec<(Vec<f32>, usize)>;

/// One hidden layer of tanh units and a softmax over actions.
struct ProbeNetwork {
    inputs: usize,
    actions: usize,
    hidden: Vec<f32>,
    output: Vec<f32>,
}

impl ProbeNetwork {
    fn new(inputs: usize, actions: usize, stream: &mut ChaCha8Rng) -> Self {
        let scale = 1.0 / ((inputs + 1) as f32).sqrt();
        let hidden = (0..HIDDEN * (inputs + 1)).map(|_| normal(stream) * scale).collect();
        Self { inputs, actions, hidden, output: vec![0.0; actions * (HIDDEN + 1)] }
    }

    /// Returns the hidden units and the probabilities of the actions.
    fn forward(&self, input: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let dot = |weights: &[f32], values: &[f32]| -> f32 {
            let bias = weights[values.len()];
            weights.iter().zip(values).map(|(weight, value)| weight * value).sum::<f32>() + bias
        };
        let hidden: Vec<f32> =
            self.hidden.chunks(self.inputs + 1).map(|weights| libm::tanhf(dot(weights, input))).collect();
        let logits: Vec<f32> = self.output.chunks(HIDDEN + 1).map(|weights| dot(weights, &hidden)).collect();
        let largest = logits.iter().fold(f32::NEG_INFINITY, |most, logit| most.max(*logit));
        let powers: Vec<f32> = logits.iter().map(|logit| libm::expf(logit - largest)).collect();
        let sum: f32 = powers.iter().sum();
        (hidden, powers.into_iter().map(|power| power / sum).collect())
    }

    /// Takes one step of gradient descent on the cross-entropy.
    fn learn(&mut self, input: &[f32], action: usize) {
        let (hidden, probabilities) = self.forward(input);
        let mut back = vec![0.0; HIDDEN];
        for (number, probability) in probabilities.iter().enumerate().take(self.actions) {
            let error = probability - f32::from(u8::from(number == action));
            let weights = &mut self.output[number * (HIDDEN + 1)..(number + 1) * (HIDDEN + 1)];
            for (unit, value) in hidden.iter().enumerate() {
                back[unit] += error * weights[unit];
                weights[unit] -= RATE * error * value;
            }
            weights[HIDDEN] -= RATE * error;
        }
        for (unit, (value, back)) in hidden.iter().zip(back).enumerate() {
            let slope = RATE * back * (1.0 - value * value);
            let weights = &mut self.hidden[unit * (self.inputs + 1)..(unit + 1) * (self.inputs + 1)];
            for (weight, number) in weights.iter_mut().zip(input) {
                *weight -= slope * number;
            }
            weights[self.inputs] -= slope;
        }
    }
}

/// Returns the share of the `asked` actions that a network predicts once it has learned from the `known` ones. Both are of
/// different episodes. `None` for too few steps.
pub fn accuracy(known: &ProbeSteps, asked: &ProbeSteps, actions: usize) -> Option<f64> {
    let inputs = known.first()?.0.len();
    let is_whole = |steps: &ProbeSteps| steps.iter().all(|(input, action)| input.len() == inputs && *action < actions);
    if asked.len() < 50 || known.len() < 100 || !is_whole(known) || !is_whole(asked) {
        return None;
    }
    let columns = statistics(known.iter().map(|(input, _)| input.as_slice()));
    let scaled = |input: &[f32]| -> Vec<f32> {
        let scale = |(value, column): (&f32, &ColumnStatistics)| {
            let deviation = if column.deviation > 1e-6 { column.deviation } else { 1.0 };
            ((f64::from(*value) - column.mean) / deviation).clamp(-5.0, 5.0) as f32
        };
        input.iter().zip(&columns).map(scale).collect()
    };
    let mut stream = Streams::new(0).stream("diagnose.probe", 0);
    let mut network = ProbeNetwork::new(inputs, actions, &mut stream);
    let every = known.len().div_ceil(PROBE_STEPS).max(1);
    let steps: Vec<_> = known.iter().step_by(every).map(|(input, action)| (scaled(input), *action)).collect();
    let mut order: Vec<usize> = (0..steps.len()).collect();
    for _ in 0..PASSES {
        shuffle(&mut order, &mut stream);
        for &at in &order {
            network.learn(&steps[at].0, steps[at].1);
        }
    }
    let is_right = |(input, action): &&(Vec<f32>, usize)| {
        let (_, probabilities) = network.forward(&scaled(input));
        let best = (0..actions).max_by(|&one, &other| probabilities[one].total_cmp(&probabilities[other]));
        best == Some(*action)
    };
    Some(asked.iter().filter(is_right).count() as f64 / asked.len() as f64)
}

#[cfg(test)]
mod tests {

    use super::*;

    /// Ten episodes of 40 steps whose action is a function of the observation and of the step.
    fn episodes(action: impl Fn(usize, usize) -> u32) -> Vec<(Vec<f32>, Vec<ActionValue>)> {
        (0..10)
            .map(|episode| {
                let rows = (0..40).map(|step| ((step * 7 + episode * 3) % 20) as f32).collect::<Vec<_>>();
                let actions = (0..40)
                    .map(|step| ActionValue::Discrete(action((step * 7 + episode * 3) % 20, step * 31 + episode * 17)));
                (rows, actions.collect())
            })
            .collect()
    }

    fn measured(action: impl Fn(usize, usize) -> u32) -> Agreement {
        let made = episodes(action);
        let seen: Vec<_> = made.iter().map(|(rows, actions)| (rows.chunks(1).collect(), actions.clone())).collect();
        agreement(&seen).expect("enough steps")
    }

    #[test]
    fn actions_that_follow_from_observations_agree() {
        let found = measured(|seen, _| u32::from(seen > 9));
        assert!(found.beyond_chance > 0.99 && found.differing == 0.0, "{found:?}");
        let lasting = measured(|_, step| u32::from(step % 500 > 250));
        assert!(lasting.persistence > 0.5, "an action lasts for some steps: {lasting:?}");
        assert_eq!(found.equal, found.pairs, "every observation comes back");
    }

    #[test]
    fn actions_that_follow_from_something_else_agree_by_chance() {
        let found = measured(|_, hidden| (hidden as u32).wrapping_mul(2_654_435_761) >> 31);
        assert!(found.beyond_chance.abs() < 0.2 && found.differing > 0.3, "{found:?}");
        assert!((found.chance - 0.5).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn too_few_steps_say_nothing() {
        let made = episodes(|_, _| 0);
        let few: Vec<_> = made[..2].iter().map(|(rows, actions)| (rows.chunks(1).collect(), actions.clone())).collect();
        assert_eq!(agreement(&few), None);
    }

    /// Steps whose action is the exclusive or of two signs, the second of which may be hidden.
    fn steps(from: usize, count: usize, is_hidden: bool) -> ProbeSteps {
        (from..from + count)
            .map(|at| {
                let bit = |shift: u32| ((at as u32).wrapping_mul(2_654_435_761) >> shift) & 1;
                let (one, other) = (bit(31), bit(29));
                let shown = if is_hidden { 0.0 } else { other as f32 * 2.0 - 1.0 };
                (vec![one as f32 * 2.0 - 1.0, shown], (one ^ other) as usize)
            })
            .collect()
    }

    #[test]
    fn a_probe_learns_what_follows_from_its_input_and_nothing_else() {
        let shown = accuracy(&steps(0, 400, false), &steps(400, 100, false), 2).expect("enough steps");
        assert!(shown > 0.95, "{shown}");
        let hidden = accuracy(&steps(0, 400, true), &steps(400, 100, true), 2).expect("enough steps");
        assert!(hidden < 0.7, "{hidden}");
    }

    #[test]
    fn the_probe_says_nothing_about_too_few_steps() {
        assert_eq!(accuracy(&steps(0, 50, false), &steps(50, 100, false), 2), None);
        assert_eq!(accuracy(&Vec::new(), &Vec::new(), 2), None);
    }
}
