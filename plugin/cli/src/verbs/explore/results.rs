//! Results of an exploration: the recording of a path, the picture of the reached cells, and a policy's cells beside them.

use crate::{
    arguments::player::{LoadedPlayer, check_run_of},
    error::CliError,
    output::{beside, prepare_new},
};
use bevy_playbot::{demo::file::DemoWriter, policy::ActionDraw};
use playbot_harness::{
    demo::verify_file, drawing::Drawing, floor_plan::FloorPlan, game::Game, trails::cells::CellChart,
};
use playbot_learner::{DeviceKind, disk};
use playbot_report::counted;
use playbot_test::explore::{Exploration, ExploredCell, PlayedCells, PlayedSummary, Route, follow_route, record_route};
use playbot_train::{checkpoint::CheckpointChoice, run_dir::RunDir};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

// The recording of a path that was found, and the picture of the reached cells.

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

// A policy's cells beside those of an exploration: the option `--beside`.

/// A policy whose cells are set beside those of an exploration.
pub struct Beside {
    path: PathBuf,
    loaded: LoadedPlayer,
}

/// Its cells.
pub struct PlayedBeside<'a> {
    path: &'a Path,
    played: PlayedCells,
    summary: PlayedSummary,
}

impl Beside {
    /// Loads the policy of a run's last checkpoint, or that of a policy file. Its actions are drawn.
    ///
    /// # Errors
    ///
    /// It cannot be loaded, or was made for another game.
    pub fn load(path: &Path, game: &dyn Game, device: DeviceKind) -> Result<Self, CliError> {
        let draw = ActionDraw::Sample;
        let loaded = if path.is_file() {
            LoadedPlayer::policy_file(game, path, draw, device)?
        } else {
            let opened = RunDir::open(path)?;
            check_run_of(path, &opened.experiment.game, game.name())?;
            LoadedPlayer::run(game, &opened, CheckpointChoice::Last, draw, device)?
        };
        loaded.check_fit(game)?;
        Ok(Self { path: path.to_owned(), loaded })
    }

    /// Plays episodes for as many ticks as the exploration took.
    ///
    /// # Errors
    ///
    /// The cells of the exploration are no positions, or the game breaks its contract.
    pub fn play(&self, game: &dyn Game, exploration: &Exploration) -> Result<PlayedBeside<'_>, CliError> {
        let LoadedPlayer { player, observation_config, .. } = &self.loaded;
        let played = PlayedCells::play(game, exploration, player, *observation_config)?;
        Ok(PlayedBeside { path: &self.path, summary: played.summary(exploration), played })
    }
}

impl PlayedBeside<'_> {
    /// Returns the comparison in words, one line.
    pub fn line(&self) -> String {
        let PlayedSummary { ticks, episodes, won, cells, open_cells_reached, coverage, both, .. } = &self.summary;
        let reached = match (open_cells_reached, coverage) {
            (Some(reached), Some(coverage)) => format!("{reached} open cells ({:.1} %)", 100.0 * coverage),
            _ => counted(*cells as u64, "cell"),
        };
        format!(
            "beside    {}: {reached} in {} of {}, {won} won; {both} of its {} the explorer reached, too",
            self.path.display(),
            counted(*ticks, "tick"),
            counted(*episodes, "episode"),
            counted(*cells as u64, "cell"),
        )
    }

    /// Returns the comparison as JSON.
    ///
    /// # Errors
    ///
    /// It cannot be written as JSON.
    pub fn json(&self) -> Result<Value, CliError> {
        let value = serde_json::to_value(&self.summary)
            .map_err(|error| CliError::Io(format!("the summary cannot be written as JSON: {error}")))?;
        Ok(json!({ "player": self.path.display().to_string(), "cells": value }))
    }

    /// Draws the cells on the level's floor plan, to the right of the exploration's.
    pub fn draw_beside(&self, explorer: Drawing, plan: FloorPlan, exploration: &Exploration) -> Drawing {
        let area = |cell: &ExploredCell| exploration.grid.as_ref()?.area(cell);
        let chart = CellChart {
            title: format!("Cells that {} reached", self.path.display()),
            captions: vec![self.line(), "cells: few to many ticks, logarithmic; crossed: not reached".to_owned()],
            plan,
            reached: self.played.cells.iter().filter_map(|(cell, ticks)| Some((area(cell)?, *ticks))).collect(),
            missed: self.played.missed(exploration).filter_map(area).collect(),
            path: Vec::new(),
        };
        explorer.beside(chart.draw())
    }
}
