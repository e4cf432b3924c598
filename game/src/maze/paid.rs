//! Comparison of a tick's reward with the rules.

/// Describes a reward that differs from the rules by more than `slack`; `None` if it does not.
pub(crate) fn paid_otherwise(paid: f32, by_rules: f32, slack: f32) -> Option<String> {
    // NaN is not near to anything.
    let is_same = (paid - by_rules).abs() <= slack;
    (!is_same).then(|| format!("the tick paid {paid}; by the rules it pays {by_rules}"))
}
