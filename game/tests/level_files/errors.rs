//! Tests that mistakes in a level file are reported with their line.

use playbot::prelude::*;
use playbot_games::{antmaze::AntMaze, coinrun::CoinRun, maze2d::Maze2d};
use playbot_harness::level_files::level_files_mode;

/// Checks that a text is refused on this line, with these words.
fn assert_refused(game: &dyn Game, text: &str, line: usize, words: &str) {
    let error = game.parse_level(text).expect_err(text);
    assert_eq!(error.line, Some(line), "{}: {text}", error.what);
    assert!(error.what.contains(words), "{} does not say `{words}`: {text}", error.what);
}

#[test]
fn mistakes_in_levels_of_coinrun_have_a_line() {
    let game = CoinRun::default();
    let rows = |rows: &str, more: &str| format!("{{\n\"rows\": [\n{rows}\n]{more}\n}}");
    let sound = "\"#####\",\n\"#..C#\"";
    assert!(game.parse_level(&rows(sound, "")).is_ok());
    for (text, line, words) in [
        (String::new(), 1, "EOF"),
        (rows("\"###\" \"#C#\"", ""), 3, "expected `,`"),
        ("{\n\"coin\": [1, 1]\n}".to_owned(), 3, "missing field `rows`"),
        (rows("", ""), 2, "no tiles"),
        (rows("\"\"", ""), 2, "no tiles"),
        (rows("\"#####\",\n\"#.C#\"", ""), 4, "row 1 has 4 tiles and row 0 has 5"),
        (rows("\"#####\",\n\"#.?C#\"", ""), 4, "unknown letter `?` at [2, 1]"),
        (rows("\"#####\",\n\"#.SC#\"", ""), 4, "lists of their own"),
        (rows("\"#####\",\n\"#...#\"", ""), 2, "no coin"),
        (rows("\"#####\",\n\"#C.C#\"", ""), 4, "a second coin `C` at [3, 1]"),
        (rows("\"#####\",\n\"#AAC#\"", ""), 4, "a second start"),
        (rows("\"#####\",\n\"#.AC#\"", ""), 4, "players start at [1, 1]"),
        (rows("\"#####\",\n\"##.C#\"", ""), 4, "the start [1, 1] is inside a wall"),
        (rows("\"#####\",\n\"#...#\"", ",\n\"coin\": [4, 1]"), 6, "the coin [4, 1] is inside a wall"),
        (rows("\"#####\",\n\"#..^#\"", ",\n\"coin\": [3, 1]"), 6, "inside lava"),
        (rows("\"#####\",\n\"#...#\"", ",\n\"coin\": [64, 1]"), 6, "outside the level"),
        (rows(sound, ",\n\"coin\": [2, 1]"), 6, "the C of the rows is at [3, 1]"),
        (rows(sound, ",\n\"sawz\": []"), 6, "unknown field `sawz`"),
        (rows(sound, ",\n\"saws\": [\n[2, 1],\n[2, -1]\n]"), 8, "the saw at [2, -1] is outside"),
        (rows(sound, ",\n\"enemies\": [[2, 1, 2]]"), 6, "direction 2"),
        (rows(sound, ",\n\"crates\": [[2, 1]],\n\"crate_sprites\": []"), 7, "0 entries for 1 bodies"),
        (rows(sound, ",\n\"crates\": [[2, 1]],\n\"crate_sprites\": [4]"), 7, "choose one from 0 to 3"),
        (rows(sound, ",\n\"ground_theme\": 6"), 6, "choose one from 0 to 5"),
        (rows(sound, ",\n\"background_offset\": 1.5"), 6, "between 0 and 1"),
        (rows(sound, ",\n\"tie_breaks\": \"12\""), 6, "256 digits"),
        (rows(sound, ",\n\"saws\": [[2, 1]],\n\"order\": \"e\""), 7, "one letter for each body"),
        (rows(sound, ",\n\"mode\": \"extreme\""), 6, "unknown variant `extreme`"),
        (rows(&["\"#A..C\""; 65].join(",\n"), ""), 2, "at most 64"),
        (rows(&format!("\"{}\"", ".".repeat(65)), ""), 2, "at most 64"),
    ] {
        assert_refused(&game, &text, line, words);
    }
}

#[test]
fn mistakes_in_mazes_have_a_line() {
    let rows = |rows: &str, more: &str| format!("{{\n\"rows\": [\n{rows}\n]{more}\n}}");
    let sound = "\"#####\",\n\"#SOG#\",\n\"#####\"";
    for game in [&Maze2d::default() as &dyn Game, &AntMaze] {
        assert!(game.parse_level(&rows(sound, "")).is_ok());
        for (text, line, words) in [
            (rows("", ""), 2, "the maze is empty"),
            (rows("\"####\",\n\"#OG#\",\n\"####\"", ""), 2, "no start"),
            (rows("\"####\",\n\"#SO#\",\n\"####\"", ""), 2, "no goal"),
            (rows("\"#####\",\n\"#SSG#\",\n\"#####\"", ""), 4, "two starts"),
            (rows("\"####\",\n\"#SG#\",\n\"###\"", ""), 5, "row 2 has 3 cells"),
            (rows("\"####\",\n\"#S?G\",\n\"####\"", ""), 4, "`?` means nothing"),
            (rows("\"####\",\n\"#SG#\",\n\"##O#\"", ""), 5, "the border is open at (2, 2)"),
            (rows(sound, ",\n\"goal\": [1, 2]"), 4, "two goals, (1, 3) and (1, 2)"),
            (rows("\"####\",\n\"#SO#\",\n\"####\"", ",\n\"goal\": [0, 1]"), 3, "(0, 1) is not a free cell"),
            (rows(sound, ",\n\"gaol\": [1, 2]"), 7, "unknown field `gaol`"),
            (rows(sound, ",\n\"rules\": \"sprse\""), 7, "did you mean `sparse`?"),
            (rows(&format!("\"{}\"", "#".repeat(4097)), ""), 2, "too large"),
        ] {
            assert_refused(game, &text, line, words);
        }
    }
    let ball = rows(sound, ",\n\"ball\": [1.0, 2.0, 0.0, 0.0]");
    assert_refused(&Maze2d::default(), &ball, 7, "outside the start (1, 1)");
    for (more, words) in [
        (",\n\"goal_at\": [0.0, 0.0]", "not in the goal (1, 3)"),
        (",\n\"origin\": [0, 0]", "(0, 0) is not a free cell"),
        (",\n\"ant\": { \"qpos\": [0], \"qvel\": [0] }", "invalid length 1"),
    ] {
        assert_refused(&AntMaze, &rows(sound, more), 7, words);
    }
    let numbers =
        |count: usize, first: &str| [first].into_iter().chain(vec!["0"; count - 1]).collect::<Vec<_>>().join(",");
    let ant =
        |first: &str| format!(",\n\"ant\": {{ \"qpos\": [{}], \"qvel\": [{}] }}", numbers(15, first), numbers(14, "0"));
    assert_refused(&AntMaze, &rows(sound, &ant("9")), 7, "not in the start (1, 1)");
    assert_refused(&AntMaze, &rows(sound, &ant("0")), 7, "of length 0");
}

#[test]
fn a_mode_of_files_is_checked_file_by_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let game = CoinRun::default();
    let mode = format!("{}/*.json", level_files_mode(&folder.path().to_string_lossy()));
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("writable");
    let error = |mode: &str| game.check_mode(mode).expect_err(mode).to_string();
    assert!(error(&mode).contains("matches no file"), "an empty range is never right");
    write("a.json", "{\"rows\": [\"####\", \"#.C#\"]}");
    game.check_mode(&mode).expect("a level");
    write("b.json", "{\"rows\":\n[\"####\",\n\"#..#\"]}");
    let words = error(&mode);
    assert!(words.contains("b.json, line 2: the level has no coin"), "{words}");
    write("b.json", "{\"rows\": [\"####\", \"#C.#\"]}");
    let split: LevelSplit = mode.parse().expect("two files");
    assert_eq!(split.len(), 2);
    split.check(&game).expect("two levels");
    let beyond: LevelSplit = format!("{mode}:0..2").parse().expect("a range");
    let words = beyond.check(&game).expect_err("two files").to_string();
    assert!(words.contains("no level 2") && words.contains("2 files"), "{words}");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("nowhere", folder.path().join("c.json")).expect("a link");
        let words = error(&mode);
        assert!(words.contains("cannot read") && words.contains("c.json"), "{words}");
    }
}
