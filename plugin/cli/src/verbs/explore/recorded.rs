//! Recording of a path that was found, and picture of the reached cells.

use crate::{
    error::CliError,
    output::{beside, prepare_new},
};
use bevy_playbot::demo::file::DemoWriter;
use playbot_harness::{demo::verify_file, floor_plan::FloorPlan, game::Game, trails::cells::CellChart};
use playbot_learner::disk;
use playbot_report::counted;
use playbot_test::explore::{Exploration, ExploredCell, Route, follow_route, record_route};
use std::path::{Path, PathBuf};

/// A file for a recording, tested before the work whose result it holds.
pub struct RecordingFile(PathBuf);

impl RecordingFile {
    /// Checks that a file may be written.
    ///
    /// # Errors
    ///
    /// It exists without `--force`, or nothing can be written there.
    pub fn new(path: &Path, force: bool) -> Result<Self, CliError> {
        prepare_new(path, force)?;
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
                "{path}: the path that was found has {}, and only {} of them could be played again",
                counted(route.len() as u64, "tick"),
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

/// Draws the cells of an exploration on the level's floor plan, with a path through them.
///
/// # Errors
///
/// The game breaks its contract when the path is played again.
pub(crate) fn chart(
    game: &dyn Game,
    plan: FloorPlan,
    exploration: &Exploration,
    route: Option<&Route>,
) -> Result<CellChart, CliError> {
    let Exploration { mode, level, grid, .. } = exploration;
    let mut positions = Vec::new();
    if let Some(route) = route {
        positions.push(plan.start);
        positions.extend(follow_route(game, mode, *level, &route.actions)?);
    }
    let area = |cell: &ExploredCell| grid.as_ref()?.area(cell);
    let cells = exploration.cells().iter();
    let reached = cells.filter_map(|(cell, reached)| Some((area(cell)?, reached.visits))).collect();
    let summary = exploration.summary(game).to_string();
    Ok(CellChart {
        title: format!("Cells that an explorer reached in {} {mode}:{level}", game.name()),
        captions: summary
            .lines()
            .chain(["cells: few to many visits, logarithmic; crossed: not reached"])
            .map(str::to_owned)
            .collect(),
        plan,
        reached,
        missed: exploration.missed().filter_map(area).collect(),
        path: positions,
    })
}
