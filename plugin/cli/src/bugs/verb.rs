//! The verbs below `playbot bugs`.

use playbot_lab::games::Games;

use super::{make, score, table};
use crate::error::{CliError, Outcome};

/// Plant defects into games and levels, and measure which testers find them.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bugs make --seed 1 --out runs/bugs
  playbot bugs score runs/bugs --out runs/score.json
  playbot bugs table runs/score.json --out table.md")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

// Each is described where its arguments are.
#[derive(clap::Subcommand)]
enum Verb {
    Make(make::Args),
    Score(score::Args),
    Table(table::Args),
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb {
        Verb::Make(args) => make::run(&args, games),
        Verb::Score(args) => score::run(args, games),
        Verb::Table(args) => table::run(args),
    }
}
