//! Leaving out the actions that a finding does not need.

use std::cell::Cell;

use bevy_playbot::action::ActionValue;

use super::{
    actions::efforts, check::Check, checks::Checks, ddmin::ddmin, head::FindingHead, look::look, playable::Unplayable,
    solo::Setting, stored::StoredFinding,
};
use crate::{game::Game, idle::idle_action};

/// How much may be tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Most replays.
    pub replays: u32,
    /// Most ticks of all replays together; the last one may take some more.
    pub ticks: u64,
}

impl Default for Budget {
    fn default() -> Self {
        Self { replays: 500, ticks: 2_000_000 }
    }
}

/// A finding with fewer ticks, or fewer actions that do something.
#[derive(Clone, Debug, PartialEq)]
pub struct Minimised {
    /// The finding; the one that was given, if nothing could be left out.
    pub finding: StoredFinding,
    /// Replays that it took.
    pub replays: u32,
    /// Actions that do something, in the finding that was given and in the shorter one.
    pub efforts: [u32; 2],
    /// Whether nothing more can be left out, one part at a time; otherwise the budget was used up, or somebody stopped it.
    pub is_minimal: bool,
}

/// Leaves out actions as long as the finding is still there, at whatever tick: first with ddmin, then by idling in place of
/// what cannot be left out without changing all that follows, then with ddmin again. The same finding and budget give the
/// same result. `stop` ends it with the best so far.
///
/// # Errors
///
/// [`Unplayable`], or the finding is not there any more.
pub fn minimise(
    game: &dyn Game,
    finding: &StoredFinding,
    checks: &Checks,
    budget: Budget,
    progress: &dyn Fn(u32),
    stop: &dyn Fn() -> bool,
) -> Result<Minimised, Unplayable> {
    finding.check_playable(game)?;
    let gone = || Unplayable("it does not happen any more, so there is nothing to minimise".to_owned());
    let check = checks.of(&finding.head.detector).ok_or_else(gone)?;
    let (mode, level) = (finding.header.mode.as_str(), finding.episode.level_seed);
    let setting = Setting { game, mode, level, seed: finding.head.seed };
    let trial = Trial { setting, head: &finding.head, check, replays: Cell::new(0), ticks: Cell::new(0), progress };
    let actions_before = finding.actions();
    let Some(needed) = trial.needed(&actions_before) else { return Err(gone()) };
    let has_enough = || trial.replays.get() >= budget.replays || trial.ticks.get() >= budget.ticks || stop();
    let mut actions = actions_before[..needed].to_vec();
    actions = ddmin(actions, &has_enough, |shorter| trial.needed(shorter));
    if trial.idle_instead(&mut actions, &has_enough) {
        actions = ddmin(actions, &has_enough, |shorter| trial.needed(shorter));
    }
    let head = FindingHead { tick: None, state_hash: None, ..finding.head.clone() };
    let shorter = StoredFinding::of_actions(game, mode, level, head, &actions, checks);
    let idle = idle_action(game);
    let size = |finding: &StoredFinding| (finding.episode.len(), efforts(&finding.actions(), &idle));
    let shorter = shorter.filter(|shorter| size(shorter) < size(finding));
    let shorter = shorter.unwrap_or_else(|| finding.clone());
    let efforts = [&actions_before, &shorter.actions()].map(|actions| efforts(actions, &idle));
    Ok(Minimised { finding: shorter, efforts, replays: trial.replays.get(), is_minimal: !has_enough() })
}

/// Tries out actions, and counts.
struct Trial<'a> {
    setting: Setting<'a>,
    head: &'a FindingHead,
    check: Check,
    replays: Cell<u32>,
    ticks: Cell<u64>,
    progress: &'a dyn Fn(u32),
}

impl Trial<'_> {
    /// How many of the actions it takes until the finding is there; `None` if it is not.
    fn needed(&self, actions: &[ActionValue]) -> Option<usize> {
        let found = look(self.setting, self.head, actions, &self.check);
        self.replays.set(self.replays.get() + 1);
        self.ticks.set(self.ticks.get() + found.replayed.state_hashes.len() as u64 + 1);
        (self.progress)(self.replays.get());
        let needed = || found.tick.map_or(0, |tick| actions.len().min(tick as usize + 1));
        found.is_there.then(needed)
    }

    /// Replaces actions by idling where the finding is still there, larger parts first; whether any was.
    fn idle_instead(&self, actions: &mut Vec<ActionValue>, has_enough: &dyn Fn() -> bool) -> bool {
        let nothing = idle_action(self.setting.game);
        let mut has_changed = false;
        let mut size = actions.len().div_ceil(2);
        while size > 0 {
            let mut start = 0;
            while start < actions.len() {
                let end = actions.len().min(start + size);
                if actions[start..end].iter().any(|action| *action != nothing) {
                    if has_enough() {
                        return has_changed;
                    }
                    let mut candidate = actions.clone();
                    candidate[start..end].fill(nothing.clone());
                    if let Some(needed) = self.needed(&candidate) {
                        candidate.truncate(needed);
                        *actions = candidate;
                        has_changed = true;
                    }
                }
                start = end;
            }
            size = if size == 1 { 0 } else { size.div_ceil(2) };
        }
        has_changed
    }
}
