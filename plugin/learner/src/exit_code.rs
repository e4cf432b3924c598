//! Exit codes of errors.

use std::{error::Error, io};

/// An error that knows the exit code of a program that ends with it. Implemented beside each error.
///
/// ```
/// use playbot_learner::{HasExitCode, LearnError};
///
/// let error = LearnError::Config("lr is 0".to_owned());
/// assert_eq!(error.exit_code(), 3);
/// let error = LearnError::Exploded { tensor: "loss".to_owned(), value: 1e30, steps: 7 };
/// assert_eq!((error.exit_code(), error.is_usage()), (2, false));
/// ```
pub trait HasExitCode: Error {
    /// Returns 3 if another call can succeed, 2 if the program, the game or the system failed.
    fn exit_code(&self) -> u8 {
        3
    }

    /// Returns whether another call can succeed.
    fn is_usage(&self) -> bool {
        self.exit_code() == 3
    }
}

/// Returns the exit code of a system's error about a file. A missing file, or a folder in place of one, is the
/// caller's error; a failing disk is not.
pub fn io_exit_code(error: &io::Error) -> u8 {
    use io::ErrorKind::{IsADirectory, NotADirectory, NotFound};
    if matches!(error.kind(), NotFound | IsADirectory | NotADirectory) { 3 } else { 2 }
}
