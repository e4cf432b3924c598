//! Whether a level of CoinRun can be won at all.

use std::sync::Arc;

use playbot_lab::proof::LevelProof;

use super::{level::Level, planner::coin_is_unreachable, sim::Sim};

/// Unsolvable where [`coin_is_unreachable`] says so of the level's start: a search that allows all that the rules do, and
/// more, has ended without the coin. Nothing is proved of other levels, since that search knows neither enemies nor time.
pub(super) fn prove(level: Arc<Level>) -> LevelProof {
    if !coin_is_unreachable(&Sim::new(level)) {
        return LevelProof::Unknown;
    }
    let why = "the coin cannot be reached: a search through all that the rules allow, in which enemies do no harm and time is \
               never up, ended without it"
        .to_owned();
    LevelProof::Unsolvable { why }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{generator::generate, level::Mode};

    #[test]
    fn generated_levels_are_not_called_unsolvable() {
        for seed in 0..50 {
            assert_eq!(prove(Arc::new(generate(Mode::Hard, seed))), LevelProof::Unknown, "{seed}");
        }
    }

    #[test]
    fn a_coin_behind_a_wall_that_is_too_high_is_out_of_reach() {
        let tower = "#...#.....#\n".repeat(29);
        let text = format!("#.........#\n{tower}#A..#....C#\n#=========#\n");
        let level = Level::from_text(&text).expect("a valid picture");
        assert!(prove(Arc::new(level)).why_unsolvable().is_some_and(|why| why.contains("coin")));
    }
}
