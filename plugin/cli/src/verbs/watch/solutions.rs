//! The actions that solved each level, as recordings that `playbot replay` and `playbot demo` can show.

use crate::error::CliError;
use bevy_playbot::{
    action::ActionValue,
    demo::file::{DemoReader, DemoWriter},
    state_hash::StateHash,
};
use playbot_harness::{game::Game, split::LevelSplit};
use playbot_learner::{Actions, disk};
use playbot_test::explore::record_route;
use std::path::{Path, PathBuf};

/// Folder of the solutions, beside the saves.
const SOLUTIONS: &str = "solutions";

/// Solutions of the levels of a game.
pub(super) struct Solutions<'a> {
    game: &'a dyn Game,
    folder: PathBuf,
}

impl<'a> Solutions<'a> {
    /// Names the folder of the watch.
    pub fn new(game: &'a dyn Game, folder: &Path) -> Self {
        Self { game, folder: folder.join(SOLUTIONS) }
    }

    /// Returns the actions that last solved a level. `None` if there are none, or none that can be read.
    pub fn of(&self, level: &str) -> Option<Vec<ActionValue>> {
        let mut reader = DemoReader::open(self.file(level)).ok()?;
        if reader.header().game != self.game.name() {
            return None;
        }
        let episode = reader.next()?.ok()?;
        let actions: Vec<ActionValue> = episode.actions.iter().collect();
        // Another version of the game may have other actions.
        let mut fitting = Actions::empty(&self.game.actions());
        let fits = actions.iter().all(|action| fitting.push(action).is_ok());
        (fits && !actions.is_empty()).then_some(actions)
    }

    /// Keeps actions that solve a level.
    ///
    /// # Errors
    ///
    /// The game breaks its contract, or the disk refuses. An earlier solution stays.
    pub fn keep(&self, level: &str, split: &LevelSplit, solution: &[ActionValue]) -> Result<(), CliError> {
        let file = self.file(level);
        let failed = |error: std::io::Error| CliError::Io(format!("cannot write {}: {error}", file.display()));
        disk::create_dir_all(&self.folder).map_err(failed)?;
        let mut actions = Actions::empty(&self.game.actions());
        for action in solution {
            actions.push(action)?;
        }
        let mut header = self.game.demo_header(&split.mode);
        header.demonstrator = "watch".to_owned();
        let fresh = file.with_extension("fresh");
        let written = DemoWriter::replace(&fresh, header)
            .map_err(CliError::from)
            .and_then(|writer| Ok(record_route(self.game, &split.mode, split.first, &actions, writer)?))
            .and_then(|()| disk::rename(&fresh, &file).map_err(failed));
        if written.is_err() {
            // It is of no use, and the error says why.
            let _ = disk::remove_file(&fresh);
        }
        written
    }

    /// Returns the file of a level: its name without what a file's name may not have, and a hash of it.
    fn file(&self, level: &str) -> PathBuf {
        let plain: String =
            level.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' }).collect();
        let plain = &plain[plain.len().saturating_sub(60)..];
        let hash = StateHash::of(level.bytes().map(u64::from)).folded();
        self.folder.join(format!("{plain}-{hash:08x}.demo"))
    }
}
