//! Minimisation of findings: leaving out the actions that a finding does not need.

use crate::findings::{
    FindingHead, StoredFinding,
    checks::{Check, Checks, NOT_SOLVED},
    course::look,
    play::{Setting, Unplayable, efforts, play_player},
};
use bevy_playbot::{action::ActionValue, vision::ObservationConfig};
use playbot_harness::{
    eval::Player,
    game::{Game, idle_action},
};
use std::cell::Cell;

/// Most parts into which the actions are cut before ddmin: 31 replays.
const LARGE_PARTS: usize = 16;

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

/// Leaves out parts of a list until no more can be left out, or the budget of `try_it` is used up.
///
/// `try_it` receives a shorter list. It returns `Some` if the effect remains, with the number of items that were
/// needed, counted from the first; else `None`. The order of its calls is reproducible.
///
/// This is ddmin (Zeller and Hildebrandt, Simplifying and isolating failure-inducing input, IEEE Transactions on
/// Software Engineering 28 (2), 2002).
pub(super) fn ddmin<T: Clone>(
    mut items: Vec<T>,
    has_enough: &dyn Fn() -> bool,
    mut try_it: impl FnMut(&[T]) -> Option<usize>,
) -> Vec<T> {
    let mut parts = 2;
    while items.len() >= 2 && !has_enough() {
        match reduced(&items, parts, has_enough, &mut try_it) {
            Some((shorter, next)) => {
                items = shorter;
                parts = next.clamp(2, items.len().max(2));
            }
            None if parts >= items.len() => break,
            None => parts = (2 * parts).min(items.len()),
        }
    }
    if items.len() == 1 && !has_enough() && try_it(&[]).is_some() {
        items.clear();
    }
    items
}

/// Returns the first part with the effect, or else the first remainder without one part, with the number of parts to go
/// on with.
fn reduced<T: Clone>(
    items: &[T],
    parts: usize,
    has_enough: &dyn Fn() -> bool,
    try_it: &mut impl FnMut(&[T]) -> Option<usize>,
) -> Option<(Vec<T>, usize)> {
    let bounds: Vec<usize> = (0..=parts).map(|part| part * items.len() / parts).collect();
    let ends = || bounds.windows(2).map(|ends| (ends[0], ends[1]));
    let mut still = |candidate: Vec<T>| {
        let needed = if has_enough() { None } else { try_it(&candidate) }?;
        Some(candidate[..needed.min(candidate.len())].to_vec())
    };
    for (start, end) in ends() {
        if let Some(part) = still(items[start..end].to_vec()) {
            return Some((part, 2));
        }
    }
    // With two parts, the remainder without one is the other.
    if parts > 2 {
        for (start, end) in ends() {
            if let Some(rest) = still([&items[..start], &items[end..]].concat()) {
                return Some((rest, parts - 1));
            }
        }
    }
    None
}

// Lengths of findings, before and after minimisation.

/// Lengths of a finding, in actions with an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lengths {
    /// The whole episode.
    pub played: u32,
    /// Up to the finding.
    pub original: u32,
    /// After minimisation.
    pub minimised: u32,
}

/// Minimises the finding of this head in these actions. `None` if it does not happen again, needs no play, or has no
/// check.
pub fn lengths(
    game: &dyn Game,
    (mode, level): (&str, u64),
    head: FindingHead,
    actions: &[ActionValue],
    checks: &Checks,
    budget: Budget,
    stop: &dyn Fn() -> bool,
) -> Option<Lengths> {
    if !checks.of(&head.detector)?.needs_play() {
        return None;
    }
    let found = StoredFinding::of_actions(game, mode, level, head, actions, checks)?;
    let shorter = minimise(game, &found, checks, budget, &|_| {}, stop).ok()?;
    let [original, minimised] = shorter.efforts;
    Some(Lengths { played: efforts(actions, &idle_action(game)), original, minimised })
}

/// Returns a player's actions in the episode with this seed; `None` if its observation cannot be drawn.
pub fn actions_of(
    game: &dyn Game,
    (mode, level): (&str, u64),
    seed: u64,
    player: &Player,
    observation_config: &ObservationConfig,
) -> Option<Vec<ActionValue>> {
    let setting = Setting { game, mode, level, seed };
    play_player(setting, player, observation_config).ok().map(|(actions, _)| actions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::checks::LOST;
    use bevy::prelude::*;
    use bevy_playbot::{bot::BlindBot, episode::EpisodeEnd};
    use playbot_corridor::Corridor;
    use playbot_harness::foreign::{ForeignGame, Restart};
    use std::cell::Cell;

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
    fn a_finding_that_needs_no_action_takes_one_replay_more() {
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

    /// A game that is lost after six turns. Its actions 0 and 1 are legal in even turns, and 2 in odd ones.
    fn turns() -> ForeignGame {
        let game = |app: &mut App| {
            app.insert_resource(Turn(0)).add_systems(Startup, |mut turn: ResMut<Turn>| turn.0 = 0);
            app.add_systems(Update, |mut turn: ResMut<Turn>| turn.0 += 1);
        };
        ForeignGame::new("turns", 1, game)
            .keys([vec![], vec![KeyCode::KeyA], vec![KeyCode::KeyB]])
            .legal(|turn: Res<Turn>| {
                let is_even = turn.0.is_multiple_of(2);
                [is_even, is_even, !is_even]
            })
            .observe(["turn"], |turn: Res<Turn>| [turn.0 as f32])
            .end(|turn: Res<Turn>| (turn.0 >= 6).then_some(EpisodeEnd::LOST))
            .restart(Restart::Startup)
    }

    #[derive(Resource)]
    struct Turn(u32);

    #[test]
    fn a_shorter_finding_names_the_legal_actions_that_were_played() {
        let (game, checks, stop) = (turns(), Checks::default(), || false);
        let bot = Player::Blind(BlindBot::Constant(ActionValue::Discrete(1)));
        let played = actions_of(&game, ("default", 0), 0, &bot, &ObservationConfig::default()).expect("a vector");
        let head = FindingHead::new("default:0", LOST, "after 6 ticks");
        let found = StoredFinding::of_actions(&game, "default", 0, head, &played, &checks).expect("it is lost");
        assert_eq!(found.actions(), played);
        let minimised = minimise(&game, &found, &checks, Budget::default(), &|_| {}, &stop).expect("it is there");
        // In place of 1 nothing is done, and 2 is still the only legal action of the other turns.
        let one = ActionValue::Discrete(1);
        let expected =
            played.iter().map(|action| if *action == one { ActionValue::Discrete(0) } else { action.clone() });
        assert!(played.contains(&one) && played.contains(&ActionValue::Discrete(2)), "{played:?}");
        assert_eq!(minimised.finding.actions(), expected.collect::<Vec<_>>());
    }

    const NEVER: &dyn Fn() -> bool = &|| false;

    /// The effect needs these items in this order. Returns how far the list has to be read.
    fn needs(list: &[u32], wanted: &[u32]) -> Option<usize> {
        let mut at = 0;
        for number in wanted {
            at += list[at..].iter().position(|found| found == number)? + 1;
        }
        Some(at)
    }

    #[test]
    fn what_is_not_needed_is_left_out() {
        for wanted in [&[3][..], &[0, 99], &[7, 8, 50], &[10, 20, 30, 40, 90], &[]] {
            let found = ddmin((0..100).collect(), NEVER, |list| needs(list, wanted));
            assert_eq!(found, wanted, "{wanted:?}");
        }
    }

    #[test]
    fn a_list_that_needs_all_of_it_stays() {
        let all: Vec<u32> = (0..9).collect();
        assert_eq!(ddmin(all.clone(), NEVER, |list| needs(list, &all)), all);
        assert!(ddmin(Vec::<u32>::new(), NEVER, |_| panic!("there is nothing to try")).is_empty());
    }

    #[test]
    fn it_ends_when_it_has_had_enough_with_the_best_so_far() {
        let tried = Cell::new(0);
        let found = ddmin((0..1000).collect(), &|| tried.get() >= 20, |list| {
            tried.set(tried.get() + 1);
            needs(list, &[400, 700])
        });
        assert_eq!(tried.get(), 20);
        assert!(found.len() < 1000 && needs(&found, &[400, 700]).is_some(), "{}", found.len());
    }
}
