//! `playbot work`.

use crate::{
    arguments::own_code,
    error::{CliError, Outcome},
    output::DataStream,
    progress::interrupt,
};
use playbot_harness::{game::Game, games::Games};
use playbot_train::cluster::worker;
use std::io::{self, BufReader, BufWriter, IsTerminal};

/// Play for a training elsewhere, as one of the workers that `train --cluster` starts.
///
/// It reads orders from standard input, writes rollouts to standard output, and ends with the input. Each order holds all that its
/// rollout depends on, so any worker can take the place of another.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot train GAME --run runs/first --algorithm ppo --cluster processes --workers 4   starts four workers")]
pub struct Args {}

pub(crate) fn run(_: &Args, games: &Games) -> Result<Outcome, CliError> {
    if io::stdin().is_terminal() {
        let words = "a worker is started by a training: `playbot train … --cluster processes`, or --cluster ray";
        return Err(CliError::Usage(words.to_owned()));
    }
    // The end of the input ends a worker. Ctrl-C in a shell is for its training.
    interrupt::leave("the training goes on with other workers".to_owned());
    let find = |name: &str| -> Result<&dyn Game, String> { games.get(name).map_err(|error| error.to_string()) };
    let (mut input, mut output) = (BufReader::new(io::stdin().lock()), BufWriter::new(DataStream));
    let worked = worker::work(&find, &own_code(), &mut input, &mut output);
    worked
        .map(|()| Outcome::Pass)
        .map_err(|error| CliError::Io(format!("the training cannot be heard any more: {error}")))
}
