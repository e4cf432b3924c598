//! The errors of verbs, with their exit codes.

use playbot_learner::HasExitCode;
use std::error::Error;
use thiserror::Error;

/// The end of a command that worked.
pub enum Outcome {
    /// The command found no fault.
    Pass,
    /// The command worked and found something wrong in what it looked at.
    Findings,
    /// It was stopped before it was done.
    Stopped,
}

/// Failure of a command.
#[derive(Debug, Error)]
pub enum CliError {
    /// Wrong usage, in words that say what to do.
    #[error("{0}")]
    Usage(String),
    /// The reader of standard output has gone, which is no error.
    #[error("standard output was closed")]
    BrokenPipe,
    /// The operating system refused.
    #[error("{0}")]
    Io(String),
    /// An error that knows its exit code.
    #[error("{0}")]
    Other(Box<dyn HasExitCode + Send + Sync>),
}

impl CliError {
    /// Returns 3 if the caller can put it right by calling differently, 2 for the rest.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 3,
            Self::BrokenPipe | Self::Io(_) => 2,
            Self::Other(error) => error.exit_code(),
        }
    }

    /// Returns true if it was made from an error of this type.
    pub fn is<E: Error + 'static>(&self) -> bool {
        match self {
            Self::Other(error) => {
                let error: &(dyn Error + 'static) = error.as_ref();
                error.is::<E>()
            }
            _ => false,
        }
    }
}

impl<E: HasExitCode + Send + Sync + 'static> From<E> for CliError {
    fn from(error: E) -> Self {
        Self::Other(Box::new(error))
    }
}

#[cfg(test)]
mod tests {
    use std::{io, path::PathBuf};

    use bevy_playbot::{
        demo::file::{DemoFault, DemoFileError},
        fault::Fault,
        vision::VisionError,
    };
    use playbot_harness::{demo::VerifyError, eval::EvalError, inspect::InspectError, sealed_file::io_error};
    use playbot_learner::{FileError, LearnError};
    use playbot_mutation::bugs::BugError;
    use playbot_test::{findings::FindingError, verdict::TestError};
    use playbot_train::{TrainError, policy_export::ExportError, run_dir::RunError, runs::RunsError};

    use super::*;

    fn refused(kind: io::ErrorKind) -> io::Error {
        io::Error::from(kind)
    }

    fn file(kind: io::ErrorKind) -> FileError {
        FileError::Io { action: "read", path: "a".into(), source: refused(kind) }
    }

    fn demo(fault: DemoFault) -> DemoFileError {
        DemoFileError { path: "a.demo".into(), fault }
    }

    fn exploded() -> LearnError {
        LearnError::Exploded { tensor: "loss".to_owned(), value: 1e30, steps: 1 }
    }

    fn config() -> LearnError {
        LearnError::Config("lr is 0".to_owned())
    }

    fn fault() -> Fault {
        Fault("agent 0: it breaks".to_owned())
    }

    #[test]
    fn what_the_caller_can_mend_is_3_and_the_rest_2() {
        use io::ErrorKind::{IsADirectory, NotADirectory, NotFound, PermissionDenied, StorageFull};
        let path = PathBuf::from("a");
        let (cut, io) =
            (VisionError::NoCamera, |kind| DemoFault::Io { action: "open the file", source: refused(kind) });
        let run_io = |kind| RunError::from(io_error("read", &path)(refused(kind)));
        let errors: [(CliError, u8); 41] = [
            (CliError::Usage("name one".to_owned()), 3),
            (CliError::Io("no room".to_owned()), 2),
            (CliError::BrokenPipe, 2),
            (fault().into(), 2),
            (cut.clone().into(), 3),
            (config().into(), 3),
            (exploded().into(), 2),
            (file(NotFound).into(), 3),
            (file(IsADirectory).into(), 3),
            (file(NotADirectory).into(), 3),
            (file(PermissionDenied).into(), 2),
            (FileError::Damaged { path: path.clone(), advice: "" }.into(), 3),
            (demo(io(NotFound)).into(), 3),
            (demo(io(StorageFull)).into(), 2),
            (demo(DemoFault::Torn).into(), 2),
            (demo(DemoFault::NoDemos).into(), 3),
            (EvalError::Vision(cut.clone()).into(), 3),
            (EvalError::Fault(fault()).into(), 2),
            (InspectError::Usage("name one".to_owned()).into(), 3),
            (InspectError::Fault(fault()).into(), 2),
            (InspectError::Closed.into(), 2),
            (ExportError::Vision(cut.clone()).into(), 3),
            (ExportError::Fault(fault()).into(), 2),
            (ExportError::File(file(NotFound)).into(), 3),
            (ExportError::File(file(StorageFull)).into(), 2),
            (RunError::Exists(path.clone()).into(), 3),
            (run_io(NotFound).into(), 2),
            (RunError::Learner(file(StorageFull)).into(), 2),
            (RunsError::Run(run_io(NotFound)).into(), 2),
            (RunsError::Io { path: path.clone(), source: refused(NotFound) }.into(), 2),
            (RunsError::NoRuns(path.clone()).into(), 3),
            (TrainError::Fault(fault()).into(), 2),
            (TrainError::Learn(config()).into(), 3),
            (RunError::Train(TrainError::Learn(exploded())).into(), 2),
            (VerifyError::File(demo(io(NotFound))).into(), 3),
            (VerifyError::Data(exploded()).into(), 2),
            (TestError::NoTester.into(), 3),
            (TestError::Finding(FindingError::None(path.clone())).into(), 2),
            (FindingError::None(path.clone()).into(), 3),
            (FindingError::File(demo(DemoFault::Torn)).into(), 3),
            (BugError::Inspect(InspectError::Fault(fault())).into(), 3),
        ];
        for (error, code) in errors {
            assert_eq!(error.exit_code(), code, "{error:?}");
        }
    }

    #[test]
    fn the_error_inside_is_known_by_its_type() {
        let error = CliError::from(fault());
        assert!(error.is::<Fault>() && !error.is::<VisionError>());
        assert_eq!(error.to_string(), "agent 0: it breaks");
        assert!(!CliError::Usage("agent 0: it breaks".to_owned()).is::<Fault>());
    }
}
