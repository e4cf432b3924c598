//! What is said of checkpoints that cannot be read when a training goes on.

use super::run_error::RunError;

/// The latest checkpoints of a run, by their steps and what is wrong with each, where the one of `step` is the first that
/// can be read; `None` if there is nothing wrong with the last one.
pub(super) fn passed_over(bad: &[(u64, RunError)], step: u64) -> Option<String> {
    let (latest, why) = bad.first()?;
    if bad.len() == 1 {
        return Some(format!(
            "the checkpoint of step {latest} cannot be read ({why}); going on from step {step} instead"
        ));
    }
    let steps: Vec<String> = bad.iter().map(|(step, _)| step.to_string()).collect();
    Some(format!(
        "the checkpoints of the steps {} cannot be read (the first: {why}); going on from step {step} instead",
        steps.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{super::run_error::damaged, *};

    #[test]
    fn one_sentence_says_it_of_all() {
        let bad = |step: u64| (step, damaged(Path::new("a"), &"torn"));
        assert_eq!(passed_over(&[], 8), None);
        let words = passed_over(&[bad(16)], 8).expect("one");
        assert!(words.starts_with("the checkpoint of step 16 cannot be read (a: "), "{words}");
        assert!(words.ends_with("going on from step 8 instead"), "{words}");
        let words = passed_over(&[bad(24), bad(16)], 8).expect("two");
        assert!(words.starts_with("the checkpoints of the steps 24, 16 cannot be read (the first: a: "), "{words}");
    }
}
