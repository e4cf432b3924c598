//! Checks of networks and splits: skills, prior, decoder, policies that ignore what they see, and overfitting.

use crate::diagnose::{
    advice::Advice,
    evidence::Evidence,
    finding::{LearningFinding, Sign},
    play::{Played, PlayedEpisode, Seat, mean},
};
use playbot_report::{percent, readable, statistics::mean_and_sd};
use std::collections::BTreeMap;

/// Outputs that differ by less do not depend on the observation.
const SMALLEST_OUTPUT: f64 = 1e-5;

/// Information of a skill on the action, nats, and spread of the prior, under which they carry nothing.
const SMALLEST_INFORMATION: f64 = 1e-3;
const SMALLEST_PRIOR: f64 = 1e-3;

/// Share of a layer's units that are dead in no sound training.
const MOST_DEAD: f64 = 0.9;

/// Fewest levels on which two players are compared, and standard errors by which their returns differ clearly.
const FEWEST_LEVELS: usize = 8;
const CLEAR: f64 = 4.0;

/// Difference of the success on training and on held-out levels that does not come by chance in 16 episodes each: three
/// standard errors of a difference of two shares of one half.
const LARGEST_GAP: f64 = 0.55;

/// Checks networks, what they add, and the difference between training and held-out levels.
pub fn check(evidence: &Evidence) -> Vec<LearningFinding> {
    let mut found = Vec::new();
    found.extend(networks(evidence));
    found.extend(dead_units(evidence));
    found.extend(better_without(
        evidence,
        Seat::Decoder,
        Sign::BelowDecoder,
        "training has undone what the recordings taught: its steps are too large, or its reward leads elsewhere",
        &[Advice::RaisePenalty, Advice::LowerRate, Advice::FewerPasses],
    ));
    found.extend(better_without(
        evidence,
        Seat::AnySkill,
        Sign::PoorPrior,
        "the prior draws skills that do not fit the state: the recordings are of another task, or it was learned too briefly",
        &[Advice::RecordAgain, Advice::LearnSkillsLonger],
    ));
    found.extend(decoder(evidence));
    found.extend(splits(evidence));
    found
}

fn networks(evidence: &Evidence) -> Vec<LearningFinding> {
    let Some(probe) = evidence.networks.as_ref().filter(|_| !evidence.mostly_succeeds()) else { return Vec::new() };
    let mut found = Vec::new();
    if probe.output_spread < SMALLEST_OUTPUT {
        found.push(LearningFinding::new(
            Sign::IgnoresObservation,
            format!(
                "over {} observations, no output of the actor varies by more than {}",
                probe.rows,
                readable(probe.output_spread)
            ),
            "all units are dead or saturated after too large a step, or the observation is constant",
            &[Advice::LowerRate, Advice::NormaliseObservations],
        ));
    }
    if let Some(information) = probe.skill_information.filter(|information| *information < SMALLEST_INFORMATION) {
        found.push(LearningFinding::new(
            Sign::EqualSkills,
            format!("a skill has {} nats of information on the action in a state", readable(information)),
            "the weight β of the skills' KL term has emptied them, or the recordings always do the same",
            &[Advice::LowerBeta, Advice::RecordAgain],
        ));
    }
    if let Some(spread) = probe.prior_spread.filter(|spread| *spread < SMALLEST_PRIOR) {
        found.push(LearningFinding::new(
            Sign::BlindPrior,
            format!("over {} observations, the mean skill varies by {}", probe.rows, readable(spread)),
            "the prior has learned nothing of the state: too few epochs, or too large a β",
            &[Advice::LearnSkillsLonger, Advice::LowerBeta],
        ));
    }
    found
}

fn dead_units(evidence: &Evidence) -> Option<LearningFinding> {
    let probe = evidence.networks.as_ref().filter(|_| !evidence.mostly_succeeds())?;
    let mut layers = probe.dead_units.iter().enumerate();
    let (layer, share) = layers.find(|(_, share)| **share >= MOST_DEAD)?;
    Some(LearningFinding::new(
        Sign::DeadUnits,
        format!(
            "over {} observations, {} of the units in hidden layer {} of {} let no gradient through",
            probe.rows,
            percent(*share),
            layer + 1,
            probe.dead_units.len()
        ),
        "a step was too large, or the observation is, so that units are 0 or saturated whatever is observed",
        &[Advice::LowerRate, Advice::NormaliseObservations],
    ))
}

fn by_level(played: &Played) -> BTreeMap<u64, &PlayedEpisode> {
    played.episodes.iter().map(|episode| (episode.level, episode)).collect()
}

/// Finds that a player without something that was learned earns clearly more than the policy, on the same levels.
fn better_without(
    evidence: &Evidence,
    without: Seat,
    sign: Sign,
    cause: &str,
    advice: &[Advice],
) -> Option<LearningFinding> {
    let (policy, other) = (evidence.played(Seat::Policy)?, evidence.played(without)?);
    let own = by_level(policy);
    let gain = |(level, other): (&u64, &&PlayedEpisode)| {
        let (own, other) = (*own.get(level)?, *other);
        // Episodes that were not played to their ends are compared as far as both went.
        let unended = [own, other].into_iter().filter(|episode| episode.end.is_none()).map(PlayedEpisode::ticks).min();
        let until = |episode: &PlayedEpisode| episode.earned_until(unended.unwrap_or(usize::MAX));
        Some(until(other) - until(own))
    };
    let gains: Vec<f64> = by_level(other).iter().filter_map(gain).collect();
    let (gain, sd) = mean_and_sd(&gains);
    let error = sd / (gains.len() as f64).sqrt();
    (gains.len() >= FEWEST_LEVELS && gain > CLEAR * error && gain > 0.0).then(|| {
        LearningFinding::new(
            sign,
            format!(
                "on {} training levels, {} earns {} ± {} more than the policy",
                gains.len(),
                without.name(),
                readable(gain),
                readable(error)
            ),
            cause,
            advice,
        )
    })
}

fn decoder(evidence: &Evidence) -> Option<LearningFinding> {
    let probe = evidence.decoder.filter(|probe| probe.nll > probe.frequencies + probe.margin)?;
    Some(LearningFinding::new(
        Sign::WeakDecoder,
        format!(
            "over {} recorded steps, the decoder has {} nats of negative log-likelihood, and the frequencies of the actions alone {}",
            probe.rows,
            readable(probe.nll),
            readable(probe.frequencies)
        ),
        "the skills were learned too briefly, or from other recordings",
        &[Advice::LearnSkillsLonger, Advice::Verify],
    ))
}

fn splits(evidence: &Evidence) -> Option<LearningFinding> {
    let (policy, unseen) = (evidence.played(Seat::Policy)?, evidence.played(Seat::HeldOut)?);
    // An episode that was not played to its end has failed, if it was played for longer than any win took.
    let longest_win = policy.ended().filter(|episode| episode.success).map(PlayedEpisode::ticks).max()?;
    let success = |played: &Played| {
        let failed = |episode: &&PlayedEpisode| episode.end.is_some() || episode.ticks() >= longest_win;
        mean(played.episodes.iter().filter(failed).map(|episode| f64::from(u8::from(episode.success))))
    };
    let (trained, held_out) = (success(policy)?, success(unseen)?);
    let levels = evidence.experiment.train.len();
    (trained - held_out >= LARGEST_GAP).then(|| {
        LearningFinding::new(
            Sign::Overfitting,
            format!(
                "the policy reaches the goal in {} of the episodes on training levels and in {} on held-out ones; it trains on {levels} levels",
                percent(trained),
                percent(held_out)
            ),
            "it knows its levels by heart: they are too few",
            &[Advice::MoreLevels],
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::{
        networks::{DecoderProbe, NetworkProbe},
        testing::{evidence, played},
    };
    use bevy_playbot::episode::EpisodeEnd;

    fn signs(evidence: &Evidence) -> Vec<Sign> {
        check(evidence).into_iter().map(|finding| finding.sign).collect()
    }

    #[test]
    fn networks_that_carry_nothing_are_found() {
        let mut evidence = evidence("score-ppo", "");
        let healthy = NetworkProbe {
            rows: 9,
            dead_units: vec![0.5, 0.2],
            output_spread: 0.5,
            skill_information: Some(0.2),
            prior_spread: Some(0.1),
        };
        evidence.networks = Some(healthy.clone());
        assert_eq!(signs(&evidence), []);
        evidence.networks = Some(NetworkProbe { output_spread: 0.0, ..healthy.clone() });
        assert_eq!(signs(&evidence), [Sign::IgnoresObservation]);
        evidence.networks = Some(NetworkProbe { skill_information: Some(0.0), ..healthy.clone() });
        assert_eq!(signs(&evidence), [Sign::EqualSkills]);
        evidence.networks = Some(NetworkProbe { prior_spread: Some(0.0), ..healthy.clone() });
        assert_eq!(signs(&evidence), [Sign::BlindPrior]);
        evidence.networks = Some(NetworkProbe { dead_units: vec![0.2, 0.95], ..healthy });
        let found = check(&evidence);
        assert_eq!(found[0].sign, Sign::DeadUnits);
        assert!(found[0].evidence.contains("95.0 % of the units in hidden layer 2 of 2"), "{}", found[0].evidence);
    }

    #[test]
    fn what_was_learned_has_to_be_worth_it() {
        // Ten levels; a player earns what it earns on each, and a little more on every second.
        let player = |seat: Seat, earns: f32| {
            let mut all = played(seat, 1, |_| (vec![0.0], 0, earns));
            let one = all.episodes.remove(0);
            all.episodes = (0..10_u8)
                .map(|level| PlayedEpisode {
                    level: level.into(),
                    rewards: vec![earns + 0.1 * f32::from(level % 2)],
                    end: Some(EpisodeEnd::WON),
                    ..one.clone()
                })
                .collect();
            all
        };
        let mut evidence = evidence("score-ppo", "");
        evidence.played = vec![player(Seat::Policy, 1.0), player(Seat::Decoder, 0.9), player(Seat::AnySkill, 1.0)];
        assert_eq!(signs(&evidence), []);
        evidence.played[1] = player(Seat::Decoder, 1.5);
        assert_eq!(signs(&evidence), [Sign::BelowDecoder]);
        evidence.played[2] = player(Seat::AnySkill, 2.0);
        assert_eq!(signs(&evidence), [Sign::BelowDecoder, Sign::PoorPrior]);
        // An episode that goes on has earned at least what it has so far.
        let goes_on = |mut all: Played, more: Vec<f32>| {
            for episode in &mut all.episodes {
                (episode.end, episode.rewards) = (None, [episode.rewards.clone(), more.clone()].concat());
            }
            all
        };
        let decoder = goes_on(player(Seat::Decoder, 1.0), vec![5.0; 9]);
        evidence.played = vec![player(Seat::Policy, 1.0), decoder.clone()];
        assert_eq!(signs(&evidence), [Sign::BelowDecoder]);
        // Two that go on are compared as far as both went.
        evidence.played = vec![goes_on(player(Seat::Policy, 1.0), Vec::new()), decoder.clone()];
        assert_eq!(signs(&evidence), [], "in the first tick they earn the same");
        evidence.played = vec![goes_on(player(Seat::Policy, 1.0), vec![0.0; 9]), decoder];
        assert_eq!(signs(&evidence), [Sign::BelowDecoder], "over ten ticks they do not");
        evidence.played = vec![player(Seat::Policy, 1.0), player(Seat::Decoder, 1.5), player(Seat::AnySkill, 2.0)];
        // One level says nothing, however large the difference.
        evidence.played[1].episodes.truncate(1);
        evidence.played[2].episodes.truncate(7);
        assert_eq!(signs(&evidence), []);
    }

    #[test]
    fn a_decoder_is_compared_with_frequencies() {
        let mut evidence = evidence("score-ppo", "");
        evidence.decoder = Some(DecoderProbe { rows: 9, nll: 1.0, frequencies: 1.0, margin: 0.1 });
        assert_eq!(signs(&evidence), []);
        evidence.decoder = Some(DecoderProbe { rows: 9, nll: 1.5, frequencies: 1.0, margin: 0.1 });
        assert_eq!(signs(&evidence), [Sign::WeakDecoder]);
    }

    #[test]
    fn success_that_does_not_carry_over_is_found() {
        let player = |seat: Seat, end: EpisodeEnd| {
            let mut played = played(seat, 10, |tick| (vec![tick as f32], 0, 0.0));
            (played.episodes[0].end, played.episodes[0].success) = (Some(end), end.is_success());
            played
        };
        let mut evidence = evidence("ppo", "");
        evidence.played = vec![player(Seat::Policy, EpisodeEnd::WON), player(Seat::HeldOut, EpisodeEnd::LOST)];
        assert_eq!(signs(&evidence), [Sign::Overfitting]);
        evidence.played = vec![player(Seat::Policy, EpisodeEnd::WON), player(Seat::HeldOut, EpisodeEnd::WON)];
        assert_eq!(signs(&evidence), []);
    }
}
