//! Minimisation of findings: leaving out the actions that a finding does not need.

use std::cell::Cell;

use bevy_playbot::action::ActionValue;

use super::{
    actions::efforts, check::Check, checks::Checks, ddmin::ddmin, failure::NOT_SOLVED, head::FindingHead, look::look,
    playable::Unplayable, solo::Setting, stored::StoredFinding,
};
use crate::{game::Game, idle::idle_action};

/// The budget of a minimisation.
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

/// A finding with fewer ticks, or fewer actions with an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Minimised {
    /// The finding; the original one, if nothing could be left out.
    pub finding: StoredFinding,
    /// Replays that it took.
    pub replays: u32,
    /// Actions with an effect, in the original finding and in the shorter one.
    pub efforts: [u32; 2],
    /// Whether no single part can be left out. Otherwise the budget was used up, or `stop` returned true.
    pub is_minimal: bool,
}

/// Leaves out actions as long as the finding still happens, at any tick. The steps are:
///
/// 1. Large parts are replaced by idling, since many findings need few actions or none.
/// 2. ddmin leaves out parts.
/// 3. Single actions are replaced by idling where leaving them out would change all that follows.
/// 4. ddmin again.
///
/// For findings at the time limit actions are only replaced by idling. The same finding and budget give the same
/// result. `stop` ends it with the best result so far.
///
/// # Errors
///
/// [`Unplayable`], or the finding does not happen any more.
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
    let check = checks.of_finding(game, &finding.head).ok_or_else(gone)?;
    let (mode, level) = (finding.header.mode.as_str(), finding.episode.level_seed);
    let setting = Setting { game, mode, level, seed: finding.head.seed };
    let trial = Trial { setting, head: &finding.head, check, replays: Cell::new(0), ticks: Cell::new(0), progress };
    let actions_before = finding.actions();
    let Some(needed) = trial.needed(&actions_before) else { return Err(gone()) };
    let has_enough = || trial.replays.get() >= budget.replays || trial.ticks.get() >= budget.ticks || stop();
    let actions = trial.shortened(actions_before[..needed].to_vec(), &has_enough);
    let found = look(setting, &finding.head, &actions, &trial.check);
    let shorter = found.is_there.then(|| {
        // The episode is another one, and so are the numbers in its message.
        let message = found.message.unwrap_or_else(|| finding.head.message.clone());
        let head = FindingHead { tick: None, state_hash: None, message, ..finding.head.clone() };
        StoredFinding::of_replay(setting, head, &actions, found.replayed, found.tick)
    });
    let idle = idle_action(game);
    let size = |finding: &StoredFinding| (finding.episode.len(), efforts(&finding.actions(), &idle));
    let shorter = shorter.filter(|shorter| size(shorter) < size(finding));
    let shorter = shorter.unwrap_or_else(|| finding.clone());
    let efforts = [&actions_before, &shorter.actions()].map(|actions| efforts(actions, &idle));
    Ok(Minimised { finding: shorter, efforts, replays: trial.replays.get(), is_minimal: !has_enough() })
}

/// Most parts into which the actions are cut before ddmin: 31 replays.
const LARGE_PARTS: usize = 16;

/// Tries actions, and counts.
struct Trial<'a> {
    setting: Setting<'a>,
    head: &'a FindingHead,
    check: Check,
    replays: Cell<u32>,
    ticks: Cell<u64>,
    progress: &'a dyn Fn(u32),
}

impl Trial<'_> {
    /// Returns the number of actions until the finding happens; `None` if it does not.
    fn needed(&self, actions: &[ActionValue]) -> Option<usize> {
        let found = look(self.setting, self.head, actions, &self.check);
        self.replays.set(self.replays.get() + 1);
        self.ticks.set(self.ticks.get() + found.replayed.state_hashes.len() as u64 + 1);
        (self.progress)(self.replays.get());
        let needed = || found.tick.map_or(0, |tick| actions.len().min(tick as usize + 1));
        found.is_there.then(needed)
    }

    /// Returns the actions without those that are not needed.
    fn shortened(&self, mut actions: Vec<ActionValue>, has_enough: &dyn Fn() -> bool) -> Vec<ActionValue> {
        let nothing = idle_action(self.setting.game);
        // Fewer idle actions are the beginning of the same episode, in which the finding had not happened yet.
        let is_idle = |actions: &[ActionValue]| actions.iter().all(|action| *action == nothing);
        if is_idle(&actions) {
            return actions;
        }
        let parts = if self.head.detector == NOT_SOLVED { usize::MAX } else { LARGE_PARTS };
        self.idle_instead(&mut actions, parts, has_enough);
        if self.head.detector == NOT_SOLVED || is_idle(&actions) {
            // A shorter episode does not last until the time limit.
            return actions;
        }
        actions = ddmin(actions, has_enough, |shorter| self.needed(shorter));
        if !is_idle(&actions) && self.idle_instead(&mut actions, usize::MAX, has_enough) && !is_idle(&actions) {
            actions = ddmin(actions, has_enough, |shorter| self.needed(shorter));
        }
        actions
    }

    /// Replaces actions by idling where the finding still happens: all, then halves, quarters and so on, down to this
    /// many parts or to single actions. Returns whether anything was replaced.
    fn idle_instead(&self, actions: &mut Vec<ActionValue>, parts: usize, has_enough: &dyn Fn() -> bool) -> bool {
        let nothing = idle_action(self.setting.game);
        let least = (actions.len() / parts).max(1);
        let mut has_changed = false;
        let mut size = actions.len();
        while size >= least {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{corridor::Corridor, findings::failure::LOST};

    /// A finding of this detector on a level of the corridor, where action 0 is idling, and goes to the end that loses.
    fn stored(detector: &str, actions: &[u32]) -> StoredFinding {
        let actions: Vec<ActionValue> = actions.iter().copied().map(ActionValue::Discrete).collect();
        let head = FindingHead::new("plain:3", detector, "after 99 ticks");
        let checks = Checks::default();
        StoredFinding::of_actions(&Corridor::default(), "plain", 3, head, &actions, &checks).expect("it is there")
    }

    fn shorter(finding: &StoredFinding) -> Minimised {
        let (game, checks) = (Corridor::default(), Checks::default());
        minimise(&game, finding, &checks, Budget::default(), &|_| {}, &|| false).expect("it is there")
    }

    #[test]
    fn a_shorter_finding_tells_of_its_own_episode() {
        let actions = [[1, 0].repeat(4), vec![0; 3]].concat();
        let found = shorter(&stored(LOST, &actions));
        assert_eq!(found.finding.episode.len(), 3);
        assert_eq!(found.finding.head.message, "the game ended the episode after 3 ticks");
    }

    #[test]
    fn what_needs_nobody_is_found_to_do_so_in_one_replay_more() {
        let actions = [[1, 0].repeat(4), vec![0; 3]].concat();
        let found = shorter(&stored(LOST, &actions));
        assert_eq!((found.efforts, found.replays), ([4, 0], 2));
    }

    #[test]
    fn where_nothing_has_to_be_done_nothing_is_tried() {
        let idle = stored(LOST, &[0; 3]);
        let Minimised { finding, replays, is_minimal, .. } = shorter(&idle);
        assert_eq!((replays, is_minimal), (1, true));
        assert_eq!(finding, idle, "what could not be made shorter stays as it is");
    }

    #[test]
    fn time_that_is_up_is_not_waited_for_in_shorter_episodes() {
        let late = stored(NOT_SOLVED, &[1, 0].repeat(15));
        let Minimised { finding, replays, is_minimal, .. } = shorter(&late);
        assert!(is_minimal && replays < 80, "{replays}");
        assert_eq!(finding.episode.len(), 30);
    }
}
