//! For tests: programs as people start them, from a shell and on a display of their own. Knows nothing of Bevy or of the
//! plugin, only what a user sees: words, numbers, exit codes, files and windows.

mod desk;
mod examined;
mod game_program;
mod played;
mod recorded;
mod shell;
mod trained;

pub use desk::{Desk, Seat};
pub use game_program::GameProgram;
pub use shell::Shell;
