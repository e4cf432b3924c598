//! `playbot report merge`.

use std::path::PathBuf;

use playbot_lab::{
    games::Games,
    verdict::{RESULTS, ResultLines, merge},
};

use crate::{
    error::{CliError, Outcome},
    test::{Results, tell_results},
};

/// Joins the results of all shards of a test: the same bytes as those of the whole test.
///
/// All shards must be there once, of the same test. The exit code is that of `playbot test`.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot report merge runs/shard-0 runs/shard-1 --out runs/test
  playbot report merge runs/shard-0 runs/shard-1 --against runs/before --out runs/test --json")]
pub struct Args {
    /// Folders of the shards, in any order.
    #[arg(required = true, value_name = "DIR")]
    shards: Vec<PathBuf>,
    /// Folder for the joined results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder of earlier results of the same version of the game: tell what has changed since.
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    /// Replace results that are there.
    #[arg(long)]
    force: bool,
    /// Print one line of JSON per level instead of a table.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    if !args.force && args.out.join(RESULTS).exists() {
        return Err(CliError::Usage(format!(
            "{} has results already: choose another --out, or replace them with --force",
            args.out.display()
        )));
    }
    let game = match args.shards.first() {
        // Without the game there are no pictures, and all else is the same.
        Some(shard) => games.get(&ResultLines::open(shard)?.record().game).ok(),
        None => None,
    };
    let results = Results { folder: &args.out, against: args.against.as_deref(), game, json: args.json };
    results.check_folders()?;
    merge(&args.shards, &args.out)?;
    tell_results(&results)
}
