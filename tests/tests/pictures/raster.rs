//! Tests of exact pixels of a raster sensor.

mod faults;
mod pixels;
mod sprites;
mod stages;
mod viewer;
