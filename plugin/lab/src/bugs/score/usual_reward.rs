//! What rewards testers usually collect.

use std::collections::BTreeMap;

use super::{
    job::JobResult,
    subject::{Subject, SubjectKind},
};

/// Fewest sound levels, beside the one that is looked at, from which a tester's usual reward is known.
pub const FEWEST_SOUND: usize = 8;

/// The rewards of each tester on the sound levels of each game.
///
/// In a game that cannot be won no tester fails by not reaching the aim, but one may still collect far more or far less than
/// it does elsewhere.
pub(super) struct UsualRewards<'a> {
    /// By game and tester: the mean reward of the tester's episodes on each sound level.
    known: BTreeMap<(&'a str, &'a str), Vec<(&'a str, f64)>>,
}

impl<'a> UsualRewards<'a> {
    /// Those of these results.
    pub fn new(subjects: &BTreeMap<&'a str, &'a Subject>, results: &'a [JobResult]) -> Self {
        let mut known: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for result in results {
            let subject = subjects.get(result.subject.as_str()).filter(|subject| subject.kind == SubjectKind::Sound);
            if let (Some(subject), Some(reward)) = (subject, result.reward) {
                let key = (subject.game.as_str(), result.tester.as_str());
                known.entry(key).or_default().push((subject.id.as_str(), reward));
            }
        }
        Self { known }
    }

    /// Whether a tester's reward lies outside of what it collects on the sound levels of the game, this one left out, by more
    /// than these lie apart: below `least - (most - least)` or above `most + (most - least)`. Only a tester that collects
    /// much the same on all of them says something: the least and the most lie less far apart than their middle from 0.
    pub fn is_unusual(&self, game: &str, result: &JobResult) -> bool {
        let Some(reward) = result.reward else { return false };
        let Some(known) = self.known.get(&(game, result.tester.as_str())) else { return false };
        let others = known.iter().filter(|(subject, _)| *subject != result.subject).map(|(_, reward)| *reward);
        let nothing = (0, f64::INFINITY, f64::NEG_INFINITY);
        let (count, least, most) = others
            .fold(nothing, |(count, least, most), reward| (count + 1, f64::min(least, reward), f64::max(most, reward)));
        let (apart, middle) = (most - least, least.midpoint(most));
        let is_steady = count >= FEWEST_SOUND && apart < middle.abs();
        is_steady && !(least - apart..=most + apart).contains(&reward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::score::testing::{mutant, sound};

    fn played(subject: &Subject, reward: f64) -> JobResult {
        let (subject, tester) = (subject.id.clone(), "glutton".to_owned());
        JobResult { subject, tester, episodes: 1, reward: Some(reward), ..JobResult::default() }
    }

    /// Which of the rewards on a mutant are unusual after these on sound levels, and on which sound level it is.
    fn unusual(sound_rewards: &[f64], rewards: &[f64]) -> (Vec<bool>, Vec<usize>) {
        let levels: Vec<Subject> = (0..sound_rewards.len() as u64).map(|level| sound("garden", level)).collect();
        let results: Vec<JobResult> =
            levels.iter().zip(sound_rewards).map(|(level, reward)| played(level, *reward)).collect();
        let subjects = levels.iter().map(|level| (level.id.as_str(), level)).collect();
        let usual = UsualRewards::new(&subjects, &results);
        let broken = mutant("garden", "m", "panic");
        let of_mutant = rewards.iter().map(|reward| usual.is_unusual("garden", &played(&broken, *reward))).collect();
        let of_sound = (0..results.len()).filter(|place| usual.is_unusual("garden", &results[*place])).collect();
        (of_mutant, of_sound)
    }

    #[test]
    fn a_reward_is_unusual_far_outside_of_those_of_sound_levels() {
        let sound_rewards = [10.0, 11.0, 12.0, 10.5, 11.5, 10.0, 12.0, 11.0, 11.0];
        let rewards = [11.0, 8.1, 7.9, 13.9, 14.1, -3.0];
        assert_eq!(unusual(&sound_rewards, &rewards).0, [false, false, true, false, true, true]);
        assert!(unusual(&sound_rewards, &rewards).1.is_empty());
    }

    #[test]
    fn a_sound_level_is_held_against_the_others() {
        let sound_rewards = [10.0, 11.0, 12.0, 10.5, 30.0, 10.0, 12.0, 11.0, 11.0, 11.0];
        assert_eq!(unusual(&sound_rewards, &[]).1, [4]);
    }

    #[test]
    fn few_levels_luck_and_other_games_say_nothing() {
        assert_eq!(unusual(&[9.0, 8.0, 9.0, 8.0, 9.0, 8.0, 9.0], &[99.0]).0, [false], "one too few");
        let lucky = [0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0];
        assert_eq!(unusual(&lucky, &[1.0]), (vec![false], vec![]), "now and then it finds something by chance");
        assert_eq!(unusual(&[0.0; 20], &[1.0]).0, [false], "it may have had no luck yet");
        assert_eq!(unusual(&[5.0; 20], &[5.0, 4.0]).0, [false, true], "it always collects the same");
        let levels: Vec<Subject> = (0..20).map(|level| sound("garden", level)).collect();
        let results: Vec<JobResult> =
            (0_u32..).zip(&levels).map(|(place, level)| played(level, f64::from(20 + place % 5))).collect();
        let subjects = levels.iter().map(|level| (level.id.as_str(), level)).collect();
        let usual = UsualRewards::new(&subjects, &results);
        let far = played(&mutant("garden", "m", "panic"), 99.0);
        assert!(usual.is_unusual("garden", &far) && !usual.is_unusual("forest", &far));
        assert!(!usual.is_unusual("garden", &JobResult { reward: None, ..far.clone() }));
        assert!(!usual.is_unusual("garden", &JobResult { tester: "random".to_owned(), ..far }));
    }
}
