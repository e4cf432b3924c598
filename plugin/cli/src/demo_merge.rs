//! `playbot demo merge`: joins recordings of many testers into one.

use std::path::{Path, PathBuf};

use bevy_playbot::demo::file::merge_demos;
use serde_json::json;

use super::{
    error::{CliError, Outcome, print_line},
    number::counted,
    open,
    output::prepare,
};

/// Writes the episodes of all files into a new one, and reports them. A recording without a single episode is a
/// finding.
///
/// # Errors
///
/// They are of different games or rules, one is damaged, or there is a file at `out` already. Nothing is left at `out`
/// then.
pub fn merge(files: &[PathBuf], out: &Path, as_json: bool) -> Result<Outcome, CliError> {
    prepare(out)?;
    let report = merge_demos(files, out).map_err(open::missing_or_taken)?;
    if as_json {
        let parts: Vec<_> =
            report.files.iter().map(|(file, episodes)| json!({ "file": file, "episodes": episodes })).collect();
        print_line(json!({
            "file": out, "header": report.header, "episodes": report.episodes(), "steps": report.steps, "files": parts,
        }))?;
    } else {
        for (file, episodes) in &report.files {
            print_line(format!("{}: {}", file.display(), counted(*episodes as u64, "episode")))?;
        }
        print_line(format!(
            "{}: {} {}, {} with {} from {}, by {}",
            out.display(),
            report.header.game,
            report.header.mode,
            counted(report.episodes() as u64, "episode"),
            counted(report.steps as u64, "step"),
            counted(report.files.len() as u64, "recording"),
            report.header.demonstrator,
        ))?;
    }
    Ok(if report.episodes() == 0 { Outcome::Findings } else { Outcome::Pass })
}
