//! The verbs below `playbot report`.

use playbot_lab::games::Games;

use super::{calibrate, html, merge};
use crate::error::{CliError, Outcome};

/// Work with the results of tests.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot report merge runs/shard-0 runs/shard-1 --out runs/test
  playbot report html runs/test
  playbot report calibrate runs/test people.demo --out people.html")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Join the results of all shards of a test.
    Merge(merge::Args),
    /// Write the page of results again.
    Html(html::Args),
    /// Compare the results with recordings of people.
    Calibrate(calibrate::Args),
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    match &args.verb {
        Verb::Merge(args) => merge::run(args, games),
        Verb::Html(args) => html::run(args, games),
        Verb::Calibrate(args) => calibrate::run(args, games),
    }
}
