//! What to do where results cannot be written.

use playbot_lab::verdict::TestError;

use crate::error::CliError;

/// An error with what is still whole, and what to do, if the system refused; all others say that themselves.
pub fn told(error: TestError, next: &str) -> CliError {
    match error {
        TestError::Io { .. } => CliError::Io(format!("{error}; {next}")),
        error => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    #[test]
    fn a_full_disk_says_what_to_do_and_wrong_usage_stays_that() {
        let source = io::Error::from(io::ErrorKind::StorageFull);
        let full = TestError::Io { action: "write", path: "a/report.html".into(), source };
        let words = told(full, "make room").to_string();
        assert!(words.starts_with("cannot write a/report.html: ") && words.ends_with("; make room"), "{words}");
        assert!(!matches!(told(TestError::NoTester, "make room"), CliError::Io(_)));
    }
}
