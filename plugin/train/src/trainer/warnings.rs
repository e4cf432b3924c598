//! Warnings of a training: numbers whose scale is far from 1, and a large replay buffer.

use crate::experiment::{Experiment, LearnerKind};
use playbot_learner::{Observations, PolicySpec, Rollout};
use playbot_report::readable;
use std::ops::RangeInclusive;

/// Sizes of the largest numbers of a kind from which networks learn as they are: their weights begin for sizes about 1.
const FIT: RangeInclusive<f32> = 1e-3..=100.0;

/// A value that is not 0 in fewer than one of so many rows is rare.
const RARE: usize = 10;

/// Most observed values that a warning names.
const NAMED: usize = 3;

/// Returns whether the learner normalises observations itself.
pub(super) fn normalises_observations(experiment: &Experiment) -> bool {
    match experiment.algorithm.learner() {
        LearnerKind::Ppo => experiment.ppo.norm_obs,
        LearnerKind::Sac => experiment.sac.norm_obs,
    }
}

/// Returns warnings of observations and rewards whose scale is far from 1, in the first rollout of a training. `raw`
/// names the observed values that are not normalised.
pub(super) fn strange_scales(experiment: &Experiment, raw: &[String], rollout: &Rollout) -> Vec<String> {
    let (section, norm_reward) = match experiment.algorithm.learner() {
        LearnerKind::Ppo => ("ppo", experiment.ppo.norm_reward),
        LearnerKind::Sac => ("sac", experiment.sac.norm_reward),
    };
    let is_strange = |size: f32| size > 0.0 && !FIT.contains(&size);
    let largest = |values: &mut dyn Iterator<Item = f32>| values.fold(0.0, |most: f32, value| most.max(value.abs()));
    let up_to = |size: f32| format!("up to {}", readable(f64::from(size)));
    let mut warnings = Vec::new();
    if let Observations::Vector(values) = &rollout.obs {
        let of = |index: usize| values.iter().skip(index).step_by(raw.len().max(1)).copied();
        let sizes = raw.iter().enumerate().map(|(index, name)| (index, name, largest(&mut of(index))));
        // A value that is 0 nearly always has shown little of its range.
        let is_rare = |index: usize| of(index).filter(|value| *value != 0.0).count() * RARE < of(index).count();
        let strange = sizes.filter(|(index, _, size)| is_strange(*size) && (*size > 1.0 || !is_rare(*index)));
        let strange: Vec<_> = strange.map(|(_, name, size)| (name, size)).collect();
        let mut words: Vec<_> =
            strange.iter().take(NAMED).map(|(name, size)| format!("`{name}` ({})", up_to(*size))).collect();
        let more = strange.len().saturating_sub(NAMED);
        words.extend((more > 0).then(|| format!("{more} more")));
        if !words.is_empty() {
            let advice = match experiment.algorithm.needs_skills() {
                true => "learn the skills again with `--set skills.norm_obs=true`".to_owned(),
                false => format!("normalise them with `--set {section}.norm_obs=true`"),
            };
            warnings.push(format!(
                "observed values far from 1 are hard to learn from: {}; {advice}, or let the game divide them by their range",
                words.join(", ")
            ));
        }
    }
    let reward = largest(&mut rollout.rewards.iter().copied());
    if !norm_reward && is_strange(reward) {
        warnings.push(format!(
            "rewards far from 1 are hard to learn from: {}; scale them with `--set {section}.norm_reward=true`",
            up_to(reward)
        ));
    }
    warnings
}

/// Warns of a large replay buffer.
pub(super) fn warn_of_large_buffer(experiment: &Experiment, spec: PolicySpec, latent: usize) {
    const GIB: f64 = (1u64 << 30) as f64;
    let transitions = (experiment.sac.buffer as u64).min(experiment.steps);
    let numbers = 2 * (spec.obs.numbers() + latent) + spec.action_space.dim() + 2;
    let size = transitions as f64 * (4 * numbers) as f64 / GIB;
    if size > 1.0 {
        tracing::warn!(
            "the replay buffer will grow to {size:.1} GiB of memory, and each checkpoint with it on the disk: \
             `sac.buffer` can be smaller than {}, and `checkpoints.every` larger",
            experiment.sac.buffer
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::file::parse_experiment;
    use playbot_learner::{ActionSpace, ObsKind};
    use std::path::Path;

    /// Returns the warnings of a rollout of two values, `x` and `speed`, that are at most 1000 and `speed`.
    fn warnings(settings: &str, speed: f32, reward: f32) -> Vec<String> {
        let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", demos: "d", steps: 10, {settings})"#);
        let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
        let mut rollout = Rollout::new(1, ObsKind::Vector(2), 0, &ActionSpace::Discrete(2));
        rollout.obs = Observations::Vector(vec![3.0, 0.0, -1000.0, -speed, 2.0, 0.0]);
        rollout.rewards = vec![0.0, -reward, 0.0];
        let raw = if normalises_observations(&experiment) { vec![] } else { vec!["x".to_owned(), "speed".to_owned()] };
        strange_scales(&experiment, &raw, &rollout)
    }

    #[test]
    fn scales_far_from_1_are_named_with_the_setting_that_normalises_them() {
        let expected = "observed values far from 1 are hard to learn from: `x` (up to 1,000); normalise them with `--set \
                        ppo.norm_obs=true`, or let the game divide them by their range";
        assert_eq!(warnings(r#"algorithm: "ppo""#, 1.0, 1000.0), [expected], "PPO normalises rewards");
        let both = warnings(r#"algorithm: "sac""#, 1e-4, 1000.0);
        assert!(both[0].contains("`x` (up to 1,000), `speed` (up to ") && both[0].contains("sac.norm_obs"), "{both:?}");
        let expected =
            "rewards far from 1 are hard to learn from: up to 1,000; scale them with `--set sac.norm_reward=true`";
        assert_eq!(both[1..], [expected]);
        let both = r#"algorithm: "sac", sac: (norm_obs: true, norm_reward: true)"#;
        assert!(warnings(both, 1e-4, 1000.0).is_empty());
        assert!(warnings(r#"algorithm: "ppo", ppo: (norm_obs: true)"#, 1e-4, 1000.0).is_empty());
        assert!(warnings(r#"algorithm: "score-ppo""#, 1.0, 0.0)[0].contains("`--set skills.norm_obs=true`"));
        let constant = warnings(r#"algorithm: "sac", sac: (norm_reward: true)"#, 0.0, 0.0);
        assert!(!constant[0].contains("speed"), "a value that never changes says nothing of its scale");
    }
}
