//! Results of a test as one HTML file: every level in a table with sorting and filtering, and pictures of the worst
//! levels.
//!
//! [`write_html`] makes `report.html` of the results in a folder. The file loads no network resources and no fonts,
//! and without its few lines of script it is a plain table. It follows the reader's light or dark setting.
//!
//! The page is a function of the results, of the results compared with, and of the game, which draws the pictures.
//! The results of a whole range and those joined from shards give the same bytes.

mod base64;
mod canvas;
mod clip;
mod compared;
mod details;
mod drawn;
mod heat;
mod level_row;
mod level_table;
mod map_legend;
mod numbers;
mod page;
mod picture;
mod plans;
mod selection;
mod shapes;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod walks;
mod words;
mod write;

pub use write::{HtmlReport, REPORT, html, write_html};
