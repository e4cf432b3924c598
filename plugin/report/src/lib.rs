//! Reports: results as a table on the console, curves as SVG, and both in one HTML file.
//!
//! - [`Chart`] draws [`Curve`]s as SVG, [`to_svg`] several charts in one file, [`sparkline`] a curve as text.
//! - [`draw_scatters`] draws the dots of charts as a [`Drawing`](crate::drawing::Drawing).
//! - [`ResultTable`] compares [`ResultRow`]s, on the console with [`to_text_table`]; a [`PlainTable`] holds any text.
//! - [`StudyReport`] compares the variants of a study, as Markdown, chart and JSON.
//! - [`CellChart`] draws which cells of a level an explorer has reached.
//! - [`TrailChart`] draws the paths of agents on a [`FloorPlan`](crate::floor_plan::FloorPlan), as a
//!   [`Drawing`](crate::drawing::Drawing).
//! - [`PairedDifference`] compares two methods on the same levels and with the same seeds.
//! - [`bootstrap`] gives intervals for few runs, [`statistics`] compares runs that differ in their seed.
//! - [`Report`] puts them together with text into a file that needs nothing else: no scripts, no fonts,
//!   no network. It follows the reader's light or dark setting and prints.
//!
//! Everything here is a function of its input: the same data give the same bytes.

pub mod chart;
mod document;
pub mod escape;
pub mod number;
pub mod sparkline;
pub mod statistics;
mod svg;
mod table;
#[cfg(test)]
mod tests;
pub mod text_table;

pub use crate::{
    chart::{Chart, Curve},
    document::{Report, ReportError, Section, markdown_cell, markdown_row},
    number::{ResultRow, ResultTable, percent, readable, readable_with_spread, ticks, times, whole},
    sparkline::sparkline,
    statistics::PairedDifference,
    svg::to_svg,
    table::{PlainTable, Table},
    text_table::to_text_table,
};

pub use crate::document::PAGE_STYLE;
