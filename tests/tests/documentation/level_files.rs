//! Tests that level files in documents are levels that bots solve.

use playbot::prelude::*;
use playbot_games::{coinrun::CoinRun, maze2d::Maze2d};
use playbot_harness::{
    eval::{EvalPlan, Player, evaluate},
    level_files::level_files_mode,
};
use playbot_tests::measuring::plan;

use super::blocks::{blocks, read};

#[test]
fn level_files_of_the_page_about_them_are_solved() {
    let text = read("docs/reference/level-formats.md");
    let levels: Vec<_> = blocks(&text).into_iter().filter(|block| block.language == "json").collect();
    let games = [&CoinRun { physics: false } as &dyn Game, &Maze2d { physics: false }];
    assert_eq!(levels.len(), games.len());
    let folder = tempfile::tempdir().expect("a folder");
    for (game, block) in games.into_iter().zip(levels) {
        let path = folder.path().join(format!("{}.json", game.name()));
        std::fs::write(&path, block.text).expect("writable");
        let split: LevelSplit = level_files_mode(&path.to_string_lossy()).parse().expect("a file");
        split.check(game).unwrap_or_else(|error| panic!("{error}"));
        let plan = EvalPlan { split, arenas: 1, worlds: 1, ..plan("hard:0..0") };
        let results = evaluate(game, &Player::Demonstrator, &plan, |_| {}).expect("sound");
        assert!(results.iter().all(|result| result.success), "line {}: {results:?}", block.line);
    }
}
