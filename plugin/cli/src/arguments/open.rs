//! Opening of files that the command line names, with advice for missing ones.

use crate::{
    arguments::experiment::{ExperimentArgs, quoted},
    error::CliError,
};
use bevy_playbot::demo::file::{DemoFault, DemoFileError};
use playbot_harness::sealed_file::file_checksum;
use playbot_learner::{DeviceKind, FileError, PolicyFile, SkillModel};
use playbot_report::whole;
use playbot_train::{
    Algorithm, TrainedLearner, checkpoint,
    checkpoint::{Checkpoint, CheckpointChoice},
    run_dir::{MEND, RunDir},
};
use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};

/// Opens a policy file.
///
/// # Errors
///
/// It cannot be read; if there is none, with the command that writes one.
pub(crate) fn policy(path: &Path, device: DeviceKind) -> Result<PolicyFile, CliError> {
    PolicyFile::load(path, device).map_err(|error| {
        if !is_missing(&error) {
            return error.into();
        }
        let command = format!("`playbot policy export --run RUN --out {}`", shown(path));
        CliError::Usage(format!("{error}: name a policy file that exists, or write this one with {command}"))
    })
}

/// Opens a skill model.
///
/// # Errors
///
/// It cannot be read; if there is none, with the command that learns one from the experiment `from`.
pub(crate) fn skills(path: &Path, device: DeviceKind, from: &ExperimentArgs) -> Result<SkillModel, CliError> {
    SkillModel::load(path, device).map_err(|error| {
        if !is_missing(&error) {
            return error.into();
        }
        let command = format!("`playbot learn-skills{} --out {}`", from.words(), shown(path));
        CliError::Usage(format!("{error}: name a skill model that exists, or learn this one with {command}"))
    })
}

fn is_missing(error: &FileError) -> bool {
    matches!(error, FileError::Io { source, .. } if source.kind() == ErrorKind::NotFound)
}

/// Opens a checkpoint of a run. Reports which one is the best, and why.
///
/// # Errors
///
/// There is none. For behaviour cloning, which trains nothing, the error names the skill model to use instead.
pub(crate) fn checkpoint(run: &RunDir, algorithm: Algorithm, choice: CheckpointChoice) -> Result<Checkpoint, CliError> {
    if !algorithm.has_checkpoints() {
        return Err(untrained(run.path(), algorithm));
    }
    let checkpoint = run.checkpoint(choice)?;
    if choice == CheckpointChoice::Best {
        report!("{}", best(run.path(), &checkpoint));
    }
    Ok(checkpoint)
}

/// Returns the error of a run without training, with advice.
pub(crate) fn untrained(run: &Path, algorithm: Algorithm) -> CliError {
    let skills = shown(&skills_beside(run));
    CliError::Usage(format!(
        "{} is a run of {algorithm}, which trains nothing and has no checkpoint: its skill model plays; measure that with \
         `playbot eval --skills {skills}`, or make a policy of it, `playbot policy export --skills {skills} --out clone.policy`",
        run.display()
    ))
}

/// Returns the skill model of a run, if it lies in the same folder as the run, as in a study. Else returns an example
/// of a name.
fn skills_beside(run: &Path) -> PathBuf {
    let wanted = RunDir::open(run).ok().and_then(|opened| opened.info.skills);
    let study = run.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let files = std::fs::read_dir(study).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut models = files.filter(|file| file.extension().is_some_and(|ending| ending == "safetensors"));
    let own = models.find(|file| wanted.is_some() && file_checksum(file).ok() == wanted);
    own.unwrap_or_else(|| "skills.safetensors".into())
}

/// Loads the learner of a run at a checkpoint.
///
/// # Errors
///
/// It cannot be read: if it is damaged, with the checkpoints to use instead.
pub(crate) fn learner(
    run: &RunDir,
    algorithm: Algorithm,
    checkpoint: &Checkpoint,
    device: DeviceKind,
) -> Result<TrainedLearner, CliError> {
    TrainedLearner::load(algorithm, &checkpoint.learner_file(), device).map_err(|error| match error {
        FileError::CutOff { .. } | FileError::Damaged { .. } | FileError::Foreign { .. } => {
            CliError::Usage(format!("{error}; {}", in_its_place(run.path(), checkpoint.summary.step)))
        }
        error => error.into(),
    })
}

/// Returns the advice for a damaged checkpoint.
fn in_its_place(run: &Path, damaged: u64) -> String {
    let all = checkpoint::list(run).unwrap_or_default();
    let others: Vec<String> = all
        .iter()
        .map(|other| other.summary.step)
        .filter(|step| *step != damaged)
        .map(|step| step.to_string())
        .collect();
    if others.is_empty() {
        return MEND.to_owned();
    }
    format!(
        "bring it back from a copy, or take another with --checkpoint: there are those of the steps {}",
        others.join(", ")
    )
}

fn best(run: &Path, checkpoint: &Checkpoint) -> String {
    let (run, step) = (run.display(), whole(checkpoint.summary.step as f64));
    match checkpoint.summary.episodic_return {
        Some(value) => {
            format!("the best checkpoint of {run} is that of step {step}, with a return of {value:.2} in training")
        }
        None => format!(
            "warning: no checkpoint of {run} has a return, since each is of fewer than 100 episodes: taking the last, of \
             step {step}"
        ),
    }
}

/// Explains an error of reading a recording; for a missing file, with the command that makes one.
pub(crate) fn missing_recording(error: DemoFileError) -> CliError {
    missing(error, "record GAME --out")
}

/// As [`missing_recording`], for verbs that write another recording: a file in its place is explained, too.
pub(crate) fn missing_or_taken(error: DemoFileError) -> CliError {
    match error.fault {
        DemoFault::Exists => CliError::Usage(format!("{error}: name another --out, or remove that file first")),
        _ => missing_recording(error),
    }
}

/// As [`missing_recording`], for recordings of people, which only `playbot play` makes.
pub(crate) fn missing_recording_of_people(error: DemoFileError) -> CliError {
    missing(error, "play GAME --record")
}

fn missing(error: DemoFileError, verb: &str) -> CliError {
    let is_missing = match &error.fault {
        DemoFault::NoDemos => true,
        DemoFault::Io { source, .. } => source.kind() == ErrorKind::NotFound,
        _ => false,
    };
    if !is_missing {
        return error.into();
    }
    let file: PathBuf = match error.path.extension().and_then(|ending| ending.to_str()) {
        Some("demo") => error.path.clone(),
        // A file that is not a recording.
        Some(_) if !error.path.is_dir() => {
            return CliError::Usage(format!("{error}; name recordings that exist, which end in .demo"));
        }
        _ => error.path.join("my.demo"),
    };
    let command = format!("`playbot {verb} {}`", shown(&file));
    CliError::Usage(format!("{error}; name recordings that exist, or make one with {command}"))
}

fn shown(path: &Path) -> String {
    quoted(&path.display().to_string())
}

#[cfg(test)]
mod tests {
    use bevy_playbot::{demo::file::DemoReader, engine::find_demos};
    use playbot_train::checkpoint::CheckpointSummary;

    use super::*;

    /// Checks that an error names the path, and the command that makes the missing file.
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
        let from = ExperimentArgs::of_game("runner");
        let error = skills(&path, DeviceKind::default(), &from).map(|_| ()).expect_err("none");
        names(&error, &path, "`playbot learn-skills runner --out ");
        let file = folder.path().join("none.demo");
        let error = missing_recording(DemoReader::open(&file).map(|_| ()).expect_err("none"));
        names(&error, &file, "none.demo`");
        let error = missing_recording_of_people(DemoReader::open(&file).map(|_| ()).expect_err("none"));
        names(&error, &file, "`playbot play GAME --record ");
        let error = missing_recording(find_demos(folder.path()).expect_err("none"));
        names(&error, folder.path(), "my.demo`");
        let file = folder.path().join("README.md");
        let words = missing_recording(DemoReader::open(&file).map(|_| ()).expect_err("none")).to_string();
        assert!(
            words.contains("README.md: ") && words.contains("end in .demo") && !words.contains("record GAME"),
            "{words}"
        );
    }

    #[test]
    fn it_is_said_which_checkpoint_is_the_best() {
        let checkpoint = |episodic_return| {
            let summary = CheckpointSummary { step: 81_920, episodic_return, ..CheckpointSummary::default() };
            Checkpoint { path: "runs/a/checkpoints/step-000000081920".into(), summary }
        };
        let words = "the best checkpoint of runs/a is that of step 81,920, with a return of 5.25 in training";
        assert_eq!(best(Path::new("runs/a"), &checkpoint(Some(5.25))), words);
        let words = best(Path::new("runs/a"), &checkpoint(None));
        assert!(
            words.starts_with("warning: no checkpoint of runs/a has a return") && words.ends_with("step 81,920"),
            "{words}"
        );
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
