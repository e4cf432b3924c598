//! Where agents went: their trajectories on the floor plan, and how often each place was visited.

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
