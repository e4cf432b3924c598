//! Running normalisation of observations and rewards.

use crate::case::Case;
use playbot_learner::norm::{ObsNormalizer, RewardNormalizer, RewardReset, RunningStats};

fn normalized(normalizer: &ObsNormalizer, rows: &[f32], dim: usize) -> Vec<f32> {
    let stats = normalizer.snapshot();
    let mut out = vec![0.0; rows.len()];
    rows.chunks_exact(dim).zip(out.chunks_exact_mut(dim)).for_each(|(row, to)| stats.normalize_into(row, to));
    out
}

fn f32s(values: &[f64]) -> Vec<f32> {
    values.iter().map(|&x| x as f32).collect()
}

/// Returns statistics without data, as the case has them.
fn fresh(case: &Case, dim: usize) -> RunningStats {
    case.assert_fixed("clip", 10.0);
    case.assert_fixed("eps", 1e-8);
    RunningStats {
        mean: vec![case.number("mean_init"); dim],
        var: vec![case.number("var_init"); dim],
        count: case.number("count_init"),
    }
}

#[test]
fn statistics_start_with_a_normal_distribution_of_next_to_no_weight() {
    assert_eq!(RunningStats::new(2), RunningStats { mean: vec![0.0; 2], var: vec![1.0; 2], count: 1e-4 });
}

#[test]
fn golden_norm_obs() {
    let case = Case::load("norm_obs");
    case.assert_fixed("order", "update the statistics, then normalise");
    let dim = case.dim("D");
    let mut normalizer = ObsNormalizer::new(dim);
    normalizer.stats = fresh(&case, dim);
    for i in 0..case.dim("batches") {
        let batch = case.f32s(&format!("in.batch{i}"));
        normalizer.update(&batch);
        case.check(&format!("out.mean{i}"), &f32s(&normalizer.stats.mean));
        case.check(&format!("out.var{i}"), &f32s(&normalizer.stats.var));
        case.check(&format!("out.normalized{i}"), &normalized(&normalizer, &batch, dim));
        case.check_entry("count", i, normalizer.stats.count);
    }
    case.check("out.probe_frozen", &normalized(&normalizer, &case.f32s("in.probe"), dim));
    case.finish(&[]);
}

#[test]
fn golden_norm_reward() {
    let case = Case::load("norm_reward");
    for (reset, variant) in [(RewardReset::AfterStep, "reset_after"), (RewardReset::SameStep, "reset_same_step")] {
        let default = RewardNormalizer::new(case.number("gamma"));
        check_rewards(&case, RewardNormalizer { reset, stats: fresh(&case, 1), ..default }, variant);
    }
    case.finish(&[]);
}

fn check_rewards(case: &Case, fresh: RewardNormalizer, variant: &str) {
    let envs = case.dim("N");
    let mut normalizer = fresh.clone();
    let (rewards, dones) = (case.f32s("in.rewards"), case.bools("in.dones"));
    let (mut scaled, mut mean, mut var, mut returns) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (rewards, dones) in rewards.chunks_exact(envs).zip(dones.chunks_exact(envs)) {
        // The variance's input: with the ends of episodes hidden where these reset afterwards.
        let mut before = normalizer.clone();
        let shown = if fresh.reset == RewardReset::AfterStep { &vec![false; envs] } else { dones };
        before.normalize(rewards, shown, envs).expect("they fit");
        returns.extend(f32s(&before.returns));
        scaled.extend(normalizer.normalize(rewards, dones, envs).expect("they fit"));
        mean.push(normalizer.stats.mean[0] as f32);
        var.push(normalizer.stats.var[0] as f32);
    }
    case.check(&format!("out.{variant}.discounted_return"), &returns);
    case.check(&format!("out.{variant}.normalized"), &scaled);
    case.check(&format!("out.{variant}.mean"), &mean);
    case.check(&format!("out.{variant}.var"), &var);
    case.check_number("count_final", normalizer.stats.count);
    let mut whole = fresh;
    assert_eq!(whole.normalize(&rewards, &dones, envs).expect("they fit"), scaled);
    assert_eq!(whole, normalizer);
}
