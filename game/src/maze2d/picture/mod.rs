//! The look of Maze2D: the whole maze from above, first row at the top, the ball in it and the goal.
//!
//! A maze of any size fills the picture. The ball is drawn larger than it is, to be visible on 64 pixels.

mod art;
mod board;
mod plugin;
mod view;

pub use plugin::Maze2dPicturePlugin;
pub use view::VIEW;
