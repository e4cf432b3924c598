//! A proof that the coin cannot be reached: a search over a little more than the rules allow.
//!
//! Heights and vertical speeds are followed exactly, by the rules' own arithmetic, or, where too many are possible,
//! within limits. Positions along x are bins, of which a state holds any number at once. Within a step the player may
//! go to every bin that full speed reaches. So no path is missed, and the search ends: if it has not met the coin by
//! then, no player will.

mod bins;
mod fill;
mod ground;
mod loose;
mod state;
mod step;
mod vertical;

pub use fill::coin_is_unreachable;
