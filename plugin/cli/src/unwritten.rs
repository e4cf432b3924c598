//! Advice for results that cannot be written.

use playbot_lab::verdict::TestError;

use crate::error::CliError;

/// Adds advice, and the list of whole files, to an error of writing; other errors have their own.
pub fn told(error: TestError, next: &str) -> CliError {
    match error {
        TestError::Io { action, path, source } if action != "read" => {
            CliError::Io(format!("cannot {action} {}: {source}; {next}", path.display()))
        }
        error => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    #[test]
    fn a_full_disk_says_what_to_do_and_wrong_usage_stays_that() {
        let refused = |action, kind: io::ErrorKind| {
            let source = io::Error::from(kind);
            TestError::Io { action, path: "a/report.html".into(), source }
        };
        let words = told(refused("write", io::ErrorKind::StorageFull), "make room").to_string();
        assert!(words.starts_with("cannot write a/report.html: ") && words.ends_with("; make room"), "{words}");
        assert_eq!(words.matches("; ").count(), 1, "one next step is enough: {words}");
        let words = told(refused("read", io::ErrorKind::PermissionDenied), "make room").to_string();
        assert!(!words.ends_with("; make room"), "nothing is known to be whole: {words}");
        assert_eq!(told(TestError::NoTester, "make room").exit_code(), 3);
    }
}
