//! A proof that the coin cannot be reached: a search through all that the rules allow, and a little more.
//!
//! Heights and vertical speeds are followed exactly, by the rules' own arithmetic, or, where too many are possible, within
//! limits. Places along x are bins, of which a state holds any number at once; within a step the player may go to every bin
//! that full speed reaches. So no way is missed, and the search ends: if it has not met the coin by then, nobody will.

mod bins;
mod fill;
mod ground;
mod loose;
mod state;
mod step;
mod vertical;

pub use fill::coin_is_unreachable;
