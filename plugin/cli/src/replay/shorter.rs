//! Shortened findings, in files of their own.

use std::path::Path;

use playbot_lab::{
    findings::{Budget, Checks, Minimised, StoredFinding, minimise},
    game::Game,
};

use crate::{error::CliError, interrupt, output, progress};

/// Leaves out needless actions, with a progress bar, and writes the rest. Its level is named as in `stored`: it may
/// have been found in another folder. Ctrl-C ends it with the best so far.
///
/// # Errors
///
/// The finding does not happen any more, or the file cannot be written.
pub fn write_shorter(
    game: &dyn Game,
    finding: &StoredFinding,
    stored: &StoredFinding,
    replays: u32,
    out: &Path,
) -> Result<Minimised, CliError> {
    interrupt::listen();
    let bar = progress::bar("minimise", replays.into(), "replays");
    let budget = Budget { replays, ..Budget::default() };
    let hear = |replays: u32| bar.set_position(replays.into());
    let shorter = minimise(game, finding, &Checks::of_game(game), budget, &hear, &interrupt::asked);
    bar.finish_and_clear();
    let shorter = shorter?;
    output::make_folder_of(out)?;
    shorter.finding.clone().with_level_of(stored).write(out)?;
    Ok(shorter)
}
