//! Drawings written to files.

mod painter;
mod plot_file;

pub use plot_file::PlotFile;
