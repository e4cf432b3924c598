//! Programs for tests, started from a shell and on a display of their own. The crate does not depend on Bevy or the
//! plugin. It sees only a user's view: words, numbers, exit codes, files and windows.

mod at_work;
mod desk;
mod every_verb;
mod examined;
mod game_program;
mod model_client;
mod output;
mod played;
mod recorded;
mod run_folder;
mod shell;
mod tests;
mod trained;
mod unsealed;
mod waiting;

pub use at_work::{at_work, kill};
pub use desk::{Desk, Seat};
pub use game_program::GameProgram;
pub use model_client::{ModelClient, from_base64};
pub use output::{code, ended, ended_in, errors, json_lines, lines, said};
pub use run_folder::{logged, results, steps};
pub use shell::Shell;
pub use unsealed::unsealed;
pub use waiting::output;

/// Returns a folder that vanishes with the value.
pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}
