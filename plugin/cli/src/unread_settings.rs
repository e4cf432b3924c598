//! Settings without effect, since the algorithm does not read them.

use playbot_lab::train::Experiment;

/// Reports the `key=value`s that none of these experiments reads.
pub fn tell_unread(whose: &str, sets: &[String], experiments: &[&Experiment]) {
    let mut names: Vec<&str> = experiments.iter().map(|experiment| experiment.algorithm.name()).collect();
    names.sort_unstable();
    names.dedup();
    for set in sets {
        let key = set.split('=').next().unwrap_or(set).trim();
        if !experiments.iter().any(|experiment| experiment.reads(key)) {
            tell!("warning: {whose}{set} changes nothing: {} does not read `{key}`", names.join(" or "));
        }
    }
}
