//! The search for unmutated levels: to plant defects into, and to compare with.

use bevy_playbot::{episode::EpisodeEnd, vision::ObservationConfig};

use super::{error::BugError, make::Source, set::SoundLevels};
use crate::{
    eval::{EpisodeResult, EvalPlan, Player, evaluate},
    held_out::HeldOut,
    split::LevelSplit,
};

/// Most levels and most arenas that are played at a time. They do not depend on the number of threads, so that it
/// changes no result.
const CHUNK: u64 = 128;
const ARENAS: u32 = 32;
const WORLDS: u32 = 8;
/// The search gives up after this many times the levels that are needed.
const MOST_TRIES: u64 = 8;

/// The best end that a demonstrator can reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GoodEnd {
    /// The level is solved.
    Won,
    /// The time limit was reached, in a game that cannot be won.
    Lasted,
    /// Any end, in a game that always ends by losing.
    Any,
}

impl GoodEnd {
    /// Returns the best end among some episodes.
    fn of(results: &[EpisodeResult]) -> Self {
        if results.iter().any(|result| result.success) {
            Self::Won
        } else if results.iter().any(|result| result.end == EpisodeEnd::Truncated) {
            Self::Lasted
        } else {
            Self::Any
        }
    }

    fn is(self, result: &EpisodeResult) -> bool {
        match self {
            Self::Won => result.success,
            Self::Lasted => result.end == EpisodeEnd::Truncated,
            Self::Any => true,
        }
    }
}

/// Returns `wanted` levels from this number on, in their order. They are held out from training, and the game's
/// demonstrator, if there is one, plays them to a good end.
pub(super) fn sound_levels(
    source: &Source,
    start: u64,
    wanted: u64,
    threads: usize,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Vec<u64>, BugError> {
    let game = source.game;
    let trained = source.trained.as_ref().map(|trained| HeldOut::new(game, trained));
    let is_new = |level: &u64| trained.as_ref().is_none_or(|trained| !trained.contains(&source.levels.mode, *level));
    let (mut found, mut good_end) = (Vec::new(), None);
    let (mut next, mut tried) = (start, 0);
    while (found.len() as u64) < wanted && next <= source.levels.last && tried < MOST_TRIES * wanted.max(CHUNK) {
        let missing = wanted - found.len() as u64;
        let count = (missing + missing / 4 + 4).min(CHUNK).min(source.levels.last - next + 1);
        let chunk = LevelSplit { mode: source.levels.mode.clone(), first: next, last: next + count - 1 };
        let good: Vec<u64> = match game.tools().bots.demonstrator() {
            None => chunk.levels().filter(is_new).collect(),
            Some(_) => {
                let results = play(source, &chunk, threads)?;
                let end = *good_end.get_or_insert_with(|| GoodEnd::of(&results));
                results.iter().filter(|result| end.is(result)).map(|result| result.level).filter(is_new).collect()
            }
        };
        let before = found.len();
        found.extend(good);
        found.truncate(usize::try_from(wanted).unwrap_or(usize::MAX));
        progress((found.len() - before) as u64);
        next += count;
        tried += count;
    }
    if found.is_empty() {
        let bot = game.tools().bots.demonstrator().unwrap_or("none").to_owned();
        return Err(BugError::NoBase { game: game.name().to_owned(), levels: source.levels.to_string(), bot });
    }
    if (found.len() as u64) < wanted {
        let (levels, count) = (source.levels.to_string(), found.len() as u64);
        return Err(BugError::TooFewLevels { game: game.name().to_owned(), levels, count, wanted });
    }
    Ok(found)
}

fn play(source: &Source, chunk: &LevelSplit, threads: usize) -> Result<Vec<EpisodeResult>, BugError> {
    let arenas = ARENAS.min(u32::try_from(chunk.len()).unwrap_or(ARENAS));
    let plan = EvalPlan {
        split: chunk.clone(),
        observation_config: ObservationConfig::default(),
        episodes_per_level: 1,
        seed: 0,
        arenas,
        worlds: WORLDS.min(arenas),
        threads,
    };
    Ok(evaluate(source.game, &Player::Demonstrator, &plan, |_| {})?)
}

/// Groups ordered numbers into ranges without gaps.
pub(super) fn ranges(game: &str, mode: &str, numbers: &[u64]) -> Vec<SoundLevels> {
    let ranges = LevelSplit::ranges(mode, numbers).into_iter();
    ranges.map(|range| SoundLevels { game: game.to_owned(), range }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_ranges_without_gaps() {
        let ranges: Vec<_> =
            ranges("a", "hard", &[3, 4, 5, 7, 9, 10]).iter().map(|sound| sound.range.to_string()).collect();
        assert_eq!(ranges, ["hard:3..5", "hard:7..7", "hard:9..10"]);
        assert!(super::ranges("a", "hard", &[]).is_empty());
    }

    #[test]
    fn a_good_end_is_the_best_that_there_is() {
        let result = |end: EpisodeEnd| EpisodeResult {
            level: 0,
            end,
            success: end.is_success(),
            ticks: 9,
            clipped: 0,
            total_reward: 0.0,
        };
        let [won, lost, out] = [EpisodeEnd::WON, EpisodeEnd::LOST, EpisodeEnd::Truncated].map(result);
        assert_eq!(GoodEnd::of(&[won, lost, out]), GoodEnd::Won);
        assert_eq!(GoodEnd::of(&[lost, out]), GoodEnd::Lasted);
        assert_eq!(GoodEnd::of(&[lost]), GoodEnd::Any);
        assert!(GoodEnd::Lasted.is(&out) && !GoodEnd::Lasted.is(&lost) && GoodEnd::Any.is(&lost));
    }
}
