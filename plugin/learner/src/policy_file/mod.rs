//! Policies that a game ships with, each in one self-describing file.

mod card;
mod examples;
mod file;
mod header;

pub use card::PolicyCard;
pub use file::PolicyFile;
