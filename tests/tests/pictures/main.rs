//! Tests of agents' pictures, of cameras and rasters, and of learning from them.

mod camera;
mod pixels;
mod raster;
#[cfg(feature = "screen")]
mod raster_camera;
