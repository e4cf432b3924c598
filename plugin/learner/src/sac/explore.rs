//! The policy of play before the first gradient step: random actions.

use crate::ActionSpace;
use crate::nn::{Activation, Linear, Mlp, matrix, vector};
use crate::policy::{Actor, LogStd};
use burn::tensor::Device;

/// σ at which the tanh of a normal number is nearly uniform: that of the logistic distribution whose tanh is exactly
/// uniform, π/(2√3). The density in [-0.98, 0.98] lies between 0.44 and 0.62 instead of at 0.5.
const NEARLY_UNIFORM: f64 = 0.906_899_682_117_108_9;

/// Returns a policy that ignores the `inputs` numbers of its observation: uniform over choices, nearly uniform over
/// vectors in [-1, 1].
pub(super) fn explorer(space: ActionSpace, inputs: usize, device: &Device) -> Actor {
    let dim = space.dim();
    let zeros = || Linear {
        weight: matrix(vec![0.0; inputs * dim], inputs, dim, device),
        bias: vector(vec![0.0; dim], device),
    };
    let log_std = match space {
        ActionSpace::Discrete(_) => LogStd::None,
        ActionSpace::Continuous(_) => {
            // In the middle of the range, to which the zeros lead.
            let middle = NEARLY_UNIFORM.ln();
            LogStd::Squashed { layer: zeros(), range: (middle - 1.0, middle + 1.0) }
        }
    };
    Actor { cnn: None, net: Mlp { layers: Vec::new(), head: zeros(), activation: Activation::Relu }, log_std }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::Policy;
    use crate::rng::Streams;
    use crate::{Action, DeviceKind, PolicySpec};

    /// Counts how 20,000 actions fall into five bins.
    fn counts(space: ActionSpace) -> [usize; 5] {
        let device = DeviceKind::Flex.plain();
        let spec = PolicySpec { obs: 2.into(), latent: 1, action_space: space };
        let policy = Policy::new(&explorer(space, 3, &device), None, None, spec, device);
        let output = policy.forward(&[5.0], &[-3.0, 4.0], 1).expect("finite");
        let mut rng = Streams::new(1).stream("draw", 0);
        let mut counts = [0; 5];
        for _ in 0..20_000 {
            let bin = match output.sample(0, &mut rng).0 {
                Action::Discrete(choice) => choice as usize,
                Action::Continuous(vector) => ((vector[1] + 1.0) * 2.5) as usize,
            };
            counts[bin.min(4)] += 1;
        }
        counts
    }

    #[test]
    fn choices_are_equally_likely_and_vectors_nearly() {
        let choices = counts(ActionSpace::Discrete(5));
        assert!(choices.iter().all(|n| (3800..4200).contains(n)), "{choices:?}");
        let vectors = counts(ActionSpace::Continuous(2));
        assert!(vectors.iter().all(|n| (3300..4700).contains(n)), "{vectors:?}");
    }
}
