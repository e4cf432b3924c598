//! `playbot report merge`.

use std::{fs, path::PathBuf};

use playbot_lab::{
    games::Games,
    verdict::{Comparison, RESULTS, ResultLines, TestRecord, merge, results_folder},
};

use crate::{
    error::{CliError, Outcome},
    test::{Results, tell_results},
    unwritten,
};

/// Join the results of all shards of a test into the same bytes as those of the whole test.
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
    /// Folder of earlier results of the same version of the game, to report changes.
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    /// Replace existing results.
    #[arg(long)]
    force: bool,
    /// Print one line of JSON per level instead of a table.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    let shards: Vec<PathBuf> = args.shards.iter().map(|shard| results_folder(shard).to_owned()).collect();
    check_out(args, &shards)?;
    let Some(first) = shards.first() else {
        return Err(CliError::Usage("name the folders of the shards".to_owned()));
    };
    let record = TestRecord { shard: None, ..ResultLines::open_whole(first)?.record().clone() };
    // Without the game there are no pictures, and all else is the same.
    let game = games.get(&record.game).ok();
    let against = args.against.as_deref().map(results_folder);
    let results = Results { folder: &args.out, against, game, json: args.json };
    results.check_folders()?;
    // Nothing is written if the comparison fails.
    if let Some(before) = results.against {
        Comparison::check(before, &record)?;
    }
    merge(&shards, &args.out).map_err(|error| {
        unwritten::told(error, "the shards are unchanged: make room or rights there and call this again")
    })?;
    tell_results(&results)
}

/// Checks that the joined results do not replace needed files.
fn check_out(args: &Args, shards: &[PathBuf]) -> Result<(), CliError> {
    let out = args.out.display();
    if args.out.is_file() {
        return Err(CliError::Usage(format!("{out} is a file: name a folder to write into")));
    }
    // A missing path is no folder of a shard.
    if let Ok(folder) = fs::canonicalize(&args.out)
        && shards.iter().any(|shard| fs::canonicalize(shard).is_ok_and(|shard| shard == folder))
    {
        return Err(CliError::Usage(format!("--out {out} is the folder of a shard: choose another --out")));
    }
    if !args.force && args.out.join(RESULTS).exists() {
        return Err(CliError::Usage(format!(
            "{out} has results already: choose another --out, or replace them with --force"
        )));
    }
    Ok(())
}
