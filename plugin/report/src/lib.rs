//! Statistics, tables, charts and pages, for reports of training and of tests.
//!
//! Everything here is a function of its input: the same data give the same bytes. The modules, in reading order:
//!
//! - [`number`]: numbers for people.
//! - [`ResultTable`]: [`ResultRow`]s of methods, rounded by their errors.
//! - [`statistics`]: intervals by bootstrap, interquartile means, [`PairedDifference`]s, Holm's correction.
//! - [`ratings`]: Elo ratings of players from the results of their matches.
//! - [`text_table`]: tables on a console. A [`PlainTable`] holds any text.
//! - [`chart`]: the data of line charts. [`to_svg`] draws [`Chart`]s, [`sparkline`] a curve in one line of text.
//! - [`Report`]: text, tables and charts in one HTML file that loads nothing: no scripts, no fonts, no network. It
//!   follows the reader's light or dark setting and prints.
//! - [`mod@escape`]: text that is safe in HTML, in SVG and on a terminal, and [`base64()`] for pictures as text.
//!
//! ```
//! use playbot_report::{percent, sparkline, statistics::median};
//!
//! let solved = vec![0.25, 0.5, 1.0];
//! println!("{}", sparkline(&solved, 3));
//! assert_eq!(median(solved).map(percent).as_deref(), Some("50.0 %"));
//! ```

pub mod chart;
mod document;
pub mod escape;
pub mod number;
pub mod ratings;
mod results;
pub mod statistics;
mod svg;
mod table;
#[cfg(test)]
mod tests;
pub mod text_table;

pub use crate::{
    chart::{Chart, Curve, sparkline},
    document::{Report, ReportError, Section, markdown_cell, markdown_row},
    escape::base64,
    number::{counted, percent, readable, readable_with_spread, ticks, times, whole},
    results::{ResultRow, ResultTable},
    statistics::PairedDifference,
    svg::to_svg,
    table::{PlainTable, Table},
    text_table::to_text_table,
};

pub use crate::document::PAGE_STYLE;
