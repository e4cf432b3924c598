//! Checks of actions: those that change nothing, and those that masks forbid.

use crate::diagnose::{
    advice::Advice,
    evidence::{Evidence, list},
    finding::{LearningFinding, Sign},
    play::{ForcedAction, PlayedEpisode, Seat},
    recordings::RecordedSet,
};
use bevy_playbot::action::{ActionSpace, ActionValue};
use playbot_report::{percent, whole};

/// Share of the recorded ticks from which on an action is needed.
const NEEDED: f64 = 0.01;

/// How many times as often as by noise a needed action is taken.
const ABOVE_NOISE: f64 = 1.5;

/// Share of ticks that counts as nearly always.
const NEARLY_ALWAYS: f64 = 0.99;

/// Fewest ticks about which a mask says something.
const FEWEST_TICKS: usize = 200;

/// Checks forced actions and masks.
pub fn check(evidence: &Evidence) -> Vec<LearningFinding> {
    let mut found = Vec::new();
    found.extend(forbidden(evidence));
    found.extend(dead(evidence));
    found
}

/// Returns whether an action is the one of this number, or has the option in this place among those of all choices.
fn takes(space: ActionSpace, taken: &ActionValue, number: u32) -> bool {
    let choices = space.choices();
    let mut options = choices.ranges().zip(taken.options());
    options.any(|(range, option)| range.start + *option as usize == number as usize)
}

/// Returns the share of recorded or demonstrated ticks with an action of this number.
fn demonstrated(evidence: &Evidence, action: u32) -> Option<f64> {
    let recorded = evidence.recordings.as_ref().filter(|set| !set.episodes.is_empty());
    let recorded = recorded.map(|set: &RecordedSet| set.share_of(|taken| takes(evidence.action_space, taken, action)));
    let live = evidence.played(Seat::Demonstrator).map(|played| {
        let actions = || played.episodes.iter().flat_map(|episode| &episode.actions);
        let taken = actions().filter(|taken| takes(evidence.action_space, taken, action)).count();
        taken as f64 / actions().count().max(1) as f64
    });
    match (recorded, live) {
        (Some(recorded), Some(live)) => Some(recorded.max(live)),
        (one, other) => one.or(other),
    }
}

fn forbidden(evidence: &Evidence) -> Option<LearningFinding> {
    let masks = || {
        let episodes = evidence.played.iter().flat_map(|played| &played.episodes);
        episodes.flat_map(|episode: &PlayedEpisode| &episode.masks).filter(|mask| !mask.is_empty())
    };
    let ticks = masks().count();
    let actions = masks().next().map_or(0, Vec::len);
    if ticks < FEWEST_TICKS {
        return None;
    }
    let share =
        |action: usize| masks().filter(|mask| !mask.get(action).copied().unwrap_or(true)).count() as f64 / ticks as f64;
    let closed: Vec<u32> = (0..actions as u32).filter(|&action| share(action as usize) >= NEARLY_ALWAYS).collect();
    let named = |action: u32| format!("`{}`", evidence.action_name(action));
    let needed: Vec<u32> = closed
        .iter()
        .copied()
        .filter(|&action| demonstrated(evidence, action).is_some_and(|share| share >= NEEDED))
        .collect();
    let is_unknown = evidence.recordings.is_none();
    let shown = if needed.is_empty() && is_unknown { &closed } else { &needed };
    if shown.is_empty() {
        return None;
    }
    let names: Vec<String> = shown.iter().copied().map(named).collect();
    let taken = shown.iter().filter_map(|&action| demonstrated(evidence, action)).sum::<f64>();
    let how = match needed.is_empty() {
        true => "no recording shows whether they are needed".to_owned(),
        false => format!("demonstrators take them in {} of the ticks", percent(taken)),
    };
    Some(LearningFinding::new(
        Sign::ForbiddenActions,
        format!("masks forbid {} in nearly all of {} ticks, and {how}", list(&names), whole(ticks as f64)),
        "`LegalActions` has a wrong entry, or its entries are in another order than the actions",
        &[Advice::AllowActions],
    ))
}

/// Returns the share from which on a discrete action is needed: more than noise puts into recordings.
fn needed_share(evidence: &Evidence) -> f64 {
    let noise = evidence.experiment.skills.action_noise / evidence.action_names.len().max(1) as f64;
    NEEDED.max(ABOVE_NOISE * noise)
}

fn dead(evidence: &Evidence) -> Option<LearningFinding> {
    let least = needed_share(evidence);
    let dead: Vec<&ForcedAction> = evidence.forced.iter().filter(|action| action.is_dead()).collect();
    let tried = evidence.forced.iter().filter(|action| action.tried > 0).count();
    // Every number is needed.
    let is_number = |action: &ForcedAction| action.number as usize >= evidence.action_space.options();
    let needed: Vec<&&ForcedAction> = dead
        .iter()
        .filter(|action| is_number(action) || demonstrated(evidence, action.number).is_some_and(|share| share >= least))
        .collect();
    let all = !dead.is_empty() && dead.len() == tried;
    if needed.is_empty() && !all {
        return None;
    }
    let names: Vec<String> = match all {
        true => dead.iter().map(|action| format!("`{}`", action.name)).collect(),
        false => needed.iter().map(|action| format!("`{}`", action.name)).collect(),
    };
    let moments = dead.iter().map(|action| action.tried).max().unwrap_or_default();
    Some(LearningFinding::new(
        Sign::DeadActions,
        format!(
            "{} of {tried} actions do what doing nothing does, held at {moments} moments of an episode: {}",
            names.len(),
            list(&names)
        ),
        "the game ignores the key, reads the action in a schedule that does not run, or reads another agent's",
        &[Advice::HeedActions, Advice::FindDeadActions],
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{evidence, played};

    fn forced(effects: [usize; 3]) -> Vec<ForcedAction> {
        let action = |(number, effects)| ForcedAction { name: format!("key {number}"), number, tried: 3, effects };
        (0..).zip(effects).map(action).collect()
    }

    #[test]
    fn a_dead_action_counts_if_it_is_demonstrated_or_if_all_are_dead() {
        let mut evidence = evidence("ppo", "");
        evidence.forced = forced([3, 0, 1]);
        assert!(check(&evidence).is_empty(), "nothing needs the dead one");
        evidence.played = vec![played(Seat::Demonstrator, 100, |tick| (vec![tick as f32], 1, 0.0))];
        let found = check(&evidence);
        assert_eq!(found[0].sign, Sign::DeadActions);
        assert!(found[0].evidence.starts_with("1 of 3 actions do what doing nothing does"), "{:?}", found[0]);
        assert!(found[0].evidence.ends_with("`key 1`"), "{:?}", found[0]);
        evidence.played = vec![played(Seat::Random, 100, |tick| (vec![tick as f32], 1, 0.0))];
        evidence.forced = forced([0, 0, 0]);
        assert!(check(&evidence)[0].evidence.starts_with("3 of 3"), "nothing works");
    }

    #[test]
    fn options_of_several_choices_count_by_themselves() {
        let mut evidence = evidence("ppo", "");
        evidence.action_space = ActionSpace::mixed([2, 3], 1);
        let both = |walk: u32, jump: u32| ActionValue::Mixed { choices: vec![walk, jump], numbers: vec![0.0] };
        assert!(takes(evidence.action_space, &both(1, 2), 1) && takes(evidence.action_space, &both(1, 2), 4));
        assert!(!takes(evidence.action_space, &both(1, 2), 2), "the first option of the second choice");
        let mut demonstrator = played(Seat::Demonstrator, 300, |tick| (vec![tick as f32], 0, 0.0));
        demonstrator.episodes[0].actions = vec![both(0, 2); 300];
        demonstrator.episodes[0].masks = vec![vec![true, true, true, true, false]; 300];
        evidence.played = vec![demonstrator];
        evidence.forced = vec![
            ForcedAction { name: "jump".to_owned(), number: 4, tried: 3, effects: 0 },
            ForcedAction { name: "walk".to_owned(), number: 1, tried: 3, effects: 1 },
        ];
        let signs: Vec<Sign> = check(&evidence).into_iter().map(|finding| finding.sign).collect();
        assert_eq!(signs, [Sign::ForbiddenActions, Sign::DeadActions]);
    }

    #[test]
    fn a_mask_that_forbids_what_is_demonstrated_is_found() {
        let mut evidence = evidence("ppo", "");
        let mut random = played(Seat::Random, 300, |tick| (vec![tick as f32], 0, 0.0));
        random.episodes[0].masks = vec![vec![true, false]; 300];
        let demonstrator = played(Seat::Demonstrator, 100, |tick| (vec![tick as f32], 1, 0.0));
        evidence.played = vec![random, demonstrator];
        let found = check(&evidence);
        assert_eq!(found[0].sign, Sign::ForbiddenActions);
        assert!(found[0].evidence.contains("`action 1` in nearly all of 300 ticks"), "{:?}", found[0]);
        for mask in &mut evidence.played[0].episodes[0].masks[..50] {
            mask[1] = true;
        }
        assert!(check(&evidence).is_empty(), "it is legal at times");
    }
}
