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

mod axis;
pub mod bootstrap;
mod chart;
mod document;
mod line;
mod mark;
mod markdown;
mod number;
mod paired;
mod plain_text;
mod result;
mod scatter;
mod sparkline;
pub mod statistics;
mod study;
mod study_comparison;
mod study_conditions;
mod study_table;
mod svg;
mod table;
#[cfg(test)]
mod tests;
mod text_table;
mod text_width;
mod trails;

pub use chart::{Chart, Curve};
pub use document::{Report, ReportError, Section};
pub(crate) use markdown::{markdown_cell, markdown_row};
pub use number::{percent, readable, readable_with_spread, ticks, times, whole};
pub use paired::PairedDifference;
pub use result::{ResultRow, ResultTable};
pub use scatter::draw_scatters;
pub use sparkline::sparkline;
pub use study::{LearningCurves, StudyReport, StudyResult, TestResult, TrainingResult};
pub use study_table::markdown_table;
pub use svg::to_svg;
pub use table::{PlainTable, Table};
pub use text_table::to_text_table;
pub use trails::{CellChart, Floor, TrailChart, Visits, Walker};
