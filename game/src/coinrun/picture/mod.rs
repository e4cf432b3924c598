//! The look of CoinRun: Procgen's picture, with drawings of our own.
//!
//! Each arena becomes a [`Stage`](bevy_playbot::vision::Stage) with a backdrop, its tiles and a sprite for every
//! inhabitant, in the arena's own coordinates: one unit is one tile. Nothing here changes the game. The picture follows
//! from the episode alone: animations count its ticks, and enemies leave puffs behind.

mod animate;
mod art;
mod plugin;
mod puffs;
mod scenery;
mod sprites;
mod trail;
mod view;

pub use art::{Art, Pose};
pub use plugin::CoinRunPicturePlugin;
pub use view::VIEW;
