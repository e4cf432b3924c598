//! What a tick pays, beside what it should pay.

/// What is wrong if a tick has paid something else than the rules say, by more than `slack`.
pub(crate) fn paid_otherwise(paid: f32, by_rules: f32, slack: f32) -> Option<String> {
    // What is no number is not near to anything.
    let is_same = (paid - by_rules).abs() <= slack;
    (!is_same).then(|| format!("the tick paid {paid}; by the rules it pays {by_rules}"))
}
