//! Tests of results as files.

use crate::{
    findings::testing::course,
    verdict::{Finding, MapScope, TesterRecord, results::*, testing::verdict},
};
use playbot_harness::detector::LevelProof;
use std::fs;

fn record() -> TestRecord {
    TestRecord {
        game: "garden".to_owned(),
        game_version: 3,
        range: "bed:2..3".parse().expect("a split"),
        files: None,
        seed: 5,
        testers: vec![TesterRecord::bot("random")],
        episodes: 2,
        detectors: Vec::new(),
        options: Vec::new(),
        maps: MapScope::default(),
        shard: Some("0/2".parse().expect("a shard")),
    }
}

fn written(lines: &[&str]) -> String {
    let mut bytes = Vec::new();
    let mut writer = ResultWriter::begin(&mut bytes, &record()).expect("writable");
    lines.iter().for_each(|line| writer.push(line).expect("writable"));
    writer.end().expect("writable");
    String::from_utf8(bytes).expect("text")
}

#[test]
fn the_file_is_one_object_and_reads_back_line_by_line() {
    let text = written(&[r#"{"index":0,"a":1}"#, r#"{"index":1}"#]);
    let value: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((value["game"].as_str(), value["range"].as_str()), (Some("garden"), Some("bed:2..3")));
    assert_eq!(value["levels"].as_array().map(Vec::len), Some(2));
    serde_json::from_str::<Value>(&written(&[])).expect("without levels too");

    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join(RESULTS), &text).expect("writable");
    let mut lines = ResultLines::open(folder.path()).expect("whole");
    assert_eq!(*lines.record(), record());
    assert_eq!(lines.line_of(0).expect("the first"), r#"{"index":0,"a":1}"#);
    assert!(lines.line_of(2).is_err(), "the next one has index 1");
    assert_eq!(lines.next_line().expect("the end"), None);
    assert_eq!(lines.next_line().expect("still the end"), None);
}

#[test]
fn what_is_no_result_is_named_with_its_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let open = || ResultLines::open(folder.path());
    assert!(matches!(open(), Err(TestError::NoResults { folder: path, resumed: None }) if path == folder.path()));
    let text = written(&[r#"{"index":0}"#]);
    let head = text.lines().next().expect("a head");
    let cut = format!("{head}\n{{\"index\":0}}");
    for (text, line) in [("{}", 1), ("{\"a\":1,\"levels\":[", 1), (head, 2), (cut.as_str(), 3)] {
        fs::write(folder.path().join(RESULTS), text).expect("writable");
        let all = open().and_then(|mut lines| {
            while lines.next_line()?.is_some() {}
            Ok(())
        });
        let found = all.expect_err(text).to_string();
        assert!(found.contains(&format!("{RESULTS}, line {line}: ")), "{found}");
    }
    fs::write(folder.path().join(RESULTS), &head[..head.len() / 2]).expect("writable");
    let found = open().map(drop).expect_err("half a head").to_string();
    assert!(found.contains("the file is torn") && found.contains("`test --resume`"), "{found}");
    assert!(!found.contains("make it again"), "it has another next step: {found}");
    fs::write(folder.path().join(RESULTS), written(&[r#"{"index":0}"#, r#"{"index":1,]"#])).expect("writable");
    let mut lines = open().expect("a head");
    lines.next_line().expect("a level");
    let found = lines.next_level().expect_err("no level").to_string();
    assert!(found.contains(&format!("{RESULTS}, line 3: ")) && found.contains("(column 1"), "{found}");
    assert!(!found.contains("at line"), "one line is enough: {found}");
}

#[test]
fn a_file_that_was_cut_off_reads_the_same_to_everyone() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = written(&[r#"{"index":0,"interval":[0.0,1.0]}"#]);
    let cut = whole.find("1.0").expect("a level");
    fs::write(folder.path().join(RESULTS), &whole[..cut]).expect("writable");
    let open = || ResultLines::open(folder.path()).expect("a head");
    let said =
        [ResultLines::open_whole(folder.path()).map(drop), open().next_level().map(drop), open().line_of(0).map(drop)]
            .map(|read| read.expect_err("cut off").to_string());
    assert!(said[0].contains("line 3: the file ends in the middle"), "{}", said[0]);
    assert!(said[1] == said[0] && said[2] == said[0], "{said:?}");
}

#[test]
fn the_file_stands_for_its_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join(RESULTS);
    assert_eq!(results_folder(&file), file, "there is none");
    fs::write(&file, "").expect("writable");
    assert_eq!(results_folder(&file), folder.path());
    assert_eq!(results_folder(folder.path()), folder.path());
}

#[test]
fn what_was_tested_is_not_relied_on_if_a_bit_of_the_file_was_flipped() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(RESULTS);
    let whole = written(&[r#"{"index":0,"a":1}"#, r#"{"index":1}"#]).into_bytes();
    fs::write(&path, &whole).expect("writable");
    let mut lines = ResultLines::open_whole(folder.path()).expect("whole");
    assert!(lines.line_of(0).is_ok() && lines.line_of(1).is_ok() && lines.expect_end().is_ok());
    for at in 0..whole.len() * 8 {
        let mut bytes = whole.clone();
        bytes[at / 8] ^= 1 << (at % 8);
        fs::write(&path, bytes).expect("writable");
        assert!(ResultLines::open_whole(folder.path()).is_err(), "bit {at}");
    }
    // Without the last line feed nothing is missing.
    for length in 0..whole.len() - 1 {
        fs::write(&path, &whole[..length]).expect("writable");
        assert!(ResultLines::open_whole(folder.path()).is_err(), "{length} bytes");
    }
}

#[test]
fn nothing_may_follow_the_last_level_or_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(RESULTS);
    let text = written(&[r#"{"index":0}"#, r#"{"index":1}"#]);
    fs::write(&path, &text).expect("writable");
    let mut lines = ResultLines::open(folder.path()).expect("a head");
    lines.line_of(0).expect("the first");
    let error = lines.expect_end().expect_err("there is another").to_string();
    assert!(error.contains("results.json, line 3: there are more levels than were tested"), "{error}");
    fs::write(&path, format!("{text}]}}\n")).expect("writable");
    let error = ResultLines::open_whole(folder.path()).map(drop).expect_err("another end").to_string();
    assert!(error.contains("results.json, line 5: the file goes on after its end"), "{error}");
    // The end as older versions wrote it.
    let (levels, _) = text.rsplit_once("],").expect("an end");
    fs::write(&path, format!("{levels}]}}\n")).expect("writable");
    assert_eq!(*ResultLines::open_whole(folder.path()).expect("an older file").record(), record());
}

#[test]
fn the_worst_come_first_and_solved_ones_not_at_all() {
    let record = TestRecord {
        game: "garden".to_owned(),
        game_version: 1,
        range: "hard:0..99".parse().expect("a split"),
        files: None,
        seed: 0,
        testers: vec![TesterRecord::bot("random")],
        episodes: 4,
        detectors: Vec::new(),
        options: Vec::new(),
        maps: MapScope::default(),
        shard: None,
    };
    let mut overview = Overview::empty(record);
    for (index, solved) in [4, 3, 0, 1, 0].into_iter().enumerate() {
        let mut level =
            LevelVerdict { places: Some(Places { visited: 3, open: 4 }), ..verdict(index as u64, solved, 4) };
        level.testers[0].places = Some(Places { visited: 1, open: 4 });
        overview.add(level);
    }
    let why = "walled in".to_owned();
    let finding = Finding {
        detector: "unreachable-goal".to_owned(),
        tester: None,
        episode: None,
        tick: None,
        message: why.clone(),
        file: None,
        settings: Vec::new(),
    };
    let proved = LevelVerdict {
        outcome: LevelOutcome::ProvedUnsolvable,
        proof: LevelProof::Unsolvable { why },
        findings: vec![finding],
        ..verdict(5, 0, 4)
    };
    overview.add(proved);
    let worst: Vec<u64> = overview.worst.iter().map(|level| level.index).collect();
    assert_eq!(worst, [5, 2, 4], "the others are solved");
    let hardest: Vec<u64> = overview.hardest.iter().map(|level| level.index).collect();
    assert_eq!(hardest, [3, 1], "of all levels that are not solved each time");
    assert_eq!((overview.solved, overview.bot_failed, overview.proved_unsolvable), (3, 2, 1));
    assert_eq!(overview.testers[0].levels, Trials { successes: 3, trials: 6 });
    assert_eq!(overview.testers[0].episodes, Trials { successes: 8, trials: 24 });
    assert_eq!(overview.places, Places { visited: 15, open: 20 }, "the sixth level has no maps");
    assert_eq!(overview.testers[0].places.percent(), Some(25.0));
    assert!(!overview.is_sound());
    for index in 6..60 {
        overview.add(verdict(index, 0, 4));
    }
    assert_eq!((overview.worst.len(), overview.worst[0].index), (20, 5));
}

/// Reads levels of which four testers solved so many episodes, and returns the indices of the hardest ones.
fn hardest(solved: &[u64]) -> Vec<u64> {
    let folder = tempfile::tempdir().expect("a folder");
    let line = |(index, solved): (usize, &u64)| serde_json::to_string(&verdict(index as u64, *solved, 4));
    let lines: Vec<String> = solved.iter().enumerate().map(|level| line(level).expect("JSON")).collect();
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    fs::write(folder.path().join(RESULTS), written(&lines)).expect("writable");
    Overview::read(folder.path()).expect("results").hardest.iter().map(|level| level.index).collect()
}

#[test]
fn the_hardest_levels_are_those_that_are_solved_less_often_than_half_of_the_solved_ones() {
    assert!(hardest(&[1, 1, 1, 1]).is_empty(), "some testers never win");
    assert_eq!(hardest(&[3, 1, 3, 2, 3]), [1, 3]);
    assert_eq!(hardest(&[3, 0, 0, 0, 4, 4]), [0], "levels that are not solved do not count");
    assert!(hardest(&[2, 3]).is_empty() && hardest(&[0]).is_empty() && hardest(&[]).is_empty());
    assert_eq!(hardest(&[4, 4, 4, 4, 4, 4, 3, 3, 3, 3, 3, 3]), Vec::<u64>::new(), "half of them are no exception");
    assert_eq!(hardest(&[4, 4, 4, 4, 4, 4, 4, 3, 3, 3, 3, 3, 3]), [7, 8, 9, 10, 11], "the first five");
}

#[test]
fn recordings_that_end_otherwise_are_among_the_worst_levels() {
    let mut overview = Overview::empty(record());
    let recorded = |index, solved, ticks| LevelVerdict { recorded: Some(course(ticks)), ..verdict(index, solved, 2) };
    assert_eq!(overview.recorded.summary(), None);
    overview.add(recorded(0, 2, 120));
    overview.add(recorded(1, 1, 120));
    assert_eq!(overview.recorded.summary().as_deref(), Some("2 recorded levels: all end as recorded"));
    assert!(overview.is_sound() && overview.worst.is_empty() && overview.recorded.others.is_empty());
    overview.add(recorded(2, 2, 80));
    let words = "hard:2: the recording solves it in 120 ticks; its actions lead elsewhere from tick 79 on, and reach the goal \
                 after 80 ticks";
    assert_eq!(overview.recorded.regressions, [words]);
    assert_eq!(overview.recorded.summary().as_deref(), Some("3 recorded levels: 1 no longer ends as recorded"));
    assert!(!overview.is_sound() && overview.worst[0].index == 2);
    overview.add(recorded(3, 0, 120));
    let weak = "hard:3: the recording solves it in 120 ticks; its actions still do, so the testers are too weak";
    assert_eq!(overview.recorded.others, [weak]);
}

#[test]
fn levels_that_are_solved_in_their_first_tick_are_counted_and_the_first_few_are_named() {
    let mut overview = Overview::empty(record());
    assert_eq!(overview.first_tick(), None);
    overview.add(verdict(0, 2, 2));
    let mut add = |index| {
        overview.add(LevelVerdict { solved_at_start: true, ..verdict(index, 2, 2) });
        overview.first_tick().expect("there is one")
    };
    assert_eq!(add(7), "1 level is solved in its first tick: hard:7");
    assert_eq!(add(31), "2 levels are solved in their first tick: hard:7, hard:31");
    let last = (40..45).map(add).last().expect("five more");
    assert_eq!(last, "7 levels are solved in their first tick: hard:7, hard:31, hard:40, hard:41, hard:42 and 2 more");
}

/// Totals of levels, each with the number of its episodes whose time was up, and its detectors with what they had.
fn short(levels: &[(u64, &[(&str, u32)])]) -> Vec<String> {
    let mut totals = ShortTotals::default();
    for (index, (timed_out, detectors)) in (0..).zip(levels) {
        let mut level = verdict(index, 1, 2);
        level.score.timed_out = *timed_out;
        level.too_short = detectors.iter().map(|(detector, had)| too_short(detector, *had)).collect();
        totals.add(&level);
    }
    totals.everywhere().iter().map(|short| format!("{} {}", short.detector, short.had)).collect()
}

fn too_short(detector: &str, had: u32) -> TooShort {
    let setting = Some(format!("{detector}.ticks={}", had / 2));
    TooShort { detector: detector.to_owned(), needs: 301, had, setting }
}

#[test]
fn detectors_for_which_all_episodes_were_too_short_are_named_with_the_longest_one() {
    assert_eq!(short(&[(1, &[("stuck", 90)]), (2, &[("stuck", 120)])]), ["stuck 120"]);
    assert!(short(&[(1, &[("stuck", 90)]), (1, &[])]).is_empty(), "it has looked on the second level");
    assert_eq!(short(&[(1, &[("stuck", 90)]), (0, &[])]), ["stuck 90"], "no time was up on the second level");
    assert_eq!(short(&[(1, &[("dead-action", 90)]), (0, &[("dead-action", 9)])]), ["dead-action 90"]);
    assert!(short(&[(1, &[("dead-action", 90)]), (0, &[])]).is_empty(), "a solved episode shows what actions do");
    let mut totals = ShortTotals::default();
    let finding = Finding {
        detector: "stuck".to_owned(),
        tester: None,
        episode: None,
        tick: None,
        message: String::new(),
        file: None,
        settings: Vec::new(),
    };
    let mut level =
        LevelVerdict { findings: vec![finding], too_short: vec![too_short("stuck", 9)], ..verdict(0, 1, 2) };
    level.score.timed_out = 1;
    totals.add(&level);
    assert!(totals.everywhere().is_empty(), "it has found something");
}

#[test]
fn a_detector_that_could_not_look_names_what_it_needs_and_what_to_type() {
    let mut overview = Overview::empty(record());
    assert_eq!(overview.could_not_look(), None);
    overview.too_short = vec![too_short("stuck", 120), TooShort { setting: None, ..too_short("own", 1) }];
    let words = "stuck (needs episodes of 301 ticks, and had at most 120: `--detector stuck.ticks=60`), \
                 own (needs episodes of 301 ticks, and had at most 1)";
    assert_eq!(overview.could_not_look().as_deref(), Some(words));
}

#[test]
fn quartiles_lie_between_the_values() {
    let of = |ticks: &[u32]| FinishTime::of(ticks.to_vec());
    let time = |lower_quartile, median, upper_quartile| FinishTime { lower_quartile, median, upper_quartile };
    assert_eq!(of(&[4, 1, 3, 2]), Some(time(1.75, 2.5, 3.25)));
    assert_eq!(of(&[30, 10, 20, 50, 40]), Some(time(20.0, 30.0, 40.0)));
    assert_eq!(of(&[7]), Some(time(7.0, 7.0, 7.0)));
    assert_eq!(of(&[]), None);
}

#[test]
fn results_with_other_line_breaks_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let value: Value = serde_json::from_str(&written(&[r#"{"index":0}"#])).expect("JSON");
    fs::write(folder.path().join(RESULTS), serde_json::to_string_pretty(&value).expect("JSON")).expect("writable");
    let found = ResultLines::open(folder.path()).map(|_| ()).expect_err("other lines").to_string();
    assert!(found.contains(&format!("{RESULTS}, line 1: the line breaks are not those of `playbot test`")), "{found}");
    assert!(found.ends_with("; keep the file as it was written, and format a copy"), "{found}");
}
