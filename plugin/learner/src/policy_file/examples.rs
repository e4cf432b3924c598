//! Examples in a policy file, by which its reader checks that it computes the same numbers as the writer.

use super::PolicyFile;
use crate::file::TensorFile;
use crate::policy::{Policy, StateBatch};
use crate::skill::SkillDraw;
use crate::{FileError, LearnError, ObsKind, ObsSlice, Observations};

/// The examples' observations.
const OBSERVATIONS: &str = "examples.obs";

/// Tolerance of an example, absolute and relative: results are not equal on other CPUs.
const TOLERANCE: f32 = 1e-3;

/// One kind of output of a policy for each example.
struct Output {
    name: &'static str,
    /// Numbers of one example.
    width: usize,
    numbers: Vec<f32>,
}

/// All outputs of a policy, its decoder and its prior for some states.
pub(super) struct Examples {
    outputs: Vec<Output>,
}

impl Examples {
    /// Returns the outputs of `file`'s networks for `states`.
    pub(super) fn of(file: &PolicyFile, states: StateBatch<'_>) -> Result<Self, LearnError> {
        let StateBatch { z, obs, n, .. } = states;
        let output = file.policy.forward(z, obs, n)?;
        let dim = file.policy.action_space().dim();
        let std = |name, numbers: Vec<f32>| Output { name, width: if numbers.is_empty() { 0 } else { dim }, numbers };
        let mut outputs = vec![
            Output { name: "head", width: dim, numbers: output.head },
            std("log_std", output.log_std),
            Output { name: "value", width: 1, numbers: output.values },
        ];
        if let Some(skills) = &file.skills {
            let mean = skills.prior.sample(obs, n, SkillDraw::Mean, &mut |_| 0.0)?;
            // The skills that the policy reads or, if it reads none, those of the prior.
            let decoded = skills.decoder.forward(if file.policy.latent() > 0 { z } else { &mean }, obs, n)?;
            outputs.push(Output { name: "decoder_head", width: dim, numbers: decoded.head });
            outputs.push(std("decoder_log_std", decoded.log_std));
            outputs.push(Output { name: "prior_mean", width: skills.prior.latent(), numbers: mean });
        }
        Ok(Self { outputs })
    }

    /// Adds the outputs to a file, with their `states`.
    pub(super) fn put(&self, file: &mut TensorFile, policy: &Policy, states: StateBatch<'_>) {
        let StateBatch { z, obs, n, .. } = states;
        let shape = [n, policy.obs_dim()];
        match obs {
            ObsSlice::Vector(values) => file.put(OBSERVATIONS, &shape, values),
            ObsSlice::Image(pixels) => file.put_bytes(OBSERVATIONS, &shape, pixels),
        }
        let latent = policy.latent();
        file.put("examples.z", &[n, latent], if latent == 0 { &[] } else { z });
        for Output { name, width, numbers } in &self.outputs {
            file.put(&format!("examples.{name}"), &[n, *width], numbers);
        }
    }

    /// Compares the outputs of the networks that were `read` for the `n` examples of their file with the stored ones.
    pub(super) fn check(read: &PolicyFile, file: &mut TensorFile, n: usize) -> Result<(), FileError> {
        let policy = &read.policy;
        let shape = [n, policy.obs_dim()];
        let obs = match policy.observation() {
            ObsKind::Vector(_) => Observations::Vector(file.take(OBSERVATIONS, &shape)?),
            ObsKind::Image(_) => Observations::Image(file.take_bytes(OBSERVATIONS, &shape)?),
        };
        let z = file.take("examples.z", &[n, policy.latent()])?;
        let states = StateBatch { z: &z, left: &[], obs: obs.as_slice(), n };
        let examples = Self::of(read, states).map_err(|source| file.learner(source))?;
        for Output { name, width, numbers } in examples.outputs {
            let expected = file.take(&format!("examples.{name}"), &[n, width])?;
            let same = |(a, b): (&f32, &f32)| a == b || (a - b).abs() <= TOLERANCE * (1.0 + a.abs());
            if let Some(at) = expected.iter().zip(&numbers).position(|pair| !same(pair)) {
                return Err(FileError::Example {
                    path: file.path().to_owned(),
                    example: at / width.max(1),
                    what: name,
                    expected: expected[at],
                    found: numbers[at],
                });
            }
        }
        Ok(())
    }
}
