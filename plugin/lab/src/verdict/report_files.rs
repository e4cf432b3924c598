//! Reports of results for people and other programs.

use std::path::Path;

use super::{
    compare::Comparison,
    error::{TestError, io_error},
    junit::junit,
    overview::Overview,
    summary::summary,
};

/// Name of the file with JUnit XML.
pub const JUNIT: &str = "junit.xml";
/// Name of the file with a short summary, in Markdown.
pub const SUMMARY: &str = "summary.md";
/// Name of the file with the comparison, in JSON.
pub const AGAINST: &str = "against.json";

/// Writes `junit.xml`, `summary.md` and, with a comparison, `against.json` beside the results in a folder.
///
/// `program` is the name of the program in the commands that they show. [`verdict_report`](crate::verdict_report)
/// makes `report.html`, whose pictures need the game.
///
/// # Errors
///
/// The folder has no results, they are damaged, or the files cannot be written.
pub fn write_reports(folder: &Path, comparison: Option<&Comparison>, program: &str) -> Result<Overview, TestError> {
    let overview = Overview::read(folder)?;
    write(&folder.join(JUNIT), &junit(folder, program)?)?;
    write(&folder.join(SUMMARY), &summary(&overview, comparison, program))?;
    if let Some(comparison) = comparison {
        let path = folder.join(AGAINST);
        let text = serde_json::to_string(comparison).map_err(|error| io_error("write", &path)(error.into()))?;
        write(&path, &format!("{text}\n"))?;
    }
    Ok(overview)
}

fn write(path: &Path, text: &str) -> Result<(), TestError> {
    playbot_learner::write_atomically(path, text.as_bytes()).map_err(io_error("write", path))
}
