//! Charts of where agents went: trajectories on the floor plan, and a map of visits.

mod cells;
mod chart;
mod colours;
mod frame;
mod layout;
mod panel;
mod visits;

pub use cells::CellChart;
pub use chart::{Floor, TrailChart, Walker};
pub use visits::Visits;
