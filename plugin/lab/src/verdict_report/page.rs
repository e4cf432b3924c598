//! The whole page.

use super::{
    compared::compared, level_table::level_table, numbers::numbers, plans::Plans, selection::Selection, words::text,
};
use crate::verdict::{Comparison, Overview};

/// Style of all reports.
const PAGE_STYLE: &str = include_str!("../report/page.css");
/// Additional style of this report.
pub const STYLE: &str = include_str!("levels.css");
/// Script that sorts and filters the table of levels.
const SCRIPT: &str = include_str!("levels.js");

/// Content of the page.
pub struct Page<'a> {
    /// Numbers of all levels.
    pub overview: &'a Overview,
    /// Changes, if there are earlier results.
    pub comparison: Option<&'a Comparison>,
    /// The levels of the table.
    pub selection: &'a Selection,
    /// Their floor plans.
    pub plans: &'a Plans<'a>,
    /// Name of the program in commands.
    pub program: &'a str,
}

impl Page<'_> {
    /// Returns the HTML file.
    pub fn to_html(&self) -> String {
        let record = &self.overview.record;
        let title = text(&format!("{} {}", record.game, record.range));
        let shard = record.shard.map_or_else(String::new, |shard| format!(", shard {shard}"));
        let subtitle = format!(
            "Version {} of the game{shard}, {} of each tester on each level, seed {}",
            record.game_version,
            if record.episodes == 1 { "1 episode".to_owned() } else { format!("{} episodes", record.episodes) },
            record.seed
        );
        let body = numbers(self.overview)
            + &self.comparison.map_or_else(String::new, compared)
            + &level_table(record, self.selection, self.plans, self.program);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
             script-src 'unsafe-inline'; img-src data:\">\n\
             <title>{title}</title>\n<style>\n{PAGE_STYLE}{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n\
             <h1>{title}</h1>\n<p class=\"subtitle\">{subtitle}</p>\n</header>\n{body}</main>\n\
             <script>\n{SCRIPT}</script>\n</body>\n</html>\n"
        )
    }
}
