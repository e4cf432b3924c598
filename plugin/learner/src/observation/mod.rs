//! What agents observe: the kinds of observations, many of them in host memory, how pictures are made, and how they are
//! changed for learning.

mod augmentation;
mod batch;
mod kind;
mod picture;

pub use augmentation::Augmentation;
pub(crate) use augmentation::augmented;
pub use batch::{ObsSlice, Observations};
pub use kind::{ImageShape, ObsKind};
pub use picture::PictureCard;
