//! Observations: their kinds, batches in host memory, metadata of pictures, and augmentations.

mod augmentation;
mod batch;
mod kind;
mod picture;

pub use augmentation::Augmentation;
pub(crate) use augmentation::augmented;
pub use batch::{ObsSlice, Observations};
pub use kind::{ImageShape, ObsKind};
pub use picture::PictureCard;
