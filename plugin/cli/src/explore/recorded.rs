//! Recording of a path that was found.

use std::path::{Path, PathBuf};

use bevy_playbot::demo::file::DemoWriter;
use playbot_lab::{
    demo::verify::verify_file,
    explore::{Exploration, Route, record_route},
    game::Game,
};
use playbot_learner::disk;

use crate::{
    error::CliError,
    output::{beside, prepare},
};

/// A file for a recording, tested before the work whose result it holds.
pub struct RecordingFile(PathBuf);

impl RecordingFile {
    /// Checks that a file may be written.
    ///
    /// # Errors
    ///
    /// It exists without `--force`, or nothing can be written there.
    pub fn new(path: &Path, force: bool) -> Result<Self, CliError> {
        if path.is_file() && !force {
            return Err(CliError::Usage(format!(
                "{} exists: name another file, or overwrite it with --force",
                path.display()
            )));
        }
        prepare(path)?;
        Ok(Self(path.to_owned()))
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Plays a path under the recorder, replays the recording, and moves it to its file if both agree.
    ///
    /// # Errors
    ///
    /// The game breaks its contract or does not replay, or the disk fails. An earlier file stays.
    pub fn write(&self, game: &dyn Game, exploration: &Exploration, route: &Route) -> Result<(), CliError> {
        let fresh = beside(&self.0, ".fresh");
        let written = self.record(game, exploration, route, &fresh);
        if written.is_err() {
            // It is of no use, and the error says why.
            let _ = disk::remove_file(&fresh);
        }
        written
    }

    fn record(&self, game: &dyn Game, exploration: &Exploration, route: &Route, fresh: &Path) -> Result<(), CliError> {
        let (mode, level, path) = (exploration.mode.as_str(), exploration.level, self.0.display());
        let mut header = game.demo_header(mode);
        header.demonstrator = "explorer".to_owned();
        header.note = format!("found by {} with seed {}", exploration.explorer, exploration.seed);
        record_route(game, mode, level, &route.actions, DemoWriter::replace(fresh, header)?)?;
        let report = verify_file(game, fresh, |_| {})?;
        if report.episodes != 1 || report.ticks != route.len() as u64 {
            return Err(CliError::Io(format!(
                "{path}: the path that was found has {} ticks, and only {} of them could be played again",
                route.len(),
                report.ticks
            )));
        }
        if let Some((_, divergence)) = report.divergences.first() {
            return Err(CliError::Io(format!(
                "{path}: the path that was found does not replay ({divergence}): `playbot doctor {} --mode {mode} --level \
                 {level}` names what differs",
                game.name()
            )));
        }
        disk::rename(fresh, &self.0).map_err(|error| CliError::Io(format!("cannot write {path}: {error}")))
    }
}
