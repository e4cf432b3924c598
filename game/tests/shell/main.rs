//! What the program says to a shell: exit codes, and words about what cannot be done or was not done.

#[path = "../shared/program.rs"]
mod program;
mod recordings;
#[cfg(unix)]
mod stopped;
mod written;
