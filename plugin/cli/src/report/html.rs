//! `playbot report html`.

use std::path::PathBuf;

use playbot_lab::{
    games::Games,
    verdict::{Comparison, ResultLines, results_folder},
    verdict_report::{HtmlReport, REPORT, write_html},
};

use crate::{
    error::{CliError, Outcome},
    output, program, unwritten,
};

/// Write the page of results again: one file that opens without network, with a table of the levels to sort and filter,
/// and pictures of the worst of them.
///
/// `playbot test` and `playbot report merge` write it too. Pictures need the game, in the version that was tested.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot report html runs/test
  playbot report html runs/test --against runs/before --out levels.html")]
pub struct Args {
    /// Folder of the results.
    #[arg(value_name = "DIR")]
    results: PathBuf,
    /// Folder of earlier results of the same version of the game, to report changes.
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    /// File to write (default: report.html in the folder of the results).
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    let folder = results_folder(&args.results);
    let lines = ResultLines::open(folder)?;
    let file = args.out.clone().unwrap_or_else(|| folder.join(REPORT));
    output::prepare(&file)?;
    let before = args.against.as_deref().map(results_folder);
    let comparison = before.map(|before| Comparison::read(before, folder)).transpose()?;
    let game = games.get(&lines.record().game).ok();
    let report = HtmlReport { game, comparison: comparison.as_ref(), program: program::name() };
    write_html(folder, &file, &report).map_err(|error| {
        unwritten::told(error, "the results are unchanged: make room or rights there, or name another file with --out")
    })?;
    tell!("{}", file.display());
    Ok(Outcome::Pass)
}
