//! Messages about the length of a training.

use super::{algorithm::LearnerKind, config::Experiment};
use crate::report::whole;

/// Returns a message about steps that are no whole number of updates; `None` for whole ones.
pub fn rounded(experiment: &Experiment) -> Option<String> {
    let (asked, trained) = (experiment.steps, experiment.whole_steps());
    (asked != trained).then(|| {
        format!(
            "{} rounded up to {} of {}: training for {}",
            if asked == 1 { "1 step is".to_owned() } else { format!("{} steps are", whole(asked as f64)) },
            if experiment.updates() == 1 { "1 update".to_owned() } else { format!("{} updates", experiment.updates()) },
            whole(experiment.steps_per_update() as f64),
            whole(trained as f64)
        )
    })
}

/// Returns a message about a training that ends before its policy learns; `None` for others.
pub fn never_learns(experiment: &Experiment) -> Option<String> {
    let algorithm = experiment.algorithm;
    if !algorithm.is_trained() {
        return None;
    }
    match algorithm.learner() {
        LearnerKind::Ppo => (experiment.updates() <= experiment.ppo.critic_warmup).then(|| {
            format!(
                "the policy will not change: only its critic learns in the first {} updates (`ppo.critic_warmup`), and \
                 this training has {}; train for longer, or set it lower",
                whole(experiment.ppo.critic_warmup as f64),
                whole(experiment.updates() as f64)
            )
        }),
        LearnerKind::Sac => sac_never_learns(experiment),
    }
}

fn sac_never_learns(experiment: &Experiment) -> Option<String> {
    let (algorithm, sac) = (experiment.algorithm, &experiment.sac);
    // Policies over skills learn from skills, not from ticks.
    let (held, what) = match algorithm.learns_prior() {
        true => (experiment.score.horizon as u64, "skills"),
        false => (1, "steps"),
    };
    let (starts, seen) = (sac.learning_starts, experiment.whole_steps() / held);
    if seen < starts {
        return Some(format!(
            "nothing will be learned: {algorithm} begins to learn after {} {what} (`sac.learning_starts`), and this training \
             has {} of them at most; train for longer, or set it lower",
            whole(starts as f64),
            whole(seen as f64),
        ));
    }
    // Steps of the update that reaches the start count, too.
    let steps = sac.updates_per_step * seen as f64;
    (steps <= sac.critic_warmup as f64).then(|| {
        format!(
            "the policy will not change: only its critics learn in the first {} gradient steps (`sac.critic_warmup`), \
             and this training has {} at most; train for longer, or set it lower",
            whole(sac.critic_warmup as f64),
            whole(steps.floor())
        )
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::config_file::parse_experiment;

    use super::*;

    #[test]
    fn only_what_is_no_whole_number_of_updates_is_spoken_of() {
        let said = |steps: u64| {
            let text = format!(
                r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: {steps}, algorithm: "ppo", arenas: 32,
                ppo: (num_steps: 128))"#
            );
            rounded(&parse_experiment(&text, Path::new("x.ron")).expect("valid"))
        };
        assert_eq!(said(500).as_deref(), Some("500 steps are rounded up to 1 update of 4,096: training for 4,096"));
        assert_eq!(said(1).as_deref(), Some("1 step is rounded up to 1 update of 4,096: training for 4,096"));
        assert_eq!(said(4097).as_deref(), Some("4,097 steps are rounded up to 2 updates of 4,096: training for 8,192"));
        assert_eq!(said(8192), None);
    }

    #[test]
    fn who_begins_to_learn_too_late_is_told() {
        let said = |algorithm: &str, steps: u64| {
            let text = format!(
                r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: {steps}, algorithm: "{algorithm}", demos: "d",
                arenas: 1, worlds: 1, sac: (num_steps: 100, learning_starts: 1000), score: (init_from_decoder: false, horizon: 4))"#
            );
            never_learns(&parse_experiment(&text, Path::new("x.ron")).expect("valid"))
        };
        let words = said("sac", 900).expect("too short");
        assert!(words.contains("after 1,000 steps (`sac.learning_starts`), and this training has 900"), "{words}");
        let words = said("spirl-sac", 3900).expect("too few skills");
        assert!(words.contains("after 1,000 skills") && words.contains("this training has 975 of them"), "{words}");
        for (algorithm, steps) in [("sac", 1000), ("spirl-sac", 4000), ("ppo", 900), ("bc", 900)] {
            assert_eq!(said(algorithm, steps), None, "{algorithm}");
        }
    }

    #[test]
    fn a_warm_up_that_never_ends_is_told() {
        let said = |algorithm: &str, steps: u64| {
            let text = format!(
                r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: {steps}, algorithm: "{algorithm}", demos: "d",
                arenas: 4, worlds: 1, ppo: (num_steps: 100, critic_warmup: 3), score: (init_from_decoder: false),
                sac: (num_steps: 100, learning_starts: 100, updates_per_step: 0.5, critic_warmup: 1000))"#
            );
            never_learns(&parse_experiment(&text, Path::new("x.ron")).expect("valid"))
        };
        for algorithm in ["ppo", "score-ppo", "spirl-ppo"] {
            let words = said(algorithm, 1200).expect("three updates");
            assert!(words.contains("the first 3 updates (`ppo.critic_warmup`), and this training has 3;"), "{words}");
            assert_eq!(said(algorithm, 1201), None, "{algorithm}");
        }
        let words = said("score-sac", 2000).expect("too short");
        assert!(
            words.contains("1,000 gradient steps (`sac.critic_warmup`), and this training has 1,000 at most"),
            "{words}"
        );
        assert_eq!((said("score-sac", 2400), said("bc", 100)), (None, None));
    }
}
