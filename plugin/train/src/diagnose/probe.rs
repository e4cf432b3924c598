//! A small network that is asked to predict recorded actions, to see what decides them.

use crate::diagnose::observation::{ColumnStatistics, statistics};
use playbot_learner::{
    Streams,
    rng::{ChaCha8Rng, normal, shuffle},
};

/// Hidden units, passes over the steps, and the step size of plain stochastic gradient descent.
const HIDDEN: usize = 24;
const PASSES: usize = 25;
const RATE: f32 = 0.05;

/// Most steps that are learned from.
const STEPS: usize = 1000;

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
    let every = known.len().div_ceil(STEPS).max(1);
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
    fn too_few_steps_say_nothing() {
        assert_eq!(accuracy(&steps(0, 50, false), &steps(50, 100, false), 2), None);
        assert_eq!(accuracy(&Vec::new(), &Vec::new(), 2), None);
    }
}
