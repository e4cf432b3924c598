//! Checks of networks and splits: skills, prior, decoder, policies that ignore what they see, and overfitting.

use crate::diagnose::{
    advice::Advice,
    evidence::Evidence,
    finding::{LearningFinding, Sign},
    play::{Played, Seat},
};
use playbot_report::{percent, readable};

/// Outputs that differ by less do not depend on the observation.
const SMALLEST_OUTPUT: f64 = 1e-5;

/// Information of a skill on the action, nats, and spread of the prior, under which they carry nothing.
const SMALLEST_INFORMATION: f64 = 1e-3;
const SMALLEST_PRIOR: f64 = 1e-3;

/// Difference of the success on training and on held-out levels that does not come by chance in 16 episodes each: three
/// standard errors of a difference of two shares of one half.
const LARGEST_GAP: f64 = 0.55;

/// Checks networks and the difference between training and held-out levels.
pub fn check(evidence: &Evidence) -> Vec<LearningFinding> {
    let mut found = Vec::new();
    found.extend(networks(evidence));
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
    let success = |seat: Seat| evidence.played(seat).and_then(Played::success);
    let (trained, held_out) = (success(Seat::Policy)?, success(Seat::HeldOut)?);
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
        let healthy =
            NetworkProbe { rows: 9, output_spread: 0.5, skill_information: Some(0.2), prior_spread: Some(0.1) };
        evidence.networks = Some(healthy.clone());
        assert_eq!(signs(&evidence), []);
        evidence.networks = Some(NetworkProbe { output_spread: 0.0, ..healthy.clone() });
        assert_eq!(signs(&evidence), [Sign::IgnoresObservation]);
        evidence.networks = Some(NetworkProbe { skill_information: Some(0.0), ..healthy.clone() });
        assert_eq!(signs(&evidence), [Sign::EqualSkills]);
        evidence.networks = Some(NetworkProbe { prior_spread: Some(0.0), ..healthy });
        assert_eq!(signs(&evidence), [Sign::BlindPrior]);
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
