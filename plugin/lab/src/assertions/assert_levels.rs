//! Assertions about levels without settings. [`LevelTest`] has these and more.

use super::level_test::LevelTest;
use crate::game::Game;

/// Asserts that each of these levels can be solved: the game's demonstrator, or else its first bot, reaches the goal.
///
/// # Panics
///
/// A level was not solved, or the levels cannot be tested: see [`LevelTest::assert_solvable`].
#[track_caller]
pub fn assert_levels_solvable(game: &dyn Game, levels: &str) {
    LevelTest::new(game, levels).assert_solvable();
}

/// Asserts that a bot of the game solves each of these levels. Other testers are named with [`LevelTest`].
///
/// # Panics
///
/// A level was not solved, or the levels cannot be tested: see [`LevelTest::assert_solved`].
#[track_caller]
pub fn assert_levels_solved_by(game: &dyn Game, bot: &str, levels: &str) {
    LevelTest::new(game, levels).bot(bot).assert_solved();
}

/// Asserts that levels have no findings: no default [detector](crate::detectors) reports anything while all bots of the
/// game play, the game does not panic, and no goal is proved to be out of reach. Levels need not be solved.
///
/// # Panics
///
/// Something was found, or the levels cannot be tested: see [`LevelTest::assert_no_findings`].
#[track_caller]
pub fn assert_no_findings(game: &dyn Game, levels: &str) {
    LevelTest::new(game, levels).assert_no_findings();
}

/// Asserts that each bot of the game repeats its episode bit for bit on each of these levels.
///
/// # Panics
///
/// An episode differed, or the levels cannot be tested: see [`LevelTest::assert_deterministic`].
#[track_caller]
pub fn assert_deterministic(game: &dyn Game, levels: &str) {
    LevelTest::new(game, levels).assert_deterministic();
}
