//! The recheck of a finding.

use serde::Serialize;

use super::{
    checks::Checks,
    look::{Look, look},
    play::Replayed,
    playable::Unplayable,
    solo::Setting,
    status::FindingStatus,
    stored::StoredFinding,
};
use crate::game::Game;

/// The tick and state in which a finding was seen again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Sighting {
    /// Tick of the episode; `None` if the finding needs no play.
    pub tick: Option<u32>,
    /// Hash of the state, in the form of a finding's head.
    pub state_hash: Option<u32>,
}

/// The result of replaying a finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Recheck {
    /// The sighting, if there was one.
    pub sighting: Option<Sighting>,
    /// The replayed episode.
    pub replayed: Replayed,
}

impl Recheck {
    /// Returns whether it happened exactly as stored.
    pub fn is_same(&self, finding: &StoredFinding) -> bool {
        let (tick, state_hash) = (finding.head.tick, finding.head.state_hash);
        self.sighting == Some(Sighting { tick, state_hash })
    }

    /// Returns its status.
    pub fn status(&self, finding: &StoredFinding) -> FindingStatus {
        match self.sighting {
            None => FindingStatus::Gone,
            Some(_) if self.is_same(finding) => FindingStatus::StillThere,
            Some(_) => FindingStatus::Changed,
        }
    }
}

/// Replays a finding's actions in a World of their own, and runs its check.
///
/// # Errors
///
/// [`Unplayable`]: another game or version, a level that no longer exists, or a detector without a check.
pub fn recheck(game: &dyn Game, finding: &StoredFinding, checks: &Checks) -> Result<Recheck, Unplayable> {
    let StoredFinding { header, head, episode } = finding;
    let check = checks.of_finding(game, head).ok_or_else(|| {
        let known = checks.names().collect::<Vec<_>>().join(", ");
        Unplayable(format!("this program has no check of the detector `{}`; it has {known}", head.detector))
    })?;
    finding.check_playable(game)?;
    let (mode, level) = (header.mode.as_str(), episode.level_seed);
    let setting = Setting { game, mode, level, seed: head.seed };
    let Look { is_there, tick, replayed, .. } = look(setting, head, &finding.actions(), &check);
    let state_hash = tick.and_then(|tick| replayed.state_hash(tick));
    Ok(Recheck { sighting: is_there.then_some(Sighting { tick, state_hash }), replayed })
}
