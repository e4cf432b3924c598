//! A whole file of each kind, and its reader.

mod all;
mod drawn;
mod learned;
mod recorded;
mod scored;
mod tested;
mod trained;

pub use all::all_kinds;
