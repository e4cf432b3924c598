//! Tests of verdicts about levels.

use std::{fs, path::Path, process::Output};

use bevy_playbot::action::Actions;
use bevy_playbot::demo::file::{Decider, DemoReader, DemoWriter};
use serde_json::Value;

use crate::program::{code, command, done, ended, errors, lines, playbot, unsealed};

const FILES: [&str; 4] = ["results.json", "report.html", "junit.xml", "summary.md"];

fn test(folder: &Path, out: &str, rest: &[&str]) -> Output {
    playbot(folder, &[&["test", "coinrun", "--out", out], rest].concat())
}

fn read(folder: &Path, file: &str) -> String {
    fs::read_to_string(folder.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

fn results(folder: &Path, out: &str) -> Value {
    serde_json::from_str(&read(folder, &format!("{out}/results.json"))).expect("JSON")
}

/// Checks that two folders hold the same results and reports.
fn assert_same(folder: &Path, one: &str, other: &str) {
    for file in FILES {
        assert!(read(folder, &format!("{one}/{file}")) == read(folder, &format!("{other}/{file}")), "{other}/{file}");
    }
}

#[test]
fn the_demonstrator_solves_levels_that_a_blind_bot_does_not() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let levels = ["--levels", "hard:0..9"];
    let output = test(folder, "search", &levels);
    assert_eq!(code(&output), 0, "{}", errors(&output));
    let found = results(folder, "search");
    assert_eq!((found["game"].as_str(), found["testers"][0]["name"].as_str()), (Some("coinrun"), Some("search")));
    let rows = found["levels"].as_array().expect("levels");
    assert_eq!(rows.len(), 10);
    for (index, row) in rows.iter().enumerate() {
        assert_eq!(row["level"], format!("hard:{index}"));
        assert_eq!((row["outcome"].as_str(), row["solved"].as_u64()), (Some("solved"), Some(1)), "{row}");
        assert!(row["ticks"]["median"].as_f64().is_some_and(|ticks| ticks > 10.0), "{row}");
        assert_eq!(row["testers"][0]["exact"], true, "{row}");
        // One episode, and CoinRun has 15 ticks per second.
        let time = row["ticks"]["median"].as_f64().map(|ticks| ticks / 15.0);
        assert_eq!(row["seconds"].as_f64(), time, "{row}");
    }
    let output = test(folder, "blind", &[&levels[..], &["--bot", "right-jump,random", "--json"]].concat());
    assert_eq!(code(&output), 1, "{}", errors(&output));
    let rows = lines(&output);
    assert_eq!(rows, *results(folder, "blind")["levels"].as_array().expect("levels"));
    let failed: Vec<&Value> = rows.iter().filter(|row| row["outcome"] == "bot-failed").collect();
    assert!((1..10).contains(&failed.len()), "{rows:?}");
    let ends = |row: &Value| {
        let counts = row["ends"].as_array().expect("ends").iter();
        counts.map(|end| end["lost"].as_u64().unwrap_or(0) + end["timed_out"].as_u64().unwrap_or(0)).sum::<u64>()
    };
    assert!(failed.iter().all(|row| ends(row) == 2 && row["proof"] == "unknown"), "{failed:?}");
    assert!(rows.iter().all(|row| row["testers"][0]["exact"] == true && row["testers"][1]["exact"] == false));
    let junit = read(folder, "blind/junit.xml");
    assert!(
        junit.contains(&format!("failures=\"{}\"", failed.len())) && junit.contains("playbot test coinrun"),
        "{junit}"
    );
    let summary = read(folder, "blind/summary.md");
    assert!(summary.contains("| random |") && summary.contains("of the open squares were visited"), "{summary}");
}

#[test]
fn results_say_where_bots_went_and_what_killed_them() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let output = test(folder, "out", &["--levels", "hard:0..19", "--bot", "right-jump,random", "--episodes", "2"]);
    assert!([0, 1].contains(&code(&output)), "{}", errors(&output));
    let found = results(folder, "out");
    assert_eq!(found["maps"], "all");
    let sum = |pairs: &Value| pairs.as_array().expect("pairs").iter().filter_map(|pair| pair[1].as_u64()).sum::<u64>();
    let mut causes = Vec::new();
    for row in found["levels"].as_array().expect("levels") {
        let (maps, places) = (&row["maps"], &row["places"]);
        assert!(sum(&maps["visits"]) >= 4 && sum(&maps["lost"]) <= sum(&maps["visits"]), "{row}");
        let [visited, open] = ["visited", "open"].map(|name| places[name].as_u64().expect("a count"));
        assert!(visited > 0 && visited <= open, "{row}");
        for tester in row["testers"].as_array().expect("testers") {
            assert!(tester["places"]["visited"].as_u64().is_some_and(|own| own > 0 && own <= visited), "{row}");
        }
        let failed = row["lost"].as_u64().unwrap_or(0) + row["timed_out"].as_u64().unwrap_or(0);
        let reported = row["causes"].as_object().cloned().unwrap_or_default();
        assert_eq!(reported.values().filter_map(Value::as_u64).sum::<u64>(), failed, "{row}");
        assert!(failed == 0 || maps["failure"]["way"].is_array(), "{row}");
        causes.extend(reported.into_iter().map(|(cause, _)| cause));
    }
    let known = ["saw", "enemy", "lava", "left the map", "time"];
    assert!(!causes.is_empty() && causes.iter().all(|cause| known.contains(&cause.as_str())), "{causes:?}");
    let page = read(folder, "out/report.html");
    assert!(page.contains("data-clip=\"data:image/png;base64,iVBORw0KGgo") && page.contains("<form id=\"maps\""));
    // Results from before there were maps.
    let older: Vec<String> = unsealed(&read(folder, "out/results.json")).lines().map(without_maps).collect();
    fs::write(folder.join("out/results.json"), older.join("\n") + "\n").expect("writable");
    done(folder, &["report", "html", "out"]);
    let page = read(folder, "out/report.html");
    assert!(page.contains("<figure><svg") && !page.contains("<form id=\"maps\""));
}

#[test]
fn build_servers_are_given_causes_positions_and_the_time_of_the_game() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let output = test(folder, "out", &["--levels", "hard:0..9", "--bot", "right-jump"]);
    assert_eq!(code(&output), 1, "{}", errors(&output));
    let junit = read(folder, "out/junit.xml");
    let failed: Vec<&str> = junit.lines().filter(|line| line.contains("type=\"bot-failed\"")).collect();
    assert!(!failed.is_empty() && failed.iter().all(|line| line.contains(" 1 (near ")), "{junit}");
    assert!(junit.contains("classname=\"coinrun.hard:0-9.right-jump\"") && junit.contains("hostname=\"localhost\""));
    let cases = junit.lines().filter(|line| line.contains("<testcase ")).collect::<Vec<_>>();
    assert!(cases.len() == 10 && cases.iter().all(|line| line.contains(" time=\"")), "{cases:?}");
}

#[test]
fn the_date_of_reproducible_builds_is_that_of_reports_for_build_servers() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let at = |out: &str, date: &str| {
        let args = ["test", "coinrun", "--levels", "hard:0..1", "--bot", "right-jump", "--out", out];
        playbot_shell::output(command(folder, &args).env("SOURCE_DATE_EPOCH", date)).expect("it starts")
    };
    for (out, date, written) in
        [("none", "", None), ("day", "1767225600", Some("2026-01-01T00:00:00")), ("again", "1767225600", None)]
    {
        let output = at(out, date);
        assert!([0, 1].contains(&code(&output)), "{}", errors(&output));
        let stamps = read(folder, &format!("{out}/junit.xml")).matches(" timestamp=\"").count();
        assert_eq!(stamps, usize::from(!date.is_empty()), "{out}");
        let expected = written.map_or_else(String::new, |date| format!(" timestamp=\"{date}\""));
        assert!(read(folder, &format!("{out}/junit.xml")).contains(&expected), "{out}");
    }
    assert_same(folder, "day", "again");
    let output = at("refused", "today");
    assert_eq!(code(&output), 3, "{}", errors(&output));
    assert!(errors(&output).contains("SOURCE_DATE_EPOCH is `today`"), "{}", errors(&output));
    assert!(!folder.join("refused").exists(), "it is refused before levels are played");
}

/// Returns a line of results as it was before there were maps.
fn without_maps(line: &str) -> String {
    let line = line.replace("\"maps\":\"all\",", "");
    if !line.starts_with("{\"level\":") {
        return line;
    }
    let comma = if line.ends_with(',') { "," } else { "" };
    let mut level: Value = serde_json::from_str(line.trim_end_matches(',')).expect("a level");
    for name in ["maps", "places", "causes"] {
        level.as_object_mut().expect("an object").remove(name);
    }
    for tester in level["testers"].as_array_mut().expect("testers") {
        tester.as_object_mut().expect("an object").remove("events");
    }
    format!("{level}{comma}")
}

#[test]
fn threads_shards_and_a_kill_change_no_byte() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let plan = ["--levels", "easy:3..16", "--bot", "random,search", "--episodes", "3", "--seed", "5"];
    let run = |out: &str, rest: &[&str]| {
        let output = test(folder, out, &[&plan[..], rest].concat());
        assert_eq!(code(&output), 0, "{}", errors(&output));
    };
    run("whole", &["--threads", "1"]);
    run("two", &["--threads", "2"]);
    assert_same(folder, "whole", "two");
    for count in [1, 2, 7] {
        let shards: Vec<String> = (0..count).map(|index| format!("{index}/{count}")).collect();
        let outs: Vec<String> = shards.iter().map(|shard| shard.replace('/', "-of-")).collect();
        for (shard, out) in shards.iter().zip(&outs) {
            run(out, &["--shard", shard]);
        }
        let joined = format!("joined-{count}");
        let outs = outs.iter().rev().map(String::as_str);
        let merge: Vec<&str> = ["report", "merge"].into_iter().chain(outs).chain(["--out", &joined]).collect();
        done(folder, &merge);
        assert_same(folder, "whole", &joined);
    }
    // The state after a kill: some levels, half a line, no results.
    fs::create_dir(folder.join("killed")).expect("writable");
    let journal = read(folder, "whole/levels.jsonl");
    let torn: String = journal.lines().take(5).map(|line| format!("{line}\n")).chain(["{\"level\":".into()]).collect();
    fs::write(folder.join("killed/levels.jsonl"), torn).expect("writable");
    fs::copy(folder.join("whole/test.json"), folder.join("killed/test.json")).expect("writable");
    let output = test(folder, "killed", &[&plan[..], &["--resume"]].concat());
    assert_eq!(code(&output), 0, "{}", errors(&output));
    assert!(errors(&output).contains("the last 9 bytes are an incomplete level"), "{}", errors(&output));
    assert_same(folder, "whole", "killed");
    let other = test(folder, "killed", &["--levels", "easy:3..16", "--bot", "random", "--resume"]);
    assert_eq!(code(&other), 3);
    for words in ["killed holds another test", "seeds 5 and 0", "testers random + search and random"] {
        assert!(errors(&other).contains(words), "{}", errors(&other));
    }
    assert!(errors(&test(folder, "whole", &plan)).contains("--resume"), "results are not overwritten");
}

#[test]
fn what_cannot_be_tested_is_an_error_and_never_a_pass() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let said = |rest: &[&str]| {
        let output = test(folder, "out", rest);
        assert_eq!(code(&output), 3, "{rest:?}: {}", errors(&output));
        errors(&output)
    };
    for (rest, words) in [
        (&["--levels", "hard:9..3"][..], "hard:3..9"),
        (&["--levels", "hard:0..2", "--shard", "3/7"], "shard 3/7 has no level"),
        (&["--levels", "hard:0..2", "--shard", "7/7"], "the last one is 6/7"),
        (&["--levels", "hurd:0..2"], "hard"),
        (&["--levels", "hard:0..2", "--bot", "scout"], "search"),
        (&["--levels", "hard:0..2", "--bot", "search,search"], "two testers are called `search`"),
        (&["--levels", "hard:0..2", "--policy", "none.policy"], "none.policy"),
        (&["--levels", "hard:0..2", "--against", "none"], "none has no results.json"),
        (&["--levels", "hard:0..2", "--episodes", "0"], "from 1 to "),
    ] {
        let found = said(rest);
        assert!(found.contains(words), "{rest:?}: {found}");
    }
    assert!(!folder.join("out/results.json").exists());
    let merge = ["report", "merge", "none", "--out", "joined"];
    let (_, words) = ended(folder, &merge, 3);
    assert!(words.contains("none has no results.json"), "{words}");
}

#[test]
fn a_level_that_no_longer_exists_as_it_was_is_named_and_the_same_code_raises_no_alarm() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let plan = ["--levels", "hard:0..29", "--bot", "search,random", "--episodes", "2"];
    let run = |out: &str, rest: &[&str], wanted: i32| {
        let output = test(folder, out, &[&plan[..], rest].concat());
        assert_eq!(code(&output), wanted, "{}", errors(&output));
        errors(&output)
    };
    run("before", &["--seed", "1"], 0);
    // The file stands for its folder.
    let words = run("same", &["--seed", "2", "--against", "before/results.json"], 0);
    assert!(words.contains("nothing has changed by more than chance in 30 levels"), "{words}");
    // Earlier results in which level 7 was not solved by the deterministic tester, and level 3 was proved unsolvable.
    let before = unsealed(&read(folder, "before/results.json"));
    let changed: Vec<String> = before.lines().map(|line| changed(line, "7", "3")).collect();
    fs::create_dir(folder.join("other")).expect("writable");
    fs::write(folder.join("other/results.json"), changed.join("\n") + "\n").expect("writable");
    let words = run("easier", &["--against", "other"], 0);
    assert!(words.contains("easier: hard:7: solved 0 of 2, now 2 of 2 (search,"), "{words}");
    assert!(words.contains("easier: hard:3: ") && words.contains("no longer proved unsolvable"), "{words}");
    let against: Value = serde_json::from_str(&read(folder, "easier/against.json")).expect("JSON");
    assert_eq!(against["easier"].as_array().map(Vec::len), Some(2));
    assert!(read(folder, "easier/summary.md").contains("Easier (2)"));
    fs::write(folder.join("other/results.json"), before.replace("\"game_version\":1", "\"game_version\":0"))
        .expect("writable");
    let words = run("refused", &["--against", "other"], 3);
    assert!(words.contains("other and this test cannot be compared: versions 0 and 1 of `coinrun`"), "{words}");
    for before in ["before", "before/results.json"] {
        assert!(run("before", &["--against", before, "--force"], 3).contains("cannot be compared with themselves"));
    }
}

#[test]
fn places_that_other_testers_visited_are_not_compared_and_the_program_says_so() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let run = |out: &str, rest: &[&str]| {
        let output = test(folder, out, &[&["--levels", "hard:0..9"], rest].concat());
        assert!([0, 1].contains(&code(&output)), "{}", errors(&output));
        errors(&output)
    };
    run("before", &["--bot", "right-jump,random"]);
    let words = run("after", &["--bot", "right-jump", "--against", "before"]);
    let why = "the testers differ (right-jump; before: right-jump, random): ";
    let again = "playbot test coinrun --levels hard:0..9 --bot right-jump,random --episodes 1 --seed 0 --against before --out \
                 runs/comparable";
    assert!(words.contains(&format!("places not compared: {why}")) && words.contains(again), "{words}");
    let summary = read(folder, "after/summary.md");
    assert!(summary.contains(&format!("Places not compared: {why}")) && summary.contains(again), "{summary}");
    let against: Value = serde_json::from_str(&read(folder, "after/against.json")).expect("JSON");
    assert!(against["places_left_out"][0].as_str().is_some_and(|found| found.starts_with(why)), "{against}");
    let page = read(folder, "after/report.html");
    assert!(page.contains("<p>Places not compared: ") && page.contains(again), "{page}");
    let words = run("same", &["--bot", "right-jump,random", "--against", "before"]);
    assert!(!words.contains("not compared"), "{words}");
}

#[test]
fn levels_that_lost_their_only_solver_are_not_compared_and_the_testers_are_named() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let run = |out: &str, rest: &[&str], wanted: i32| {
        let output = test(folder, out, &[&["--levels", "easy:0..3"], rest].concat());
        assert_eq!(code(&output), wanted, "{}", errors(&output));
        errors(&output)
    };
    run("before", &["--bot", "search,random"], 0);
    let words = run("after", &["--bot", "right-jump,random", "--against", "before"], 0);
    for tester in ["the tester `search` is not there now", "the tester `right-jump` was not there before"] {
        assert!(words.contains(&format!("left out of the comparison: {tester}\n")), "{words}");
    }
    let unsolved = results(folder, "after");
    let unsolved = unsolved["levels"].as_array().expect("levels").iter().filter(|level| level["outcome"] != "solved");
    let unsolved: Vec<&str> = unsolved.filter_map(|level| level["level"].as_str()).collect();
    let against: Value = serde_json::from_str(&read(folder, "after/against.json")).expect("JSON");
    let others = against["other_testers"].as_array().expect("levels");
    let lost: Vec<&str> =
        others.iter().filter(|level| level["before"] == true).filter_map(|level| level["level"].as_str()).collect();
    assert!(lost.contains(&"easy:0") && lost.iter().all(|level| unsolved.contains(level)), "{against}");
    assert!(
        words.contains("cannot be compared, since the testers differ and only those of one test solved "),
        "{words}"
    );
    assert!(!words.contains("nothing has changed"), "{words}");
    // The levels that the table calls unsolved.
    assert!(words.contains(&format!("before: search, random): {} unsolved level", unsolved.len())), "{words}");
    let page = read(folder, "after/report.html");
    assert!(page.contains("solved before by search alone, and the testers differ"), "{page}");
    assert!(read(folder, "after/summary.md").contains("\nNot comparable ("));
}

/// Writes a recording in which the episodes of a level are longer by one tick, as if the present game ended them too
/// early.
fn delay(from: &Path, to: &Path, level: u64) {
    let reader = DemoReader::open(from).expect("a recording");
    let mut writer = DemoWriter::create(to, reader.header().clone()).expect("a fresh file");
    for episode in reader {
        let mut episode = episode.expect("whole");
        if episode.level_seed == level {
            let seen = episode.observations.len() / episode.len();
            episode.observations.extend_from_within(episode.observations.len() - seen..);
            episode.rewards.push(0.0);
            episode.state_hashes.push(0);
            episode.deciders.push(Decider::Bot);
            let Actions::Discrete(actions) = &mut episode.actions else { panic!("numbers of actions") };
            actions.push(0);
        }
        writer.push(&episode).expect("writable");
    }
}

#[test]
fn levels_that_no_longer_end_as_they_were_recorded_are_in_all_reports_and_raise_an_alarm() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    done(folder, &["record", "coinrun", "--levels", "easy:0..2", "--out", "same.demo"]);
    delay(&folder.join("same.demo"), &folder.join("late.demo"), 1);
    let plan = ["--levels", "easy:0..2", "--bot", "search,random"];
    let run = |out: &str, rest: &[&str], wanted: i32| {
        let output = test(folder, out, &[&plan[..], rest].concat());
        assert_eq!(code(&output), wanted, "{}", errors(&output));
        errors(&output)
    };
    let words = run("same", &["--against", "same.demo"], 0);
    assert!(words.contains("3 recorded levels: all end as recorded") && !words.contains("recorded: "), "{words}");
    let rows = |out: &str| results(folder, out)["levels"].as_array().cloned().expect("levels");
    assert!(rows("same").iter().all(|row| row["recorded"]["end"] == "solved" && row["recorded"]["differs"].is_null()));
    assert!(read(folder, "same/junit.xml").contains("failures=\"0\""));
    assert!(!read(folder, "same/summary.md").contains("Levels to look at"), "`random` need not win");

    let words = run("late", &["--against", "late.demo", "--threads", "1"], 1);
    assert!(words.contains("3 recorded levels: 1 no longer ends as recorded"), "{words}");
    let row = rows("late").remove(1);
    let recorded = &row["recorded"];
    let [before, now] = ["recorded_ticks", "ticks"].map(|name| recorded[name].as_u64().expect("a number"));
    assert_eq!(
        (row["outcome"].as_str(), before, recorded["differs"].as_u64()),
        (Some("solved"), now + 1, Some(now - 1))
    );
    let news =
        format!("the recording solves it in {before} ticks; its actions lead elsewhere from tick {} on", now - 1);
    let end = format!(", and reach the goal after {now} ticks");
    assert!(words.contains(&format!("recorded: easy:1: {news}")) && words.contains(&end), "{words}");
    for file in &FILES[1..] {
        let text = read(folder, &format!("late/{file}"));
        assert!(text.contains(&news) && text.contains(&end), "{file}: {text}");
    }
    assert!(read(folder, "late/junit.xml").contains("failures=\"1\""));

    run("two", &["--against", "late.demo", "--threads", "2"], 1);
    assert_same(folder, "late", "two");
    run("zero", &["--against", "late.demo", "--shard", "0/2"], 0);
    run("one", &["--against", "late.demo", "--shard", "1/2"], 1);
    ended(folder, &["report", "merge", "one", "zero", "--out", "joined"], 1);
    assert_same(folder, "late", "joined");
    // Earlier results may have courses of a recording or not.
    run("after", &["--against", "late"], 0);
    // What was played is kept without a recording, and compared with another one.
    run("two", &["--resume", "--against", "same.demo"], 0);
    assert_same(folder, "same", "two");
    run("two", &["--resume"], 0);
    assert_eq!(read(folder, "two/results.json"), read(folder, "after/results.json"));
}

/// Returns a line of results in which `search` failed on one level, and another level was proved unsolvable.
fn changed(line: &str, failed: &str, unsolvable: &str) -> String {
    let is_level = |number: &str| line.contains(&format!("\"level\":\"hard:{number}\""));
    if !is_level(failed) && !is_level(unsolvable) {
        return line.to_owned();
    }
    let comma = if line.ends_with(',') { "," } else { "" };
    let mut level: Value = serde_json::from_str(line.trim_end_matches(',')).expect("a level");
    if is_level(failed) {
        level["testers"][0]["solved"] = 0.into();
    } else {
        level["proof"] = serde_json::json!({ "unsolvable": { "why": "walled in" } });
    }
    format!("{level}{comma}")
}

#[test]
fn the_page_has_pictures_of_the_levels_and_is_made_again_to_the_byte() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    test(folder, "out", &["--levels", "hard:0..9", "--bot", "right-jump"]);
    let page = read(folder, "out/report.html");
    assert_eq!(page.matches("<figure><svg").count(), 10, "{page}");
    assert!(page.contains("playbot test coinrun --levels hard:"), "{page}");
    done(folder, &["report", "html", "out", "--out", "pages/again.html"]);
    assert!(read(folder, "pages/again.html") == page);
    assert!(
        page.contains("<h2>Events</h2>") && page.contains("<input type=\"checkbox\" value=\"lost\" checked>"),
        "{page}"
    );
    // The same page with its clips as files.
    done(folder, &["report", "html", "out", "--split", "--out", "pages/again.html"]);
    let split = read(folder, "pages/again.html");
    let clips = split.matches("data-clip=\"again-files/").count();
    assert!(clips > 0 && clips == page.matches("data-clip=\"data:image/png;base64,").count(), "{split}");
    let files = fs::read_dir(folder.join("pages/again-files")).expect("a folder").count();
    assert!((1..=clips).contains(&files) && split.len() < page.len(), "{files} of {clips}");
    done(folder, &["report", "html", "out", "--out", "pages/again.html"]);
    assert!(read(folder, "pages/again.html") == page && !folder.join("pages/again-files").exists());
    let (_, words) = ended(folder, &["report", "html", "none"], 3);
    assert!(words.contains("none has no results.json"), "{words}");
    // For another version of the game there are numbers, and no pictures.
    let results = unsealed(&read(folder, "out/results.json")).replace("\"game_version\":1", "\"game_version\":0");
    fs::write(folder.join("out/results.json"), results).expect("writable");
    let (_, words) = ended(folder, &["report", "html", "out"], 3);
    assert!(words.contains("is kept, since a new page would have no pictures: version 0 of"), "{words}");
    assert!(read(folder, "out/report.html") == page);
    let (_, words) = done(folder, &["report", "html", "out", "--out", "bare.html"]);
    assert!(words.contains("warning: the page has no pictures: version 0 of"), "{words}");
    let page = read(folder, "bare.html");
    assert!(page.contains("version 0 of `coinrun` was tested") && !page.contains("<figure>"), "{page}");
}

#[test]
fn the_squares_of_an_unsolvable_level_that_nothing_reaches_are_hatched_on_any_number_of_threads() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let page = |out: &str, rows: [&str; 4], threads: &str, wanted: i32| {
        let level = serde_json::json!({ "rows": rows, "rules": "sparse+end-at-goal" });
        fs::write(folder.join("a.json"), level.to_string()).expect("writable");
        let plan = ["test", "maze2d", "--levels", "files:a.json", "--bot", "random", "--seed", "1", "--out", out];
        ended(folder, &[&plan[..], &["--threads", threads]].concat(), wanted);
        read(folder, &format!("{out}/report.html"))
    };
    let sealed = ["#######", "#SOO#G#", "#O#O###", "#######"];
    let one = page("one", sealed, "1", 1);
    assert!(
        one.contains("Neither a tester nor an explorer reached 1 open square, which the picture has hatched."),
        "{one}"
    );
    // On the card, and in the table.
    let hatched =
        |page: &str| page.matches("<path class=\"hatched\"").count() - page.matches("/>not reached, though").count();
    assert!(hatched(&one) >= 2 && one.contains("<pattern id=\"hatch\""), "{one}");
    assert!(page("two", sealed, "2", 1) == one, "threads change no byte");
}

#[test]
fn results_outlive_reports_that_cannot_be_written() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    fs::create_dir_all(folder.join("out/junit.xml/taken")).expect("writable");
    let output = test(folder, "out", &["--levels", "easy:0..0", "--bot", "random"]);
    assert_eq!(code(&output), 2, "{}", errors(&output));
    let words = errors(&output);
    assert!(words.contains("the results in out are whole") && words.contains("playbot report html out"), "{words}");
    assert_eq!(results(folder, "out")["levels"].as_array().map(Vec::len), Some(1));
}

#[cfg(unix)]
#[test]
fn what_is_finished_outlives_a_full_disk() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let plan = "test coinrun --levels easy:0..63 --bot random --out out";
    // Forty blocks of 512 bytes hold a few levels.
    let output = crate::program::on_full_disk(folder, 40, plan);
    assert_eq!(code(&output), 2, "{}", errors(&output));
    assert!(errors(&output).contains("--resume"), "{}", errors(&output));
    let kept = read(folder, "out/levels.jsonl");
    assert!(kept.lines().count() > 1 && kept.ends_with('\n'), "{kept}");
    assert!(kept.lines().all(|line| serde_json::from_str::<Value>(line).is_ok()), "{kept}");
    let words: Vec<&str> = plan.split(' ').collect();
    let resumed = playbot(folder, &[&words[..], &["--resume"]].concat());
    assert!([0, 1].contains(&code(&resumed)), "{}", errors(&resumed));
    assert_eq!(results(folder, "out")["levels"].as_array().map(Vec::len), Some(64));
}
