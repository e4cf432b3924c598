//! The rewards that testers collect on unmutated levels.

use std::collections::BTreeMap;

use super::{
    job::JobResult,
    subject::{Subject, SubjectKind},
};

/// Fewest unmutated levels, beside the one that is judged, from which a tester's typical reward is known.
pub const FEWEST_SOUND: usize = 8;
/// Standard deviations from the mean that count as unusual. With 20 unmutated levels and normal rewards, one in a
/// thousand lies there (Student's t with 19 degrees of freedom).
pub const FAR: f64 = 4.0;

/// The rewards of each tester on the unmutated levels of each game.
///
/// In a game that cannot be won, no tester fails by missing the goal. It may still collect far more or far less reward
/// than elsewhere.
pub(super) struct UsualRewards<'a> {
    /// By game and tester: the mean reward of the tester's episodes on each unmutated level.
    known: BTreeMap<(&'a str, &'a str), Vec<(&'a str, f64)>>,
}

impl<'a> UsualRewards<'a> {
    /// Collects the rewards of these results.
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

    /// Returns whether a tester's reward is unusual. It must lie outside of all its rewards on the other unmutated
    /// levels of the game, and more than [`FAR`] standard deviations from their mean. Only testers with similar rewards
    /// on all of them count: the range must be smaller than the distance of its middle from 0.
    pub fn is_unusual(&self, game: &str, result: &JobResult) -> bool {
        let Some(reward) = result.reward else { return false };
        let Some(known) = self.known.get(&(game, result.tester.as_str())) else { return false };
        let others: Vec<f64> =
            known.iter().filter(|(subject, _)| *subject != result.subject).map(|(_, reward)| *reward).collect();
        let [least, most] = [(f64::INFINITY, f64::min as fn(f64, f64) -> f64), (f64::NEG_INFINITY, f64::max)]
            .map(|(none, of)| others.iter().copied().fold(none, of));
        let is_steady = others.len() >= FEWEST_SOUND && most - least < least.midpoint(most).abs();
        is_steady && !(least..=most).contains(&reward) && is_far(reward, &others)
    }
}

/// Returns whether a number is more than [`FAR`] standard deviations from the mean of these, of which there are two or
/// more.
fn is_far(number: f64, others: &[f64]) -> bool {
    let count = others.len() as f64;
    let mean = others.iter().sum::<f64>() / count;
    let variance = others.iter().map(|other| (other - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (number - mean).abs() > FAR * variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::score::testing::{mutant, sound};

    fn played(subject: &Subject, reward: f64) -> JobResult {
        let (subject, tester) = (subject.id.clone(), "glutton".to_owned());
        JobResult { subject, tester, episodes: 1, reward: Some(reward), ..JobResult::default() }
    }

    /// The indices of unusual rewards: on a mutant, after these on unmutated levels, and on the unmutated levels
    /// themselves.
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
        // Mean 11, standard deviation 0.75.
        let rewards = [11.0, 8.1, 7.9, 13.9, 14.1, -3.0];
        assert_eq!(unusual(&sound_rewards, &rewards).0, [false, false, true, false, true, true]);
        let skewed = [10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 14.9];
        let skewed = [skewed.as_slice(), &[10.0; 15]].concat();
        assert_eq!(unusual(&skewed, &[14.8]).0, [false], "no more than another one");
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
