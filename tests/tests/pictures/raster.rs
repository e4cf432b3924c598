//! Tests of exact pixels of a raster sensor.

mod eye;
mod faults;
mod pixels;
mod sprites;
mod stages;
