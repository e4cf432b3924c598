//! What agents observe: the kinds of observations, many of them in host memory, and how pictures are made.

mod batch;
mod kind;
mod picture;

pub use batch::{ObsSlice, Observations};
pub use kind::{ImageShape, ObsKind};
pub use picture::PictureCard;
