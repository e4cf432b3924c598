//! A policy's cells beside those of an exploration: the option `--beside`.

use crate::{
    arguments::player::{LoadedPlayer, check_run_of},
    error::CliError,
};
use bevy_playbot::policy::ActionDraw;
use playbot_harness::{drawing::Drawing, floor_plan::FloorPlan, game::Game, trails::cells::CellChart};
use playbot_learner::DeviceKind;
use playbot_report::counted;
use playbot_test::explore::{Exploration, ExploredCell, PlayedCells, PlayedSummary};
use playbot_train::{checkpoint::CheckpointChoice, run_dir::RunDir};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

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
