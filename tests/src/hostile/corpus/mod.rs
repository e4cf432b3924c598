//! A whole file of each kind, and how it is read.

mod all;
mod drawn;
mod learned;
mod recorded;
mod scored;
mod tested;
mod trained;

pub use all::all_kinds;
