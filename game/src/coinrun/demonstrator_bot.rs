//! The planning bot as an agent of the game.

use crate::coinrun::{Sim, components::Levels, planner::Demonstrator, play::NOTHING};
use bevy::prelude::*;
use bevy_playbot::{bot::with_noise, fault::Faults, streams::AgentStreams};
use playbot_harness::prelude::*;

/// Plays by planning ahead with the exact rules.
///
/// It plans in a copy of its level, which it steps along with the game. The state hashes of the two are compared each
/// tick, so a game that adds to CoinRun's rules gets an error about it.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct DemonstratorBot {
    noise: f64,
    #[reflect(ignore)]
    planner: Demonstrator,
    #[reflect(ignore)]
    sim: Option<Sim>,
}

impl DemonstratorBot {
    /// Takes the probability with which its actions are replaced by uniformly random ones.
    pub fn new(noise: f64) -> Self {
        Self { noise, planner: Demonstrator::default(), sim: None }
    }
}

pub(super) fn start_episode(event: On<StartEpisode>, levels: Levels, mut bots: Query<&mut DemonstratorBot>) {
    // Levels that do not exist are reported where the arena is built.
    let Ok(mut bot) = bots.get_mut(event.entity) else { return };
    if let Ok(level) = levels.get(event.level) {
        bot.sim = Some(Sim::new(level));
        bot.planner = Demonstrator::default();
    }
}

pub(super) fn decide(
    mut bots: Query<(&Agent, &Control, &Episode, &StateHash, &mut DemonstratorBot, &mut AgentStreams, &mut Action)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, control, episode, hash, mut bot, mut streams, mut action) in &mut bots {
        if *control != Control::Bot || !episode.is_running() {
            continue;
        }
        let DemonstratorBot { noise, planner, sim } = &mut *bot;
        let Some(sim) = sim else { continue };
        if episode.tick > 0 && sim.state_hash() != hash.0 {
            faults.report(format!(
                "{}: the planner's copy of the level is in another state than the game; it knows the rules of CoinRun \
                 only",
                episode.moment(agent)
            ));
            continue;
        }
        let planned = ActionValue::Discrete(planner.act(sim).into());
        action.0 = with_noise(planned, &agent.actions, None, *noise, &mut streams.action);
    }
}

/// Steps the copies along, under any decider.
pub(super) fn follow(mut bots: Query<(&Control, &Episode, &Action, &mut DemonstratorBot)>) {
    for (control, episode, action, mut bot) in &mut bots {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if let Some(sim) = &mut bot.sim {
            sim.step(action.discrete().and_then(|index| u8::try_from(index).ok()).unwrap_or(NOTHING));
        }
    }
}

// The tie-breaking random numbers of a level, as text.

/// One bit for each of the first 1024 steps, as [`LevelParts`](crate::coinrun::LevelParts) has them.
type TieBreaks = [u64; 16];

/// Digits to a word.
const DIGITS: usize = 16;

/// Writes sixteen hexadecimal digits to a word, the first word first.
pub(super) fn to_text(tie_breaks: &TieBreaks) -> String {
    tie_breaks.iter().map(|word| format!("{word:016x}")).collect()
}

/// Parses the output of [`to_text`].
pub(super) fn from_text(text: &str) -> Option<TieBreaks> {
    let mut tie_breaks = TieBreaks::default();
    if text.len() != DIGITS * tie_breaks.len() || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    for (index, word) in tie_breaks.iter_mut().enumerate() {
        *word = u64::from_str_radix(&text[DIGITS * index..DIGITS * (index + 1)], 16).ok()?;
    }
    Some(tie_breaks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back() {
        let mut some = TieBreaks::default();
        (some[0], some[15]) = (1, u64::MAX);
        let text = to_text(&some);
        assert!(text.starts_with("0000000000000001") && text.ends_with("ffffffffffffffff"));
        assert_eq!(from_text(&text), Some(some));
        for bad in ["", "0", &text[1..], &text.replace('f', "g"), &text.replace('f', "+")] {
            assert_eq!(from_text(bad), None, "{bad}");
        }
    }
}
