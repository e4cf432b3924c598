//! Options of a resumed training.

use crate::{
    arguments::experiment::{Options, in_words, reaches},
    error::CliError,
    verbs::train::Args,
};
use playbot_harness::{brief::shell_word, games::Games, sealed_file::file_checksum};
use playbot_train::{Experiment, run_dir::RunInfo};
use std::path::Path;

/// Settings of a run that may change at a resumption: its length and its checkpoint interval.
const FREE: [&str; 2] = ["steps", "checkpoints.every"];

/// Returns the experiment of a resumed run: the saved one, with the changeable settings of the options. All other
/// options must equal the run's, so that a whole command can be repeated with `--resume`.
///
/// # Errors
///
/// The options cannot be read, or have other values: each with that of the run.
pub(super) fn resumed(args: &Args, saved: &Experiment, info: &RunInfo, games: &Games) -> Result<Experiment, CliError> {
    let sets = args.from.sets(args.settings());
    let mut wanted = match &args.from.experiment {
        Some(_) => args.from.load(games, args.settings())?.without_study(),
        None => saved.with_set(&sets)?.without_study(),
    };
    // A file has the first length of the run, which may have been made longer since.
    if !is_set(&sets, FREE[0]) {
        wanted.steps = saved.steps;
    }
    if !is_set(&sets, FREE[1]) {
        wanted.checkpoints.every = saved.checkpoints.every;
    }
    let mut differences = differences(args, saved, &wanted);
    differences.extend(args.skills.as_deref().map(|path| other_skills(path, info)).transpose()?.flatten());
    if differences.is_empty() {
        wanted.check()?;
        return Ok(wanted);
    }
    Err(CliError::Usage(format!(
        "{} is resumed with other settings: {}; drop the option, or start a new run with another --run, \
         without --resume, and with --from {} to begin with the weights of this one (--steps and --checkpoint-every \
         may change)",
        args.run.display(),
        in_words(differences),
        shell_word(&args.run.display().to_string())
    )))
}

/// Returns true if one of the `key=value` sets a key, alone or with its whole section.
fn is_set(sets: &[String], key: &str) -> bool {
    sets.iter().any(|set| reaches(set, key))
}

/// Returns the differences between the options and the run, but for the changeable settings.
fn differences(args: &Args, saved: &Experiment, wanted: &Experiment) -> Vec<String> {
    let own = [
        ("algorithm", args.algorithm.map(|algorithm| format!("--algorithm {algorithm}"))),
        ("seed", args.seed.map(|seed| format!("--seed {seed}"))),
    ];
    Options { from: &args.from, own: &own }.differences(wanted, saved, "the run", &FREE)
}

/// Returns a message about a skill model that is not the run's; `None` if the run has none, or does not note which.
fn other_skills(path: &Path, info: &RunInfo) -> Result<Option<String>, CliError> {
    let Some(kept) = &info.skills else { return Ok(None) };
    let given = file_checksum(path).map_err(|error| {
        CliError::Usage(format!("{error}; drop --skills: a run that goes on has the skills that it began with"))
    })?;
    Ok((given != *kept).then(|| {
        let path = path.display();
        format!("`--skills {path}` is the skill model {given}, and the run has {kept}")
    }))
}

#[cfg(test)]
mod tests {
    use bevy::prelude::App;
    use clap::Parser;
    use playbot_harness::{foreign::ForeignGame, game::Game};
    use playbot_learner::DeviceKind;
    use playbot_train::Algorithm;

    use super::*;
    use crate::arguments::experiment::ExperimentArgs;

    #[derive(Parser)]
    struct Train {
        #[command(flatten)]
        args: Args,
    }

    /// Returns the experiment of a run that began with some options and is resumed with others.
    fn again(begun: &[&str], options: &[&str]) -> Result<Experiment, String> {
        let game = ForeignGame::new("runner", 1, |_: &mut App| {});
        let games = [&game as &dyn Game];
        let games = Games::new(&games).expect("one game");
        let from = ExperimentArgs { set: begun.iter().map(|set| (*set).to_owned()).collect(), ..Default::default() };
        let saved = from.load(&games, []).expect("valid");
        let (version, revision) = ("1".to_owned(), "r".to_owned());
        let (algorithm, seed, device) = (Algorithm::Ppo, 1, DeviceKind::default());
        let info = RunInfo {
            algorithm,
            seed,
            version,
            revision,
            game_version: 1,
            skills: None,
            seen: None,
            begun_from: None,
            observed: Vec::new(),
            device,
        };
        let words = ["train", "--run", "runs/first", "--resume"].into_iter().chain(options.iter().copied());
        let args = Train::try_parse_from(words).unwrap_or_else(|error| panic!("{error}")).args;
        resumed(&args, &saved, &info, &games).map_err(|error| error.to_string())
    }

    const BEGUN: [&str; 3] = ["algorithm=ppo", "ppo.lr=0.01", "steps=500"];

    #[test]
    fn a_command_can_be_repeated_as_it_was() {
        let same = ["--algorithm", "ppo", "--set", "ppo.lr=0.01", "--steps", "500", "--seed", "1"];
        let plain = again(&BEGUN, &[]).expect("nothing is asked for");
        assert_eq!(again(&BEGUN, &same), Ok(plain.clone()));
        // The last one counts.
        assert_eq!(again(&BEGUN, &["--set", "ppo.lr=0.5", "--set", "ppo=(lr: 0.01)"]), Ok(plain));
    }

    #[test]
    fn length_and_checkpoints_may_change() {
        let longer = again(&BEGUN, &["--steps", "900", "--checkpoint-every", "3"]).expect("allowed");
        assert_eq!((longer.steps, longer.checkpoints.every), (900, 3));
        assert_eq!(again(&BEGUN, &["--set", "steps=900"]).expect("allowed").steps, 900);
    }

    #[test]
    fn a_file_says_nothing_of_a_length_that_was_changed_since() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("mine.ron");
        let text = r#"(game: "runner", train: "default:0..63", test: "default:64..127", steps: 100, algorithm: "ppo",
            demos: "demos/runner", ppo: (lr: 0.01))"#;
        std::fs::write(&file, text).expect("writable");
        let path = file.to_str().expect("plain");
        let longer = again(&BEGUN, &["--experiment", path]).expect("the same but for the steps");
        assert_eq!(longer.steps, 500);
        let other = again(&BEGUN, &["--experiment", path, "--set", "arenas=32"]).expect_err("others");
        assert!(other.contains("`--set arenas=32` asks for arenas=32, and the run has 64"), "{other}");
        let text = text.replace("0.01", "0.25");
        std::fs::write(&file, text).expect("writable");
        let other = again(&BEGUN, &["--experiment", path]).expect_err("another rate");
        assert!(other.contains("mine.ron` asks for ppo.lr=0.25, and the run has 0.01"), "{other}");
    }

    #[test]
    fn what_differs_is_named_with_both_values_and_what_to_do() {
        for (options, words) in [
            (&["--algorithm", "sac"][..], "`--algorithm sac` asks for algorithm=sac, and the run has ppo"),
            (&["--seed", "7"], "`--seed 7` asks for seed=7, and the run has 1"),
            (&["--set", "ppo.lr=0.5"], "`--set ppo.lr=0.5` asks for ppo.lr=0.5, and the run has 0.01"),
            (&["--set", "ppo=(lr: 0.5)"], "asks for ppo.lr=0.5, and the run has 0.01"),
        ] {
            let text = again(&BEGUN, options).expect_err("another value");
            assert!(text.contains(words), "{text}");
            assert!(
                text.starts_with("runs/first is resumed with other settings")
                    && text.contains("another --run")
                    && text.contains("--from runs/first to begin"),
                "{text}"
            );
        }
    }
}
