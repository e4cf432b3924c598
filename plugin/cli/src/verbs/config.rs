//! `playbot config`.

use crate::{
    arguments::experiment::ExperimentArgs,
    error::{CliError, Outcome},
    output::{print_line, print_or_write},
};
use clap::Subcommand;
use playbot_harness::{game::Game, games::Games, sensors::GameSensors};
use playbot_train::{
    Experiment,
    experiment::{ExperimentError, ExperimentFile, PRESETS, find_preset},
};
use serde_json::json;
use std::path::PathBuf;

/// Show experiments with all their values, and the presets to build them on.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot config show --experiment my.ron --set ppo.lr=0.0003
  playbot config show --out my.ron
  playbot config presets
  playbot config presets skill-paper")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Print the experiment with all its values, as it would be run, in RON.
    Show {
        #[command(flatten)]
        from: ExperimentArgs,
        /// File to write it to instead of standard output. It must not exist.
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
    /// List the presets that `base: [...]` in an experiment file can name, or print one.
    Presets {
        /// The preset to print.
        name: Option<String>,
        /// One line of JSON per preset.
        #[arg(long)]
        json: bool,
    },
}

/// Checks that the game has the experiment's observation.
fn check_sight(experiment: &Experiment, game: &dyn Game) -> Result<(), ExperimentError> {
    experiment.observation_config().check(game).map_err(|error| {
        let words = format!("`observation`: {error}");
        ExperimentError::Settings { key: Some("observation".to_owned()), words }
    })
}

/// Checks an experiment against its game. Recordings need not exist yet.
fn check(experiment: &Experiment, from: &ExperimentArgs, games: &Games) -> Result<(), CliError> {
    let game = from.find_game(games, experiment)?;
    let checked = experiment.check_game(game).and_then(|()| check_sight(experiment, game));
    let checked = checked.and_then(|()| experiment.check_memory(game));
    checked.map_err(|error| from.locate(games, [], error))?;
    let algorithm = experiment.algorithm;
    let demos = experiment.demos.as_deref().filter(|_| algorithm.learns_from_demos());
    if let Some(path) = demos.filter(|path| !from.find_recordings(path, games).exists()) {
        report!("warning: there are no recordings at {}, from which {algorithm} learns (`demos`)", path.display());
    }
    Ok(())
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb {
        Verb::Show { from, out } => {
            let experiment = from.load(games, [])?;
            check(&experiment, &from, games)?;
            let text = experiment.to_ron().map_err(|error| CliError::Usage(error.to_string()))?;
            print_or_write(&text, out.as_deref())?;
        }
        Verb::Presets { name, json } => {
            let chosen_by_name = name.is_some();
            let chosen = match &name {
                Some(name) => vec![find_preset(name)?],
                None => PRESETS.to_vec(),
            };
            for preset in chosen {
                let (ExperimentFile { name, text, .. }, about) = (preset, preset.about());
                print_line(match (json, chosen_by_name) {
                    (true, _) => json!({ "name": name, "about": about, "ron": text }).to_string(),
                    (false, true) => text.trim_end().to_owned(),
                    (false, false) => format!("{name:<24} {about}"),
                })?;
            }
        }
    }
    Ok(Outcome::Pass)
}
