//! Power cuts at every place where something is written: what lies on the disk then is opened and gone on with.

mod levels;
mod recordings;
mod replaced;
mod runs;
