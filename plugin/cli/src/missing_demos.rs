//! What to do where there are no recordings to learn from.

use std::{io::ErrorKind, path::Path};

use bevy_playbot::demo::file::DemoFault;
use playbot_lab::{demo::verify::VerifyError, game::Game, train::Experiment};

use super::{error::CliError, experiment::quoted};

/// The error of recordings that could not be read; where there are none at a path, with the command that makes them.
pub fn explain(error: VerifyError, game: &dyn Game, experiment: &Experiment, path: &Path) -> CliError {
    if !is_missing(&error) {
        return error.into();
    }
    CliError::Usage(format!("{error}; {}", advice(game, experiment, path)))
}

fn is_missing(error: &VerifyError) -> bool {
    let VerifyError::File(error) = error else { return false };
    match &error.fault {
        DemoFault::NoDemos => true,
        DemoFault::Io { source, .. } => source.kind() == ErrorKind::NotFound,
        _ => false,
    }
}

/// The command that records what can be learned from, on levels that are not held out: those to train on, which the
/// experiment keeps apart from the held-out ones.
fn advice(game: &dyn Game, experiment: &Experiment, path: &Path) -> String {
    let (name, levels) = (game.name(), quoted(&experiment.train.to_string()));
    let file = |name: &str| {
        let is_file = path.extension().is_some_and(|ending| ending == "demo");
        let file = if is_file { path.to_owned() } else { path.join(name) };
        quoted(&file.display().to_string())
    };
    let rule = format!(
        "; those are the training levels, and any others will do as well, but never the held-out ones, {}. The \
         first lines of an experiment file, or of one that it is built on, may say how its own recordings are made",
        experiment.test
    );
    if game.demonstrator().is_some() {
        let file = file("bot.demo");
        format!(
            "record the game's demonstrator with `playbot record {name} --levels {levels} --steps 200000 --out {file}`{rule}"
        )
    } else if game.key_bindings().is_some() {
        let file = file("mine.demo");
        format!("play and record it yourself with `playbot play {name} --levels {levels} --record {file}`{rule}")
    } else {
        "train a policy without them, with `playbot train --algorithm ppo --run runs/first`".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::{App, KeyCode};
    use playbot_lab::{demo::dataset::Demonstrations, foreign::ForeignGame, games::Games};

    use super::*;
    use crate::experiment::ExperimentArgs;

    /// What is said where a game's recordings should be and are not.
    fn said(game: &dyn Game, path: &Path) -> String {
        let games = [game];
        let games = Games::new(&games).expect("one game");
        let experiment = ExperimentArgs::default().load(&games, []).expect("that of the game");
        let error = Demonstrations::of(game, &experiment, path).expect_err("there are none");
        explain(error, game, &experiment, path).to_string()
    }

    #[test]
    fn the_command_is_named_that_makes_the_missing_recordings() {
        let folder = tempfile::tempdir().expect("a folder");
        let (empty, file) = (folder.path(), folder.path().join("a.demo"));
        let bare = ForeignGame::new("runner", 1, |_: &mut App| {});
        let played = bare.clone().keys([vec![], vec![KeyCode::Space]]);
        let shown = played.clone().demonstrator("walker", || 0_u32);

        let words = said(&shown, empty);
        let command = "`playbot record runner --levels default:0..63 --steps 200000 --out ";
        assert!(words.contains(command) && words.contains("bot.demo`"), "{words}");
        assert!(words.contains("training levels") && words.contains("held-out ones, default:64..127"), "{words}");
        let words = said(&shown, &file);
        assert!(words.contains("cannot find recordings") && words.contains("a.demo`"), "{words}");
        assert!(!words.contains("bot.demo"), "{words}");
        let words = said(&played, &empty.join("none"));
        let command = "`playbot play runner --levels default:0..63 --record ";
        assert!(words.contains(command) && words.contains("mine.demo`"), "{words}");
        let words = said(&bare, empty);
        assert!(words.contains("`playbot train --algorithm ppo "), "{words}");
    }

    #[test]
    fn recordings_that_are_there_and_bad_are_not_to_be_made_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.demo");
        std::fs::write(&path, "no recording").expect("writable");
        let game = ForeignGame::new("runner", 1, |_: &mut App| {}).demonstrator("walker", || 0_u32);
        let words = said(&game, &path);
        assert!(!words.contains("playbot record"), "{words}");
    }
}
