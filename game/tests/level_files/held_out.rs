//! Tests of held-out levels that are files.

use playbot::prelude::*;
use playbot_games::{coinrun::CoinRun, maze2d::Maze2d};
use playbot_harness::{
    game::level_designs,
    held_out::{HeldOut, seen_by_training},
    inspect::LevelRequest,
    level_files::level_files_mode,
};
use playbot_learner::SeenLevels;

#[test]
fn a_copy_of_a_held_out_level_is_found_under_any_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, coin: usize| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("below")).expect("writable");
        let row: String = (0..8).map(|x| if x == coin { 'C' } else { '.' }).collect();
        std::fs::write(path, format!("{{ \"rows\": [\"########\", \"{row}\"] }}")).expect("writable");
    };
    for (name, coin) in [("train/a.json", 3), ("train/b.json", 5), ("train/c.json", 6), ("test/z.json", 5)] {
        write(name, coin);
    }
    let game = CoinRun::default();
    let split = |name: &str| -> LevelSplit {
        let mode = format!("{}/{name}/*.json", level_files_mode(&folder.path().to_string_lossy()));
        let split: LevelSplit = mode.parse().expect("files");
        split.check(&game).expect("levels");
        split
    };
    let (train, test) = (split("train"), split("test"));
    let hidden = HeldOut::new(&game, &test);
    assert_eq!(hidden.first_of(&train), Some(1));
    assert!(!hidden.contains(&train.mode, 0) && hidden.contains(&train.mode, 1) && !hidden.contains(&train.mode, 2));
    assert!(!hidden.contains("hard", 0));

    // A policy that was trained on files has seen their contents of that time, even if they change.
    let seen = seen_by_training(&game, &train);
    assert!(seen.levels.is_empty() && seen.level_files.len() == 3, "{seen:?}");
    std::fs::remove_dir_all(folder.path().join("train")).expect("removable");
    let shown = hidden.shown_by(Some(&seen)).expect("it has seen the copy");
    assert!(shown.contains("test/*.json:0, among others"), "{shown}");
    let others = SeenLevels {
        level_files: seen.level_files.iter().copied().filter(|hash| test_hash(&game, &test) != *hash).collect(),
        ..seen
    };
    assert_eq!((others.level_files.len(), hidden.shown_by(Some(&others))), (2, None));
}

fn test_hash(game: &CoinRun, test: &LevelSplit) -> u64 {
    level_designs(game, &test.mode).expect("files").hash(0).expect("a file")
}

#[test]
fn what_a_file_says_that_it_has_seen_is_not_believed_beyond_reason() {
    let game = CoinRun::default();
    let test = LevelSplit { mode: "hard".to_owned(), first: 64, last: 127 };
    let hidden = HeldOut::new(&game, &test);
    let shown = |levels: &[&str]| {
        let levels = levels.iter().map(|&range| range.to_owned()).collect();
        hidden.shown_by(Some(&SeenLevels { game: "coinrun".to_owned(), levels, ..SeenLevels::default() }))
    };
    assert_eq!(shown(&["hard:0..63"]), None);
    assert_eq!(shown(&["hard:127..130"]).as_deref(), Some("hard:127..130"));
    assert_eq!(shown(&["hard:0..63", "hard:90..90"]).as_deref(), Some("hard:90..90, among others"));
    // No pattern is looked for on the disk, and no missing mode or range is taken for one.
    assert_eq!(shown(&["files:/**", "files:/**/*.json:0..3", "no-such-mode:64..70", "hard", "", "hard:9..3"]), None);
    let other_game =
        SeenLevels { game: "maze2d".to_owned(), levels: vec!["hard:64..127".to_owned()], ..SeenLevels::default() };
    assert_eq!((hidden.shown_by(Some(&other_game)), hidden.shown_by(None)), (None, None));

    // Small mazes are also found by their walls, but not among millions.
    let game = Maze2d::default();
    let mazes = |first, last| LevelSplit { mode: "random+size=5x5".to_owned(), first, last };
    let test = mazes(0, 63);
    let hidden = HeldOut::new(&game, &test);
    let seen = |ranges: &[LevelSplit]| {
        let levels = ranges.iter().map(LevelSplit::to_string).collect();
        SeenLevels { game: "maze2d".to_owned(), levels, ..SeenLevels::default() }
    };
    let (few, millions) = (mazes(1000, 1999), mazes(1 << 20, (1 << 24) - 1));
    assert_eq!(hidden.shown_by(Some(&seen(std::slice::from_ref(&few)))), None, "the numbers differ");
    let alike = hidden.seen_in(&seen(std::slice::from_ref(&few)), &|_, _| {});
    assert!(alike.len() > 32 && alike.iter().all(|level| test.contains(&test.mode, *level)), "{alike:?}");
    assert!(alike.iter().all(|level| hidden.resembles(&test.mode, *level)));
    assert!(hidden.seen_in(&seen(std::slice::from_ref(&millions)), &|_, _| {}).is_empty(), "that would take long");
    assert_eq!(hidden.seen_in(&seen(&[millions.clone(), few]), &|_, _| {}), alike, "later ranges are compared");
    let numbers = seen(&[millions, mazes(63, 64)]);
    assert_eq!(hidden.shown_by(Some(&numbers)).as_deref(), Some("random+size=5x5:63..64, among others"));
}

#[test]
fn levels_of_a_seen_layout_are_found_under_another_number_and_as_a_file() {
    let game = CoinRun::default();
    let hard = |first, last| LevelSplit { mode: "hard".to_owned(), first, last };
    // Counted from the JSON of the levels by another program.
    let test = hard(64, 1087);
    let hidden = HeldOut::new(&game, &test);
    let seen = |ranges: &[&str]| {
        let levels = ranges.iter().map(|&range| range.to_owned()).collect();
        let seen = SeenLevels { game: "coinrun".to_owned(), levels, ..SeenLevels::default() };
        hidden.seen_in(&seen, &|_, _| {}).len()
    };
    assert_eq!([seen(&["hard:0..63"]), seen(&["easy:0..499"]), seen(&["easy:0..499", "hard:0..63"])], [46, 222, 224]);
    assert!(!hidden.contains("hard", 0) && hidden.contains("hard", 64));

    // Levels 81 and 142 differ in their pictures only.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("81.json");
    let request = LevelRequest { mode: Some("hard"), level: Some(81), map: None, file: None, picture: false };
    std::fs::write(&path, game.show_level(&request).expect("a level").json).expect("writable");
    let files: LevelSplit = level_files_mode(&path.to_string_lossy()).parse().expect("a file");
    files.check(&game).expect("a level");
    let drawn = seen_by_training(&game, &files);
    let test = hard(80, 142);
    let hidden = HeldOut::new(&game, &test);
    let known = hidden.seen_in(&drawn, &|_, _| {});
    assert!(known.contains(&81) && known.contains(&142) && !known.contains(&80), "{known:?}");
    assert_eq!((hidden.shown_by(Some(&drawn)), hidden.first_of(&files)), (None, None));
    let twin = hard(142, 142);
    let twin = HeldOut::new(&game, &twin);
    assert!(twin.are_all_in(&files) && twin.are_all_in(&hard(81, 81)) && !twin.are_all_in(&hard(82, 82)));
}
