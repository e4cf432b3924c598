//! The search for a level that has a place for a defect.

use std::collections::BTreeSet;

use playbot_learner::rng::{ChaCha8Rng, shuffle};

use super::error::BugError;
use crate::{
    defect::ChangeLevel,
    game::Game,
    inspect::{InspectError, LevelRequest},
};

/// A level with a defect.
#[derive(Debug)]
pub(super) struct BrokenLevel {
    /// Number of the unmutated level.
    pub(super) base: u64,
    /// Text of the broken level.
    pub(super) text: String,
    /// Hash of the broken level.
    pub(super) hash: u64,
}

/// Plants a defect into the first of these levels, in a random order, that has a place for it. The broken level must
/// not be in `taken`.
pub(super) fn plant_level(
    game: &dyn Game,
    class: &str,
    (mode, bases): (&str, &[u64]),
    change: &ChangeLevel,
    rng: &mut ChaCha8Rng,
    taken: &mut BTreeSet<u64>,
) -> Result<Option<BrokenLevel>, BugError> {
    let mut order = bases.to_vec();
    shuffle(&mut order, rng);
    for base in order {
        let sound = level_json(game, mode, base)?;
        let Some(text) = change(&sound, rng) else { continue };
        let hash_of = |text: &str| {
            let design = game.parse_level(text).map_err(|error| BugError::NoLevel {
                game: game.name().to_owned(),
                class: class.to_owned(),
                base: format!("{mode}:{base}"),
                why: error.what,
            })?;
            Ok::<_, BugError>(design.hash())
        };
        let hash = hash_of(&text)?;
        // A level that plays as before has no defect.
        if hash != hash_of(&sound)? && taken.insert(hash) {
            return Ok(Some(BrokenLevel { base, text, hash }));
        }
    }
    Ok(None)
}

/// Returns the text of a level, as `playbot level GAME --json` prints it. Games whose levels are maps take modes by
/// another name, and some maps have no numbers.
fn level_json(game: &dyn Game, mode: &str, level: u64) -> Result<String, InspectError> {
    let usual = LevelRequest { mode: Some(mode), level: Some(level), ..LevelRequest::default() };
    let requests = [
        usual,
        LevelRequest { mode: None, map: Some(mode), ..usual },
        LevelRequest { mode: None, map: Some(mode), level: None, ..usual },
    ];
    let mut first = None;
    for request in requests {
        match game.show_level(&request) {
            Ok(view) => return Ok(view.json),
            Err(error) => {
                first.get_or_insert(error);
            }
        }
    }
    Err(first.unwrap_or(InspectError::Closed))
}
