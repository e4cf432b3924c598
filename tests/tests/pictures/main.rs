//! Pictures that agents see, of cameras and rasters, and learning from them.

mod camera;
mod pixels;
mod raster;
mod raster_camera;
