//! `playbot bugs table`.

use std::path::PathBuf;

use playbot_lab::bugs::score::{Score, ScoreTable};

use super::score::as_json;
use crate::{
    error::{CliError, Outcome, print_line},
    output,
};

/// Join scores of different games or sets, and print them as a page of Markdown.
///
/// Scores with different budgets, or with the same mutants or unmutated levels, are not joined.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bugs table runs/score.json
  playbot bugs table runs/score.json runs/other.json --out table.md
  playbot bugs table runs/score.json --json")]
pub struct Args {
    /// Scores, as written by `playbot bugs score`.
    #[arg(value_name = "SCORE", required = true)]
    scores: Vec<PathBuf>,
    /// File for the page, instead of standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// One line of JSON instead of Markdown.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<Outcome, CliError> {
    let mut scores = Vec::new();
    for path in args.scores {
        let score = Score::read(&path)?;
        scores.push((path, score));
    }
    let table = ScoreTable::join(&scores)?;
    let text = if args.json { as_json(&table)? } else { table.to_markdown() };
    match &args.out {
        Some(path) => {
            output::write(path, format!("{}\n", text.trim_end()).as_bytes())?;
            tell!("table: {}", path.display());
        }
        None => print_line(text.trim_end())?,
    }
    Ok(Outcome::Pass)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_no_score_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("score.json");
        std::fs::write(&path, "{}").expect("writable");
        let args = Args { scores: vec![path], out: None, json: false };
        let error = run(args).map(drop).expect_err("no score");
        assert!(error.to_string().contains("score.json: line 1: "), "{error}");
        assert_eq!(error.exit_code(), 3);
    }
}
