//! Tests of assertions about level files, as in a game's own tests.

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use playbot_games::coinrun::CoinRun;
use playbot_harness::level_files::level_files_mode;

/// Writes a level with these rows, the first of which is the bottom one.
fn draw(folder: &Path, name: &str, rows: &[&str]) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().expect("below the folder")).expect("writable");
    fs::write(path, serde_json::json!({ "rows": rows }).to_string()).expect("writable");
}

fn levels(folder: &Path, pattern: &str) -> String {
    format!("{}/{pattern}", level_files_mode(&folder.to_string_lossy()))
}

fn message(assertion: impl FnOnce()) -> String {
    let panic = catch_unwind(AssertUnwindSafe(assertion)).expect_err("it must not hold");
    *panic.downcast::<String>().expect("words")
}

#[test]
fn sound_files_pass_and_a_walled_coin_is_reported_with_its_proof() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let game = CoinRun::default();
    draw(folder, "sound/flat.json", &["############", "#........C.#", "#..........#"]);
    draw(folder, "sound/step.json", &["############", "#....#...C.#", "#..........#", "#..........#"]);
    let free = "#....#....#";
    let walled = [&["###########", "#....#..C.#"][..], &[free; 20]].concat();
    draw(folder, "broken/walled.json", &walled);
    draw(folder, "broken/flat.json", &["############", "#........C.#", "#..........#"]);

    let sound = levels(folder, "sound/*.json");
    playbot::test(&game).levels(&sound).assert_levels_solvable();
    playbot::test(&game).levels(&sound).bot("search").assert_levels_solved();
    playbot::test(&game).levels(&sound).assert_deterministic();
    let test = playbot::test(&game).levels(&levels(folder, "broken/*.json")).without_detector("all");
    let test = test.findings_in(folder.join("found"));
    let found = message(|| test.assert_levels_solvable());
    assert!(found.starts_with("1 of 2 levels was not solved by any tester (`coinrun`, files:"), "{found}");
    assert!(found.contains("broken/walled.json: proved-unsolvable\n  search: solved 0 of 1"), "{found}");
    assert!(found.contains("\n  unreachable-goal: the coin cannot be reached: a search over all moves"), "{found}");
    assert!(found.contains("\n  an episode that failed:\n    playbot replay "), "{found}");
    assert!(found.contains("playbot test coinrun --levels ") && found.contains("files of levels are seen from "));
    // Each named file replays.
    let named: Vec<&str> = found.lines().filter_map(|line| line.strip_prefix("    playbot replay ")).collect();
    assert_eq!(named.len(), 2, "{found}");
    named.iter().for_each(|file| playbot::test(&game).assert_replays(file.trim_matches('\'')));
    fs::write(folder.join("broken/bad.json"), "{\n\"rows\": [\n\"####\",\n\"#?C#\"]}").expect("writable");
    let bad = message(|| playbot::test(&game).levels(&levels(folder, "broken/b*.json")).assert_levels_solvable());
    assert!(bad.contains("broken/bad.json, line 4: unknown letter `?`"), "{bad}");
}
