//! Opening what the command line names, with what to do where it is not there.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};

use bevy_playbot::demo::file::{DemoFault, DemoFileError};
use playbot_lab::{
    game::Game,
    games::{Artifact, Games},
    train::Experiment,
};
use playbot_learner::{DeviceKind, FileError, PolicyFile};

use super::{
    error::CliError,
    experiment::{ExperimentArgs, quoted},
};

/// A policy file.
///
/// # Errors
///
/// It cannot be read; if there is none, with the command that writes one.
pub fn policy(path: &Path, device: DeviceKind) -> Result<PolicyFile, CliError> {
    PolicyFile::load(path, device).map_err(|error| {
        let is_missing = matches!(&error, FileError::Io { source, .. } if source.kind() == ErrorKind::NotFound);
        if !is_missing {
            return error.into();
        }
        let command = format!("`playbot policy export --run RUN --out {}`", shown(path));
        CliError::Usage(format!("{error}: name a policy file that exists, or write this one with {command}"))
    })
}

/// The game of an experiment that the command line describes.
///
/// # Errors
///
/// This program does not have it: with the file that names it, or the nearest name if the command line does.
pub fn game<'a>(games: &Games<'a>, from: &ExperimentArgs, experiment: &Experiment) -> Result<&'a dyn Game, CliError> {
    let is_set = ExperimentArgs { experiment: None, set: from.set.clone() }.names_game();
    match &from.experiment {
        Some(path) if !is_set => Ok(games.of_file(Artifact::Experiment, path, &experiment.game)?),
        _ => Ok(games.get(&experiment.game)?),
    }
}

/// The error of a recording that could not be read; where there is none, with the command that makes one.
pub fn missing_recording(error: DemoFileError) -> CliError {
    let is_missing = match &error.fault {
        DemoFault::NoDemos => true,
        DemoFault::Io { source, .. } => source.kind() == ErrorKind::NotFound,
        _ => false,
    };
    if !is_missing {
        return error.into();
    }
    let is_file = error.path.extension().is_some_and(|ending| ending == "demo");
    let file: PathBuf = if is_file { error.path.clone() } else { error.path.join("my.demo") };
    let command = format!("`playbot record GAME --out {}`", shown(&file));
    CliError::Usage(format!("{error}; name recordings that exist, or make one with {command}"))
}

fn shown(path: &Path) -> String {
    quoted(&path.display().to_string())
}

#[cfg(test)]
mod tests {
    use bevy_playbot::demo::file::{DemoReader, find_demos};

    use super::*;

    /// Checks that an error names the path, and the command that makes what is missing.
    fn names(error: &CliError, path: &Path, command: &str) {
        let words = error.to_string();
        assert!(words.starts_with(&format!("{}: ", path.display())) || words.contains("cannot read"), "{words}");
        assert!(words.contains(&path.display().to_string()) && words.contains(command), "{words}");
        assert_eq!(error.exit_code(), 3);
    }

    #[test]
    fn what_is_missing_is_named_with_the_command_that_makes_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("none");
        names(
            &policy(&path, DeviceKind::default()).map(|_| ()).expect_err("none"),
            &path,
            "`playbot policy export --run ",
        );
        let file = folder.path().join("none.demo");
        let error = missing_recording(DemoReader::open(&file).map(|_| ()).expect_err("none"));
        names(&error, &file, "none.demo`");
        let error = missing_recording(find_demos(folder.path()).expect_err("none"));
        names(&error, folder.path(), "my.demo`");
    }

    #[test]
    fn what_is_there_and_bad_is_not_to_be_made_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.demo");
        std::fs::write(&path, "no recording").expect("writable");
        let error = missing_recording(DemoReader::open(&path).map(|_| ()).expect_err("damaged"));
        assert!(!error.to_string().contains("playbot record"), "{error}");
        let error = policy(&path, DeviceKind::default()).map(|_| ()).expect_err("damaged");
        assert!(!error.to_string().contains("policy export"), "{error}");
    }
}
