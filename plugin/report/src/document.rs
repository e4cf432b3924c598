//! Reports as a single HTML file.

use crate::{
    chart::Chart,
    escape::{escape, steers, with_code_spans},
    svg::{draw, page_style},
    table::Table,
};
use std::{
    fmt::Write as _,
    io,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// The style sheet of pages.
pub const PAGE_STYLE: &str = include_str!("page.css");

/// Number of sections beyond which a report begins with a list of them.
const SHORT: usize = 3;

/// A part of a report, shown in this order: heading, text, tables, charts, code.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// Paragraphs, separated by empty lines; text between backticks is set as code.
    pub text: String,
    /// Line charts.
    pub charts: Vec<Chart>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Blocks of code, configuration or console output, as they are.
    pub code: Vec<String>,
}

/// A report: one HTML file without scripts and without anything to load, for screens and for paper.
///
/// ```
/// use playbot_report::{Report, Section};
///
/// let report = Report {
///     title: "CoinRun, easy".into(),
///     subtitle: "500 held-out levels".into(),
///     sections: vec![Section {
///         heading: "How to run it again".into(),
///         code: vec!["playbot eval coinrun --levels 500".into()],
///         ..Default::default()
///     }],
/// };
/// assert!(report.to_html().contains("<h1>CoinRun, easy</h1>"));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The title.
    pub title: String,
    /// Subject, date and conditions, in one line.
    pub subtitle: String,
    /// The parts.
    pub sections: Vec<Section>,
}

/// Failure to write a report.
#[derive(Debug, Error)]
#[error("cannot write the report {}: {source}", path.display())]
pub struct ReportError {
    /// The file.
    pub path: PathBuf,
    /// The answer of the operating system.
    pub source: io::Error,
}

impl Report {
    /// Returns the whole HTML file.
    pub fn to_html(&self) -> String {
        let mut body = format!("<header>\n<h1>{}</h1>\n", escape(&self.title));
        if !self.subtitle.is_empty() {
            let _ = writeln!(body, "<p class=\"subtitle\">{}</p>", with_code_spans(&self.subtitle));
        }
        body += "</header>\n";
        if self.sections.len() > SHORT {
            body += "<nav><ul>\n";
            for (i, section) in self.sections.iter().enumerate() {
                let _ = writeln!(body, "<li><a href=\"#s{}\">{}</a></li>", i + 1, escape(&section.heading));
            }
            body += "</ul></nav>\n";
        }
        for (i, section) in self.sections.iter().enumerate() {
            let _ = write!(body, "<section id=\"s{}\">\n{}</section>\n", i + 1, section.to_html());
        }
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
             <title>{}</title>\n<style>\n{PAGE_STYLE}{}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n",
            escape(&self.title),
            page_style(),
        )
    }

    /// Writes the report under a temporary name and renames it: a reader sees the old report or the new
    /// one, never half of it. A report that exists is replaced.
    ///
    /// # Errors
    ///
    /// [`ReportError`] when the folder does not exist or cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), ReportError> {
        let path = path.as_ref();
        playbot_learner::write_atomically(path, self.to_html().as_bytes())
            .map_err(|source| ReportError { path: path.to_owned(), source })
    }
}

impl Section {
    fn to_html(&self) -> String {
        let mut out = String::new();
        if !self.heading.is_empty() {
            let _ = writeln!(out, "<h2>{}</h2>", escape(&self.heading));
        }
        for paragraph in self.text.split("\n\n").map(str::trim).filter(|p| !p.is_empty()) {
            let _ = writeln!(out, "<p>{}</p>", with_code_spans(paragraph));
        }
        for table in &self.tables {
            out += &table.to_html();
        }
        for chart in &self.charts {
            let _ = writeln!(out, "<figure>\n{}</figure>", draw(chart));
        }
        for code in &self.code {
            let _ = writeln!(out, "<pre><code>{}</code></pre>", escape(code.trim_end()));
        }
        out
    }
}

/// Escapes text, which then neither ends a cell of a table nor begins anything in Markdown.
pub fn markdown_cell(text: &str) -> String {
    let mut out = String::new();
    for letter in text.chars() {
        match letter {
            '|' | '*' | '_' | '<' | '[' | '`' | '\\' | '#' => out.extend(['\\', letter]),
            letter if steers(letter) => out.push(' '),
            letter => out.push(letter),
        }
    }
    out
}

/// Returns the cells of a row, joined.
pub fn markdown_row(cells: &[String]) -> String {
    let cells: Vec<String> = cells.iter().map(|text| markdown_cell(text)).collect();
    format!("| {} |", cells.join(" | "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_ends_its_cell_or_begins_anything() {
        let cells = ["a|b", "*c*\n<d>", "e\u{202e}f"].map(str::to_owned);
        assert_eq!(markdown_row(&cells), r"| a\|b | \*c\* \<d> | e f |");
    }
}
