//! How long a training is, in words.

use playbot_lab::{report::whole, train::Experiment};

use crate::number::counted;

/// What is to be said of steps that are no whole number of updates; nothing of those that are.
pub fn rounded(experiment: &Experiment) -> Option<String> {
    let (asked, trained) = (experiment.steps, experiment.whole_steps());
    (asked != trained).then(|| {
        format!(
            "{} rounded up to {} of {}: training for {}",
            if asked == 1 { "1 step is".to_owned() } else { format!("{} steps are", whole(asked as f64)) },
            counted(experiment.updates(), "update"),
            whole(experiment.steps_per_update() as f64),
            whole(trained as f64)
        )
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use playbot_lab::train::config_file::parse_experiment;

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
}
