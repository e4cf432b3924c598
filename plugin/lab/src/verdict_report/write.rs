//! Writer of the page from the results in a folder.

use std::path::Path;

use super::{page::Page, plans::Plans, selection::Selection};
use crate::{
    game::Game,
    verdict::{Comparison, Overview, TestError},
};

/// Name of the file in the folder of a test.
pub const REPORT: &str = "report.html";

/// Content of a report besides the results.
#[derive(Clone, Copy)]
pub struct HtmlReport<'a> {
    /// The tested game, which draws its levels; without it, the page has no pictures.
    pub game: Option<&'a dyn Game>,
    /// Changes since earlier results.
    pub comparison: Option<&'a Comparison>,
    /// Name of the program in the commands that the report shows.
    pub program: &'a str,
}

/// Makes the report of the results in a folder.
///
/// # Errors
///
/// The folder has no results, or they are damaged.
pub fn html(results: &Path, report: &HtmlReport) -> Result<String, TestError> {
    let overview = Overview::read(results)?;
    let selection = Selection::read(results)?;
    let plans = Plans::of(report.game, &overview.record);
    let page = Page {
        overview: &overview,
        comparison: report.comparison,
        selection: &selection,
        plans: &plans,
        program: report.program,
    };
    Ok(page.to_html())
}

/// Makes the report of the results in a folder, and writes it to a file.
///
/// # Errors
///
/// The folder has no results, they are damaged, or the file cannot be written.
pub fn write_html(results: &Path, file: &Path, report: &HtmlReport) -> Result<(), TestError> {
    let html = html(results, report)?;
    let written = playbot_learner::write_atomically(file, html.as_bytes());
    written.map_err(|source| TestError::Io { action: "write", path: file.to_owned(), source })
}
