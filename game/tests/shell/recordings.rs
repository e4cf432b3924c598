//! Tests of recordings that are whole, torn, empty, or cannot be made.

use std::{fs, path::Path};

#[cfg(unix)]
use crate::program::on_full_disk;
use crate::program::{code, errors, lines, playbot, said};

fn record(folder: &Path, file: &str, more: &[&str]) {
    let output = playbot(folder, &[&["record", "coinrun", "--out", file], more].concat());
    assert_eq!(code(&output), 0, "{}", errors(&output));
}

#[test]
fn every_recording_is_verified_whatever_is_wrong_with_another() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    for file in ["a.demo", "b.demo", "z.demo"] {
        record(folder, file, &["--levels", "easy:0..1"]);
    }
    let bytes = fs::read(folder.join("b.demo")).expect("readable");
    fs::write(folder.join("b.demo"), &bytes[..bytes.len() - 5]).expect("writable");
    fs::write(folder.join("c.demo"), "not a recording").expect("writable");

    let all = playbot(folder, &["demo", "verify", ".", "--json"]);
    assert_eq!(code(&all), 1, "{}", errors(&all));
    let rows = lines(&all);
    let file = |index: usize| rows[index]["file"].as_str().expect("a path").trim_start_matches("./").to_owned();
    assert_eq!([0, 1, 2, 3].map(file), ["a.demo", "b.demo", "c.demo", "z.demo"]);
    assert_eq!([0, 3].map(|index| rows[index]["report"]["episodes"].as_u64()), [Some(2); 2]);
    assert!(rows[0]["error"].is_null() && rows[1]["report"].is_null() && rows[2]["report"].is_null());
    assert!(rows[1]["error"].as_str().is_some_and(|words| words.contains("playbot demo repair")), "{}", rows[1]);
    let words = said(&playbot(folder, &["demo", "verify", "."]));
    assert!(words.contains("b.demo: episode 1") && words.contains("z.demo: 2 episodes"), "{words}");

    let sound = playbot(folder, &["demo", "verify", "a.demo", "z.demo"]);
    assert_eq!((code(&sound), said(&sound).lines().count()), (0, 2));
    let missing = playbot(folder, &["demo", "verify", "a.demo", "nothing.demo"]);
    assert_eq!((code(&missing), said(&missing)), (3, String::new()), "a path that is not there is wrong usage");
}

#[test]
fn a_repair_that_saves_nothing_says_so() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "one.demo", &["--levels", "easy:0..0"]);
    let bytes = fs::read(folder.join("one.demo")).expect("readable");
    fs::write(folder.join("one.demo"), &bytes[..bytes.len() - 5]).expect("writable");
    let repaired = playbot(folder, &["demo", "repair", "one.demo", "--out", "none.demo"]);
    assert_eq!(code(&repaired), 1, "{}", errors(&repaired));
    assert!(said(&repaired).contains("no episode is whole, so nothing is kept"), "{}", said(&repaired));
}

#[test]
fn an_episode_that_was_cut_off_is_in_no_share() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "cut.demo", &["--levels", "easy:0..9", "--steps", "200"]);
    let listed = playbot(folder, &["demo", "ls", "cut.demo", "--json"]);
    let summary = lines(&listed).remove(0);
    assert_eq!((&summary["aborted"], &summary["failures"]), (&1.into(), &0.into()), "{summary}");
    assert_eq!(summary["success_share"], 1.0);
    let words = said(&playbot(folder, &["demo", "ls", "cut.demo"]));
    assert!(words.contains("100.0 % success (1 cut off)"), "{words}");
}

#[test]
fn a_game_without_demonstrator_is_not_recorded() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = playbot(folder.path(), &["record", "ant", "--out", "y.demo", "--steps", "100"]);
    assert_eq!(code(&output), 3, "{}", errors(&output));
    for words in ["`ant` has no demonstrator", "train a policy", "playbot play ant --record"] {
        assert!(errors(&output).contains(words), "{}", errors(&output));
    }
    assert!(!folder.path().join("y.demo").exists(), "no empty file is left");
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_no_wrong_usage() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = on_full_disk(folder.path(), 0, "record coinrun --levels easy:0..0 --out full.demo");
    assert_eq!(code(&output), 2, "{}", errors(&output));
    assert!(errors(&output).contains("cannot write the header"), "{}", errors(&output));
    fs::create_dir(folder.path().join("a.demo")).expect("writable");
    let output = playbot(folder.path(), &["record", "coinrun", "--levels", "easy:0..0", "--out", "a.demo", "--force"]);
    assert_eq!(code(&output), 3, "a folder was named: {}", errors(&output));
}

#[test]
fn recordings_of_many_testers_become_one_that_replays() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "ada.demo", &["--levels", "easy:0..1"]);
    record(folder, "bob.demo", &["--levels", "easy:2..4"]);
    let merged = playbot(folder, &["demo", "merge", "--out", "new/all.demo", "ada.demo", "bob.demo", "--json"]);
    assert_eq!(code(&merged), 0, "{}", errors(&merged));
    let report = lines(&merged).remove(0);
    let counts = [0, 1].map(|index| report["files"][index]["episodes"].as_u64());
    assert_eq!((report["episodes"].as_u64(), counts), (Some(5), [Some(2), Some(3)]), "{report}");
    let shown = playbot(folder, &["demo", "show", "new/all.demo", "--json"]);
    let levels: Vec<_> = lines(&shown).iter().map(|episode| episode["level"].as_u64()).collect();
    assert_eq!(levels, [0, 1, 2, 3, 4].map(Some), "in the order of the files");
    let verified = playbot(folder, &["demo", "verify", "new/all.demo"]);
    assert_eq!(code(&verified), 0, "{}", errors(&verified));
    assert!(
        said(&verified).contains("5 episodes") && said(&verified).contains("all as recorded"),
        "{}",
        said(&verified)
    );

    let again = playbot(folder, &["demo", "merge", "--out", "new/all.demo", "ada.demo"]);
    assert_eq!(code(&again), 3, "{}", errors(&again));
    assert!(errors(&again).contains("exists already; nothing was written"), "{}", errors(&again));
}

#[test]
fn a_copy_with_another_name_is_reported_by_a_merge() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "ada.demo", &["--levels", "easy:0..1"]);
    let labelled = playbot(folder, &["demo", "label", "ada.demo", "--player", "bob", "--out", "bob.demo"]);
    assert_eq!(code(&labelled), 0, "{}", errors(&labelled));
    let merged = playbot(folder, &["demo", "merge", "--out", "all.demo", "ada.demo", "bob.demo", "--json"]);
    assert_eq!(code(&merged), 0, "{}", errors(&merged));
    assert!(errors(&merged).contains("warning: 2 episodes are equal to ones of other files"), "{}", errors(&merged));
    assert_eq!(lines(&merged)[0]["equal_episodes"], 2);
}

#[test]
fn recordings_that_do_not_belong_together_are_not_merged() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "easy.demo", &["--levels", "easy:0..0"]);
    record(folder, "hard.demo", &["--levels", "hard:0..0"]);
    record(folder, "noisy.demo", &["--levels", "easy:0..0", "--noise", "0.5"]);
    let merge = |files: &[&str]| playbot(folder, &[&["demo", "merge", "--out", "all.demo"], files].concat());
    for (files, words) in [
        (&["easy.demo", "hard.demo"][..], "mode `hard`"),
        (&["easy.demo", "noisy.demo"], "`noise` is 0.5, but 0.0 in easy.demo: put both into one folder"),
        (&["easy.demo", "./easy.demo"], "easy.demo"),
        (&["easy.demo", "nothing.demo"], "nothing.demo"),
        (&[], "<FILE>"),
    ] {
        let output = merge(files);
        assert_eq!(code(&output), 3, "{files:?}: {}", errors(&output));
        assert!(errors(&output).contains(words), "{files:?}: {}", errors(&output));
        assert!(!folder.join("all.demo").exists(), "{files:?}: nothing is left");
    }
}

#[test]
fn recordings_are_shown_in_plain_words() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "a.demo", &["--levels", "easy:0..0", "--noise", "0.2"]);
    let show = |more: &[&str]| playbot(folder, &[&["demo", "show", "a.demo"], more].concat());
    let shown = said(&show(&[]));
    for words in [
        "coinrun, version 1 of its rules\n",
        "played by     search\n",
        "noise         20 % of the actions are random\n",
        "actions       15 discrete actions\n",
        "by bot 100 %\n",
    ] {
        assert!(shown.contains(words), "{shown}");
    }
    let ticks = said(&show(&["--episode", "0"]));
    assert!(ticks.contains("  bot\n") && !(shown + &ticks).contains(['{', '"']), "{ticks}");
    assert!(
        ticks.lines().any(|line| line.contains("  action 7 right ") || line.contains("  action 8 right+jump ")),
        "actions have names: {ticks}"
    );
    let some = show(&["--episode", "0", "--ticks", "3..5", "--json"]);
    let some: Vec<_> =
        lines(&some).iter().map(|tick| (tick["tick"].as_u64(), tick["action_name"].is_string())).collect();
    assert_eq!(some, [3, 4, 5].map(|tick| (Some(tick), true)));
    for (more, words) in [
        (&["--episode", "0", "--ticks", "90000"][..], "--ticks begins with 90000, but episode 0 of a.demo has "),
        (&["--episode", "0", "--ticks", "9..3"], "the first tick is behind the last one"),
        (&["--ticks", "3..5"], "--episode"),
    ] {
        let refused = show(more);
        assert_eq!(code(&refused), 3, "{more:?}: {}", errors(&refused));
        assert!(errors(&refused).contains(words), "{more:?}: {}", errors(&refused));
    }
    let none = show(&["--episode", "7"]);
    assert!(errors(&none).contains("has no episode 7; it has 1 episode, counted from 0"), "{}", errors(&none));
}

#[test]
fn chosen_episodes_make_a_recording_that_replays() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "cut.demo", &["--levels", "easy:0..9", "--steps", "200"]);
    let filter = |more: &[&str]| playbot(folder, &[&["demo", "filter", "cut.demo"], more].concat());
    let won = filter(&["--success", "--without-idle-start", "--out", "new/won.demo", "--json"]);
    assert_eq!(code(&won), 0, "{}", errors(&won));
    let report = lines(&won).remove(0);
    let count = |key: &str| report["files"][0][key].as_u64().expect("a number");
    assert_eq!(count("kept") + 1, count("episodes"), "the last episode was cut off: {report}");
    let verified = playbot(folder, &["demo", "verify", "new/won.demo"]);
    assert_eq!(code(&verified), 0, "{}", said(&verified));
    let first = filter(&["--level", "easy:0", "--min-return", "10", "--out", "first.demo"]);
    assert_eq!(code(&first), 0, "{}", errors(&first));
    assert!(said(&first).contains("cut.demo: kept 1 of "), "{}", said(&first));
    assert!(said(&first).contains("first.demo: coinrun easy, 1 episode with "), "{}", said(&first));
}

#[test]
fn a_filter_that_keeps_nothing_writes_nothing() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "a.demo", &["--levels", "easy:0..1"]);
    let filter = |more: &[&str]| playbot(folder, &[&["demo", "filter", "a.demo", "--out", "out.demo"], more].concat());
    let nothing = filter(&["--max-return", "-1"]);
    assert_eq!(code(&nothing), 1, "{}", errors(&nothing));
    let words = "a.demo: kept 0 of 2 episodes\nno episode meets all conditions, so nothing was written\n";
    assert_eq!(said(&nothing), words);
    for (more, words) in [
        (&["--min-return", "5", "--max-return", "3"][..], "--min-return 5 is above --max-return 3"),
        (&["--levels", "hard:0..9"], "a.demo: recorded in mode `easy`, so no episode is on the levels hard:0..9"),
        (&["--player", "eve"], "no recording is by `eve`; the players are search"),
    ] {
        let output = filter(more);
        assert_eq!(code(&output), 3, "{more:?}: {}", errors(&output));
        assert!(errors(&output).contains(words), "{more:?}: {}", errors(&output));
    }
    assert!(!folder.join("out.demo").exists());
}

#[test]
fn a_label_names_another_player_and_changes_no_episode() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    record(folder, "a.demo", &["--levels", "easy:0..0"]);
    record(folder, "b.demo", &["--levels", "easy:1..1"]);
    let label = |name: &str| playbot(folder, &["demo", "label", "a.demo", "--player", name, "--out", "ada.demo"]);
    let empty = label(" ");
    assert!(code(&empty) == 3 && errors(&empty).contains("--player is empty"), "{}", errors(&empty));
    let labelled = label("ada");
    assert_eq!(code(&labelled), 0, "{}", errors(&labelled));
    assert!(said(&labelled).starts_with("ada.demo: coinrun easy, 1 episode with "), "{}", said(&labelled));
    assert!(said(&labelled).ends_with(", by ada\n"), "{}", said(&labelled));
    let episodes = |file: &str| said(&playbot(folder, &["demo", "show", file, "--json"]));
    assert_eq!(episodes("ada.demo"), episodes("a.demo"));
    assert_eq!(code(&playbot(folder, &["demo", "verify", "ada.demo"])), 0);
    let hers = ["demo", "filter", "ada.demo", "b.demo", "--player", "ada", "--out", "hers.demo"];
    let kept = said(&playbot(folder, &hers));
    assert!(kept.contains("b.demo: by another player, left out\n") && kept.contains("1 episode with "), "{kept}");
    let taken = label("ada");
    assert!(code(&taken) == 3 && errors(&taken).contains("name another --out"), "{}", errors(&taken));
}
