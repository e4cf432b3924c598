//! A policy that a game ships with: one self-describing file.

mod card;
mod examples;
mod header;
mod policy_file;

pub use card::PolicyCard;
pub use policy_file::PolicyFile;
