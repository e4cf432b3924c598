//! Checks of reward and time: whether anybody is paid, for what, and whether it comes in time.

use crate::diagnose::{
    advice::Advice,
    evidence::{Evidence, discount_and_norm},
    finding::{LearningFinding, Sign},
    play::{Played, PlayedEpisode, Seat, mean, median},
    recordings::replayed_episodes,
};
use bevy_playbot::episode::EpisodeEnd;
use playbot_report::{percent, readable, whole};

/// Largest size of a reward that a critic learns without a normaliser.
const LARGEST_REWARD: f32 = 100.0;

/// Share of the demonstrator's return that doing nothing must not reach.
const MOST_FOR_NOTHING: f64 = 0.8;

/// Ticks in which hardly any game gets anywhere.
const FEW_TICKS: usize = 60;

/// Fewest won episodes, and fewest that were cut off, whose returns are compared.
const FEWEST_OF_A_KIND: usize = 4;

/// A demonstrator lasts longer than random actions if its episodes have so many times their ticks.
const LONGER: f64 = 1.5;

/// Share of episodes under which a reward is rare.
const RARE: f64 = 0.01;

/// Fewest episodes of the policy that say that it is rare.
const FEWEST_EPISODES: f64 = 100.0;

/// Fewest rewarded episodes of random actions by which they are said to get there, and the share of what good play earns
/// that makes a clear difference.
const FEWEST_OF_CHANCE: usize = 2;
const CLEARLY_LESS: f64 = 0.1;

/// Present value of a reward under which it does not reach the start of an episode.
const SMALLEST_VALUE: f64 = 1e-3;

/// A horizon of fewer ticks is short where episodes are so many times as long.
const SHORTEST_HORIZON: f64 = 10.0;
const LONG_IN_HORIZONS: f64 = 5.0;

/// Checks rewards, horizon and time limit.
pub fn check(evidence: &Evidence) -> Vec<LearningFinding> {
    let mut found = Vec::new();
    found.extend(too_short(evidence));
    found.extend(never(evidence));
    // A young policy may do worse than chance for a while: what counts is that it never gets to the reward.
    found.extend(rare(evidence).map(|rare| below_chance(evidence).unwrap_or(rare)));
    if !found.iter().any(|finding| finding.sign == Sign::ShortTime) {
        found.extend(idling(evidence).or_else(|| waiting(evidence)));
    }
    found.extend(against(evidence));
    found.extend(scale(evidence));
    found.extend(horizon(evidence));
    found
}

/// Says for each player what it gets.
fn returns(evidence: &Evidence) -> String {
    let words = evidence
        .played
        .iter()
        .filter_map(|played| Some(format!("{} {}", played.seat.name(), readable(played.mean_return()?))));
    words.collect::<Vec<_>>().join(", ")
}

fn pays(played: &Played) -> bool {
    played.episodes.iter().any(|episode| episode.rewards.iter().any(|reward| *reward != 0.0))
}

/// Returns the ticks at which all ended episodes of a player are cut off; `None` if they end otherwise, or at other times.
fn limit(played: &Played) -> Option<usize> {
    let mut lengths = played.ended().map(|episode| (episode.end == Some(EpisodeEnd::Truncated), episode.ticks()));
    let (is_cut, first) = lengths.next()?;
    (is_cut && lengths.all(|(is_cut, ticks)| is_cut && ticks == first)).then_some(first)
}

/// Finds a time limit before which the goal cannot be reached: recorded wins take longer, or the demonstrator is always
/// cut off before it.
fn too_short(evidence: &Evidence) -> Option<LearningFinding> {
    let demonstrator = evidence.played(Seat::Demonstrator)?;
    let limit = limit(demonstrator).filter(|_| demonstrator.success() == Some(0.0))?;
    let is_paid = demonstrator.ended().any(|episode| episode.first_reward().is_some());
    if is_paid {
        return gets_nowhere(evidence, limit);
    }
    let recorded = evidence.recordings.iter().flat_map(|set| &set.episodes);
    let wins = recorded.filter(|episode| episode.episode.is_success() || episode.first_reward().is_some());
    let won = median(wins.map(|episode| episode.first_reward().unwrap_or(episode.episode.len())).collect());
    let words = match won {
        Some(ticks) if ticks > limit => format!("recorded wins take {} ticks", whole(ticks as f64)),
        Some(_) => return None,
        // Where others lose before, to last until then may be what is wanted.
        None if evidence.played.iter().any(|played| self::limit(played) != Some(limit)) => return None,
        None => "it never gets there, nor does anybody else".to_owned(),
    };
    Some(LearningFinding::new(
        Sign::ShortTime,
        format!("every episode of the demonstrator is cut off after {} ticks, and {words}", whole(limit as f64)),
        "the time limit is shorter than the path to the goal",
        &[Advice::RaiseTimeLimit],
    ))
}

/// Finds that all players are cut off in the same tick, with nearly the same return: what they do makes no difference
/// until then.
fn gets_nowhere(evidence: &Evidence, limit: usize) -> Option<LearningFinding> {
    let worth = evidence.played(Seat::Demonstrator).and_then(Played::mean_return)?;
    let others = || [Seat::Random, Seat::Chaos, Seat::Idle].into_iter().filter_map(|seat| evidence.played(seat));
    let is_alike = |played: &Played| {
        let near =
            played.mean_return().is_some_and(|earned| (earned - worth).abs() <= (1.0 - MOST_FOR_NOTHING) * worth.abs());
        self::limit(played) == Some(limit) && near
    };
    (limit <= FEW_TICKS && others().count() > 1 && others().all(is_alike)).then(|| {
        LearningFinding::new(
            Sign::ShortTime,
            format!(
                "every episode of every player is cut off after {} ticks, when all have earned nearly the same; returns: {}",
                whole(limit as f64),
                returns(evidence)
            ),
            "the time limit ends episodes before anybody gets anywhere",
            &[Advice::RaiseTimeLimit, Advice::PayGoal],
        )
    })
}

fn never(evidence: &Evidence) -> Option<LearningFinding> {
    let players: Vec<&Played> = evidence.played.iter().filter(|played| !played.episodes.is_empty()).collect();
    let ticks: usize = players.iter().flat_map(|played| &played.episodes).map(PlayedEpisode::ticks).sum();
    let trained = evidence.curves.as_ref().map(|curves| curves.curve(crate::metrics_log::EPISODIC_RETURN));
    let was_paid = trained.is_some_and(|curve| curve.iter().any(|(_, value)| *value != 0.0));
    if players.is_empty() || ticks == 0 || was_paid || players.iter().any(|played| pays(played)) {
        return None;
    }
    let demonstrator = evidence.played(Seat::Demonstrator);
    if demonstrator.is_some_and(|played| played.ended().next().is_none()) {
        // It may be on its way to a reward.
        return None;
    }
    let wins = demonstrator.map_or(0, |played| played.ended().filter(|episode| episode.success).count());
    let (words, cause, advice) = match demonstrator {
        Some(_) if wins > 0 => (
            format!("the demonstrator reaches the goal in {wins} episodes and is paid nothing"),
            "the game ends the episode at the goal, and does not pay for it",
            vec![Advice::PayReward],
        ),
        Some(_) => (
            "the demonstrator is paid nothing either".to_owned(),
            "the game never pays, or the goal cannot be reached",
            vec![Advice::PayReward, Advice::MeasureBots],
        ),
        None => (
            "there is no demonstrator to compare with".to_owned(),
            "the game never pays, or chance never gets to the reward",
            vec![Advice::PayReward, Advice::UseRecordings],
        ),
    };
    Some(LearningFinding::new(
        Sign::NoReward,
        format!("no reward in {} ticks of {} players: {words}", whole(ticks as f64), players.len()),
        cause,
        &advice,
    ))
}

/// Returns what good play earns: the demonstrator's mean return, or that of the recorded wins, or the highest that any
/// player got in an episode.
fn worth(evidence: &Evidence) -> Option<(&'static str, f64)> {
    let demonstrator = evidence.played(Seat::Demonstrator).and_then(Played::mean_return);
    let wins = evidence.recordings.iter().flat_map(|set| &set.episodes).filter(|episode| episode.episode.is_success());
    let of_win = |rewards: &[f32]| rewards.iter().map(|reward| f64::from(*reward)).sum::<f64>();
    let recorded = mean(wins.map(|episode| of_win(&episode.episode.rewards)));
    let played = evidence.played.iter().flat_map(Played::ended).map(PlayedEpisode::total);
    let best = played.reduce(f64::max);
    let known = [("the demonstrator's", demonstrator), ("a recorded win's", recorded), ("the best episode's", best)];
    known.into_iter().find_map(|(whose, worth)| Some((whose, worth.filter(|worth| *worth > 0.0)?)))
}

/// Finds that random actions, held or not, reach the goal where the trained policy no longer does.
fn below_chance(evidence: &Evidence) -> Option<LearningFinding> {
    let policy = evidence.played(Seat::Policy)?;
    let own = policy.mean_return()?;
    let (_, worth) = worth(evidence)?;
    let chance =
        [Seat::Random, Seat::Chaos].into_iter().filter_map(|seat| evidence.played(seat)).filter_map(|played| {
            let wins = played.ended().filter(|episode| episode.success || episode.total() > 0.0).count();
            Some((played.seat, played.mean_return()?, wins))
        });
    let (best, earned, wins) = chance.max_by(|one, other| one.1.total_cmp(&other.1))?;
    let is_clear = wins >= FEWEST_OF_CHANCE && policy.ended().count() >= FEWEST_OF_A_KIND;
    (is_clear && earned - own > CLEARLY_LESS * worth && own < CLEARLY_LESS * worth).then(|| {
        LearningFinding::new(
            Sign::BelowChance,
            format!(
                "{} earn {} and the policy {}; returns: {}",
                best.name(),
                readable(earned),
                readable(own),
                returns(evidence)
            ),
            "the policy has settled on something else before it knew the goal, which chance still reaches",
            &[Advice::RaiseEntropy, Advice::LowerRate, Advice::UseRecordings],
        )
    })
}

fn rare(evidence: &Evidence) -> Option<LearningFinding> {
    let curves = evidence.curves.as_ref()?;
    let episodes = curves.last(crate::metrics_log::EPISODES).filter(|episodes| *episodes >= FEWEST_EPISODES)?;
    let curve = curves.settled_or_all(crate::metrics_log::EPISODIC_RETURN);
    // Of the last third: a lucky window of the first episodes, of which the won ones end first, says little.
    let best = curve[curve.len() * 2 / 3..].iter().map(|(_, value)| *value).fold(f64::NEG_INFINITY, f64::max);
    let (whose, worth) = worth(evidence)?;
    (best.is_finite() && best < RARE * worth).then(|| {
        LearningFinding::new(
            Sign::RareReward,
            format!(
                "the best mean return in the last third of {} episodes is {}, under {} of {whose} {}",
                whole(episodes),
                readable(best),
                percent(RARE),
                readable(worth)
            ),
            "the policy does not get to the reward by chance",
            &[Advice::UseRecordings, Advice::AskDemonstrator, Advice::BeCurious, Advice::TrainLonger],
        )
    })
}

fn idling(evidence: &Evidence) -> Option<LearningFinding> {
    let nothing = evidence.played(Seat::Idle)?.mean_return().filter(|earned| *earned > 0.0)?;
    // Without a demonstrator it is not known what good play earns: random walkers fall, and pay for standing is no fault.
    let worth = evidence.played(Seat::Demonstrator).and_then(Played::mean_return)?;
    let success = evidence.played(Seat::Idle).and_then(Played::success).unwrap_or_default();
    (success < 0.5 && nothing >= MOST_FOR_NOTHING * worth).then(|| {
        LearningFinding::new(
            Sign::IdlingPays,
            format!("returns: {}", returns(evidence)),
            "the game pays for each tick, so an agent that waits earns as much as one that plays",
            &[Advice::PayGoal, Advice::MeasureBots],
        )
    })
}

/// Returns the mean ticks of a player's episodes.
fn ticks_of(played: &Played) -> f64 {
    mean(played.ended().map(|episode| episode.ticks() as f64)).unwrap_or_default()
}

/// Finds that episodes which are cut off earn more than those that are won, over all players.
fn waiting(evidence: &Evidence) -> Option<LearningFinding> {
    let ended = || evidence.played.iter().flat_map(Played::ended);
    let won = ended().filter(|episode| episode.success);
    let cut = ended().filter(|episode| !episode.success && episode.end == Some(EpisodeEnd::Truncated));
    let (won, cut): (Vec<_>, Vec<_>) = (won.collect(), cut.collect());
    if won.len() < FEWEST_OF_A_KIND || cut.len() < FEWEST_OF_A_KIND {
        return None;
    }
    let earned = |of: &[&PlayedEpisode]| mean(of.iter().map(|episode| episode.total()));
    let ticks = |of: &[&PlayedEpisode]| mean(of.iter().map(|episode| episode.ticks() as f64));
    let (for_winning, for_waiting) = (earned(&won)?, earned(&cut)?);
    if for_waiting <= 0.0 || for_winning >= MOST_FOR_NOTHING * for_waiting {
        return None;
    }
    let words = |of: &[&PlayedEpisode], earned: f64| {
        Some(format!("{} earn {} in {} ticks", of.len(), readable(earned), readable(ticks(of)?)))
    };
    Some(LearningFinding::new(
        Sign::IdlingPays,
        format!(
            "of all episodes on the mean, the won {}, and the {} that were cut off",
            words(&won, for_winning)?,
            words(&cut, for_waiting)?
        ),
        "the game pays for each tick, so an agent that stays away from the goal earns more than one that wins",
        &[Advice::PayGoal, Advice::MeasureBots],
    ))
}

fn against(evidence: &Evidence) -> Option<LearningFinding> {
    let demonstrator = evidence.played(Seat::Demonstrator)?;
    let (worth, random) = (demonstrator.mean_return()?, evidence.played(Seat::Random)?.mean_return()?);
    let wins = demonstrator.success().unwrap_or_default();
    // A game that goes on until it is lost has no wins: there the better player is the one that lasts longer.
    let lasts = || ticks_of(demonstrator) > LONGER * evidence.played(Seat::Random).map_or(0.0, ticks_of);
    (worth < random - 0.1 * random.abs().max(1e-6) && (wins > 0.0 || lasts())).then(|| {
        let words = match wins > 0.0 {
            true => format!("the demonstrator wins {} of its episodes", percent(wins)),
            false => format!("the demonstrator lasts {} ticks on the mean", whole(ticks_of(demonstrator))),
        };
        LearningFinding::new(
            Sign::RewardAgainst,
            format!("{words}; returns: {}", returns(evidence)),
            "the reward has the wrong sign, or its penalties outweigh the goal",
            &[Advice::PayGoal],
        )
    })
}

fn scale(evidence: &Evidence) -> Option<LearningFinding> {
    let (_, is_normalised) = discount_and_norm(&evidence.experiment);
    let rewards = evidence.played.iter().flat_map(|played| &played.episodes).flat_map(|episode| &episode.rewards);
    let largest = rewards.fold(0.0_f32, |most, reward| most.max(reward.abs()));
    (!is_normalised && largest > LARGEST_REWARD).then(|| {
        LearningFinding::new(
            Sign::RewardScale,
            format!("a reward of {} in one tick; returns: {}", readable(f64::from(largest)), returns(evidence)),
            "rewards far from 1 are not normalised, so the critic's loss drowns the policy's",
            &[Advice::NormaliseRewards, Advice::ScaleInGame],
        )
    })
}

/// Compares the horizon with the time that the demonstrator takes to its first reward.
fn horizon(evidence: &Evidence) -> Option<LearningFinding> {
    let (gamma, _) = discount_and_norm(&evidence.experiment);
    let live = evidence.played(Seat::Demonstrator).into_iter().flat_map(|played| &played.episodes);
    let replayed = evidence.recordings.iter().flat_map(replayed_episodes);
    let mut times: Vec<usize> = live.chain(replayed).filter_map(PlayedEpisode::first_reward).collect();
    if times.is_empty() {
        let recorded = evidence.recordings.iter().flat_map(|set| &set.episodes);
        times = recorded.filter_map(|episode| episode.first_reward()).collect();
    }
    let ahead = 1.0 / (1.0 - gamma).max(1e-9);
    let lengths = evidence.played.iter().flat_map(|played| &played.episodes).map(PlayedEpisode::ticks);
    let (time, length) = (median(times), median(lengths.collect()));
    let value = time.map(|time| libm::pow(gamma, time as f64));
    let words = match (time.zip(value), length) {
        (Some((time, value)), _) if value < SMALLEST_VALUE => format!(
            "the demonstrator is rewarded after {} ticks, when γ = {gamma} leaves {} of the reward",
            whole(time as f64),
            readable(value)
        ),
        (_, Some(length)) if ahead < SHORTEST_HORIZON && length as f64 > LONG_IN_HORIZONS * ahead => format!(
            "γ = {gamma} looks {} ticks ahead, and half of the played episodes have {} or more",
            readable(ahead),
            whole(length as f64)
        ),
        _ => return None,
    };
    Some(LearningFinding::new(
        Sign::ShortHorizon,
        words,
        "the reward does not reach the actions that lead there",
        &[Advice::LookAhead],
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{evidence, played};

    fn player(seat: Seat, reward: f32, end: Option<EpisodeEnd>) -> Played {
        let mut played = played(seat, 40, |tick| (vec![tick as f32], 0, if tick == 39 { reward } else { 0.0 }));
        let success = end.is_some_and(EpisodeEnd::is_success);
        (played.episodes[0].end, played.episodes[0].success) = (end, success);
        played
    }

    fn signs(played: &[Played], settings: &str) -> Vec<Sign> {
        let mut evidence = evidence("ppo", settings);
        evidence.played = played.to_vec();
        check(&evidence).into_iter().map(|finding| finding.sign).collect()
    }

    const CUT: Option<EpisodeEnd> = Some(EpisodeEnd::Truncated);
    const WON: Option<EpisodeEnd> = Some(EpisodeEnd::WON);

    #[test]
    fn a_demonstrator_that_earns_more_than_the_rest_is_healthy() {
        let players =
            [player(Seat::Random, 0.0, CUT), player(Seat::Idle, 0.0, CUT), player(Seat::Demonstrator, 1.0, WON)];
        assert_eq!(signs(&players, ""), []);
    }

    #[test]
    fn a_game_that_pays_more_for_waiting_than_for_a_win_is_found() {
        // Random actions win after a few ticks or are cut off after many; idle ones die at once.
        let pays_ticks = |won: usize| {
            let mut random = player(Seat::Random, 0.0, CUT);
            let episode = PlayedEpisode { rewards: vec![1.0; 40], ..random.episodes[0].clone() };
            let win = PlayedEpisode { rewards: vec![1.0; 10], end: WON, success: true, ..episode.clone() };
            random.episodes = [vec![episode; 4], vec![win; won]].concat();
            let mut idle = player(Seat::Idle, 0.0, CUT);
            idle.episodes[0].rewards = vec![1.0; 4];
            [random, idle]
        };
        assert_eq!(signs(&pays_ticks(4), ""), [Sign::IdlingPays]);
        assert_eq!(signs(&pays_ticks(3), ""), [], "too few to compare");
    }

    #[test]
    fn a_reward_that_punishes_those_who_last_is_found_where_nobody_can_win() {
        let lost = Some(EpisodeEnd::Terminated { success: false });
        let lasting = player(Seat::Demonstrator, -5.0, CUT);
        let mut random = player(Seat::Random, 0.0, lost);
        random.episodes[0].rewards = vec![0.0, -1.0];
        assert_eq!(signs(&[random, lasting.clone()], ""), [Sign::RewardAgainst]);
        // One that dies as early as random actions is a bad demonstrator.
        assert_eq!(signs(&[player(Seat::Random, -1.0, lost), lasting], ""), []);
    }

    #[test]
    fn a_game_that_never_pays_is_found() {
        let players = [player(Seat::Random, 0.0, CUT), player(Seat::Demonstrator, 0.0, WON)];
        assert_eq!(signs(&players, ""), [Sign::NoReward]);
        assert_eq!(signs(&[player(Seat::Random, 0.0, CUT)], ""), [Sign::NoReward]);
    }

    #[test]
    fn a_demonstrator_that_is_always_cut_off_has_too_little_time() {
        let players = [player(Seat::Random, 0.0, CUT), player(Seat::Demonstrator, 0.0, CUT)];
        assert_eq!(signs(&players, "")[0], Sign::ShortTime);
    }

    #[test]
    fn nobody_gets_anywhere_before_a_limit_that_is_too_short_for_all() {
        // All are paid a little for being near, and cut off in the same tick.
        let near = |seat: Seat, reward: f32| player(seat, reward, CUT);
        let players =
            [near(Seat::Random, 0.55), near(Seat::Chaos, 0.54), near(Seat::Idle, 0.55), near(Seat::Demonstrator, 0.57)];
        assert_eq!(signs(&players, ""), [Sign::ShortTime], "and not that idling pays");
        let players =
            [near(Seat::Random, 0.55), near(Seat::Chaos, 0.54), near(Seat::Idle, 0.2), near(Seat::Demonstrator, 0.57)];
        assert_eq!(signs(&players, ""), [], "idling earns less");
    }

    #[test]
    fn a_policy_that_does_worse_than_chance_is_not_said_to_need_luck() {
        let several = |seat: Seat, wins: usize| {
            let mut all = player(seat, 0.0, CUT);
            let (lost, won) = (all.episodes[0].clone(), player(seat, 1.0, WON).episodes[0].clone());
            all.episodes = [vec![won; wins], vec![lost; 8 - wins]].concat();
            all
        };
        let mut evidence = evidence("ppo", "");
        let mut curves = crate::runs::RunCurves::default();
        for update in 1..=9 {
            let metrics = [(crate::metrics_log::EPISODES, 300.0), (crate::metrics_log::EPISODIC_RETURN, 0.001)];
            curves.push(1000 * update, metrics.into_iter());
        }
        evidence.curves = Some(curves);
        let mut check_with = |chance: usize| {
            evidence.played =
                vec![several(Seat::Chaos, chance), several(Seat::Policy, 0), several(Seat::Demonstrator, 8)];
            check(&evidence).into_iter().map(|finding| finding.sign).collect::<Vec<_>>()
        };
        assert_eq!(check_with(3), [Sign::BelowChance]);
        assert_eq!(check_with(0), [Sign::RareReward]);
        // Without a demonstrator a recorded win says what there is to earn.
        evidence.played = vec![several(Seat::Chaos, 0), several(Seat::Policy, 0)];
        let mut set = crate::diagnose::testing::recorded(1, true);
        for episode in &mut set.episodes {
            std::sync::Arc::make_mut(&mut episode.episode).rewards[19] = 1.0;
        }
        evidence.recordings = Some(set);
        let found = check(&evidence);
        assert_eq!(found[0].sign, Sign::RareReward);
        assert!(found[0].evidence.ends_with("a recorded win's 1.000"), "{:?}", found[0]);
    }

    #[test]
    fn pay_for_nothing_and_pay_against_the_goal_are_found() {
        let players =
            [player(Seat::Random, 0.1, CUT), player(Seat::Idle, 1.0, CUT), player(Seat::Demonstrator, 1.0, WON)];
        assert_eq!(signs(&players, ""), [Sign::IdlingPays]);
        let players = [player(Seat::Random, 0.0, CUT), player(Seat::Demonstrator, -1.0, WON)];
        assert_eq!(signs(&players, ""), [Sign::RewardAgainst]);
    }

    #[test]
    fn large_rewards_count_without_a_normaliser() {
        let players = [player(Seat::Random, 0.0, CUT), player(Seat::Demonstrator, 1000.0, WON)];
        assert_eq!(signs(&players, "ppo: (norm_reward: false)"), [Sign::RewardScale]);
        assert_eq!(signs(&players, ""), []);
    }

    #[test]
    fn a_reward_beyond_the_horizon_is_found() {
        let players = [player(Seat::Random, 0.0, CUT), player(Seat::Demonstrator, 1.0, WON)];
        assert_eq!(signs(&players, "ppo: (gamma: 0.8)"), [Sign::ShortHorizon], "0.8^40 is 1.3e-4");
        assert_eq!(signs(&players, "ppo: (gamma: 0.9)"), [], "0.9^40 is 0.015");
        let unpaid = [player(Seat::Random, 0.5, CUT)];
        assert_eq!(signs(&unpaid, "ppo: (gamma: 0.8)"), [Sign::ShortHorizon], "40 ticks are eight horizons");
    }
}
