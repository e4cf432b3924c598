//! Checks of recordings: other rules, other levels, nothing done, nothing won.

use crate::diagnose::{
    advice::Advice,
    evidence::{Evidence, list},
    finding::{LearningFinding, Sign},
    play::PlayedEpisode,
    recordings::{RecordedEpisode, RecordedSet},
};
use playbot_report::{counted, percent};

/// Share of ticks without an action from which on a recording shows nothing.
const MOST_IDLE: f64 = 0.9;

/// Success rate below which recordings of other levels may be the cause.
const RARELY: f64 = 0.3;

/// Checks what recordings are of and what they show.
pub fn check(evidence: &Evidence) -> Vec<LearningFinding> {
    let Some(set) = evidence.recordings.as_ref().filter(|set| !set.episodes.is_empty()) else { return Vec::new() };
    let mut found = Vec::new();
    found.extend(version(evidence, set));
    found.extend(no_replay(evidence, set));
    found.extend(idle(set));
    found.extend(held_out(evidence, set));
    found.extend(other_levels(evidence, set));
    found.extend(never_won(set));
    found
}

fn version(evidence: &Evidence, set: &RecordedSet) -> Option<LearningFinding> {
    let (game, version) = (&evidence.experiment.game, evidence.game_version);
    let others: Vec<String> = set.games.iter().filter(|name| *name != game).cloned().collect();
    let other = |episode: &&RecordedEpisode| episode.version != version;
    let count = set.episodes.iter().filter(other).count();
    let found = set.episodes.iter().find(other).map(|episode| episode.version);
    let words = match (others.is_empty(), found) {
        (false, _) => format!("the recordings are of {}, and the training is of {game}", list(&others)),
        (true, Some(found)) => format!(
            "{count} of {} are of version {found} of the rules, and the game has version {version}",
            counted(set.episodes.len() as u64, "recorded episode")
        ),
        (true, None) => return None,
    };
    let cause = match others.is_empty() {
        false => "they are recordings of another game, which show nothing of this one",
        true => "the game has changed since it was recorded: the same actions lead elsewhere",
    };
    Some(LearningFinding::new(Sign::OtherVersion, words, cause, &[Advice::RecordAgain, Advice::ShowRecordings]))
}

fn no_replay(evidence: &Evidence, set: &RecordedSet) -> Option<LearningFinding> {
    let replays = set.replays.as_ref()?;
    let diverged: Vec<&String> = replays.iter().filter_map(|replay| replay.divergence.as_ref()).collect();
    let first = diverged.first()?;
    let cause = match set.exchanged {
        Some((one, other)) => format!(
            "`{}` and `{}` are exchanged: with one for the other, the recordings replay",
            evidence.action_name(one),
            evidence.action_name(other)
        ),
        None => {
            "the rules or the meaning of actions have changed without a new version, or the game differs from itself"
                .to_owned()
        }
    };
    Some(LearningFinding::new(
        Sign::NoReplay,
        format!("{} of {} replayed episodes lead elsewhere, the first: {first}", diverged.len(), replays.len()),
        cause,
        &[Advice::Verify, Advice::RaiseVersion, Advice::Doctor],
    ))
}

fn idle(set: &RecordedSet) -> Option<LearningFinding> {
    let share = set.idle_share().filter(|share| *share >= MOST_IDLE)?;
    Some(LearningFinding::new(
        Sign::IdleRecordings,
        format!(
            "nothing is done in {} of the ticks of {}",
            percent(share),
            counted(set.episodes.len() as u64, "recorded episode")
        ),
        "the recorder ran without a player, or keys were not recorded",
        &[Advice::RecordAgain, Advice::ShowRecordings],
    ))
}

/// Finds recordings of held-out levels, from which nothing may be learned.
fn held_out(evidence: &Evidence, set: &RecordedSet) -> Option<LearningFinding> {
    let count = Some(evidence.held_out_recorded).filter(|count| *count > 0)?;
    Some(LearningFinding::new(
        Sign::OtherLevels,
        format!(
            "{count} of {} are of the held-out levels {}",
            counted(set.episodes.len() as u64, "recorded episode"),
            evidence.experiment.test
        ),
        "results on these levels would say nothing, so no skills are learned from such recordings",
        &[Advice::RecordAgain, Advice::ShowRecordings],
    ))
}

fn other_levels(evidence: &Evidence, set: &RecordedSet) -> Option<LearningFinding> {
    // Skills of an easier mode may well serve a harder one: what counts is that the policy does not get there.
    let fails = evidence.success().is_some_and(|success| success < RARELY);
    if evidence.other_modes.is_empty() || !fails {
        return None;
    }
    let of_others =
        set.episodes.iter().filter(|episode| evidence.other_modes.iter().any(|mode| **mode == *episode.mode)).count();
    (of_others == set.episodes.len()).then(|| {
        LearningFinding::new(
            Sign::OtherLevels,
            format!(
                "all {} are of {}, and the training is of {}",
                counted(set.episodes.len() as u64, "recorded episode"),
                list(&evidence.other_modes),
                evidence.experiment.train.mode
            ),
            "skills of one task are used for another one",
            &[Advice::RecordAgain, Advice::ShowRecordings],
        )
    })
}

fn never_won(set: &RecordedSet) -> Option<LearningFinding> {
    let whole: Vec<&RecordedEpisode> = set.episodes.iter().filter(|episode| !episode.is_aborted()).collect();
    let is_good = |episode: &&RecordedEpisode| episode.episode.is_success() || episode.first_reward().is_some();
    let paid_now = set
        .replays
        .iter()
        .flatten()
        .any(|replay| replay.episode.success || PlayedEpisode::first_reward(&replay.episode).is_some());
    if whole.iter().any(is_good) || paid_now {
        return None;
    }
    Some(LearningFinding::new(
        Sign::NeverWon,
        format!("none of {} is won or has a reward", counted(set.episodes.len() as u64, "recorded episode")),
        "the demonstrator does not do the task, so neither does what learns from it",
        &[Advice::RecordAgain, Advice::KeepWins],
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::{
        play::Replayed,
        testing::{evidence, recorded},
    };
    use crate::{metrics_log::SUCCESS_RATE, runs::RunCurves};

    fn signs(evidence: &Evidence) -> Vec<Sign> {
        check(evidence).into_iter().map(|finding| finding.sign).collect()
    }

    fn with(set: RecordedSet) -> Evidence {
        Evidence { recordings: Some(set), ..evidence("score-ppo", "") }
    }

    #[test]
    fn won_recordings_of_the_present_rules_are_healthy() {
        assert_eq!(signs(&with(recorded(1, true))), []);
    }

    #[test]
    fn each_fault_of_recordings_is_found() {
        let mut other = with(recorded(1, true));
        other.game_version = 2;
        assert_eq!(signs(&other), [Sign::OtherVersion]);
        assert_eq!(signs(&with(recorded(1, false))), [Sign::NeverWon]);
        assert_eq!(signs(&with(recorded(0, true))), [Sign::IdleRecordings], "action 0 does nothing");
        let held_out = Evidence { held_out_recorded: 3, ..with(recorded(1, true)) };
        assert_eq!(signs(&held_out), [Sign::OtherLevels]);
        assert!(check(&held_out)[0].evidence.starts_with("3 of 4 recorded episodes are of the held-out levels"));
        let mut elsewhere = with(recorded(1, true));
        elsewhere.other_modes = vec!["hard".to_owned()];
        assert_eq!(signs(&elsewhere), [], "it is not known to fail");
        let mut curves = RunCurves::default();
        curves.push(100, [(SUCCESS_RATE, 0.1)].into_iter());
        elsewhere.curves = Some(curves);
        assert_eq!(signs(&elsewhere), [Sign::OtherLevels]);
    }

    #[test]
    fn recordings_that_lead_elsewhere_name_exchanged_actions() {
        let mut set = recorded(1, true);
        let diverged = Replayed { episode: PlayedEpisode::default(), divergence: Some("tick 3".to_owned()) };
        set.replays = Some(vec![diverged]);
        set.exchanged = Some((0, 1));
        let found = check(&with(set));
        assert_eq!(found[0].sign, Sign::NoReplay);
        assert!(found[0].evidence.ends_with("the first: tick 3"), "{:?}", found[0]);
        assert!(found[0].cause.starts_with("`action 0` and `action 1` are exchanged"), "{:?}", found[0]);
    }
}
