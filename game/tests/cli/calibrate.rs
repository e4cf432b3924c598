//! Tests of the comparison of results with recordings of people.

use std::{fs, path::Path};

use bevy_playbot::action::Actions;
use bevy_playbot::demo::file::{Decider, DemoEnd, DemoEpisode, DemoHeader, DemoReader, DemoWriter};
use playbot_games::coinrun::CoinRun;
use playbot_harness::game::Game;

use crate::program::{code, done, ended, errors, json_lines, playbot};

/// Writes a recording of a person who wins levels 0 to 11, each in so many ticks.
fn people(path: &Path, header: DemoHeader, ticks: &[usize]) {
    let mut writer = DemoWriter::create(path, header).expect("a fresh file");
    for (level, &ticks) in (0..).zip(ticks) {
        let episode = DemoEpisode {
            actions: Actions::Discrete(vec![0; ticks]),
            rewards: vec![0.0; ticks],
            state_hashes: vec![0; ticks],
            deciders: vec![Decider::Human; ticks],
            end: DemoEnd::Terminated { success: true },
            ..DemoEpisode::new(level, writer.header().actions)
        };
        writer.push(&episode).expect("writable");
    }
}

fn header(mode: &str) -> DemoHeader {
    DemoHeader { demonstrator: "alice".to_owned(), ..CoinRun::default().demo_header(mode) }
}

#[test]
fn bots_are_held_beside_people() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    done(folder, &["test", "coinrun", "--levels", "easy:0..11", "--bot", "search", "--out", "out"]);
    let ticks: Vec<usize> = (1..=12).map(|place| 50 * place).collect();
    people(&folder.join("people.demo"), header("easy"), &ticks);
    let (tables, words) = done(folder, &["report", "calibrate", "out", "people.demo", "--out", "pages/people.html"]);
    assert!(tables.contains("agreement with people") && tables.contains("easy:11"), "{tables}");
    assert!(words.contains("12 levels of easy:0..11 were played by 1 person (alice) in 12 tries"), "{words}");
    let page = fs::read_to_string(folder.join("pages/people.html")).expect("written");
    assert_eq!(
        page.matches("<circle class=\"dot").count(),
        39,
        "a dot for each level and measure, and one in each legend"
    );
    for file in ["plots/people.png", "people.svg"] {
        let (_, words) = done(folder, &["report", "calibrate", "out", "people.demo", "--plot", file]);
        assert!(words.contains(&format!("plot: {file}")), "{words}");
    }
    let png = fs::read(folder.join("plots/people.png")).expect("written");
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"));
    let svg = fs::read_to_string(folder.join("people.svg")).expect("written");
    assert_eq!(svg.matches("<circle ").count(), 39, "a dot for each level and measure, and one for each legend");
    let found = json_lines(&done(folder, &["report", "calibrate", "out", "people.demo", "--json"]).0).remove(0);
    assert_eq!(found["levels"].as_array().map(Vec::len), Some(12));
    assert_eq!((found["people"][0].as_str(), found["testers"][0].as_str()), (Some("alice"), Some("search")));
    assert_eq!(found["levels"][3]["people"]["ticks"], 200.0);
    let time = found["agreements"].as_array().expect("agreements").iter().find(|row| row["measure"] == "time");
    assert!(time.is_some_and(|row| row["spearman"]["interval"][1].is_number()), "{found}");
    done(folder, &["report", "calibrate", "out", "people.demo", "--out", "people.md"]);
    assert!(fs::read_to_string(folder.join("people.md")).expect("written").contains("| search | time | 12 |"));

    people(&folder.join("hard.demo"), header("hard"), &[30]);
    done(folder, &["record", "coinrun", "--levels", "easy:0..0", "--out", "bot.demo"]);
    for (args, words) in [
        (&["out", "hard.demo"][..], "no level is in both: people played hard:0"),
        (&["out", "bot.demo"], "bot.demo was played by a person to its end (1 episode not played by a person)"),
        (&["out", "none.demo"], "none.demo"),
        (&["none", "people.demo"], "none has no results.json"),
        (&["out", "people.demo", "--out", "people.pdf"], ".html or .md"),
        (&["out", "people.demo", "--plot", "people.gif"], ".png or .svg"),
        (&["out"], "RECORDING"),
    ] {
        let (_, reported) = ended(folder, &[&["report", "calibrate"], args].concat(), 3);
        assert!(reported.contains(words), "{args:?}: {reported}");
    }
}

#[test]
fn level_files_are_known_by_what_is_in_them() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    fs::create_dir(folder.join("levels")).expect("writable");
    let draw = |name: &str, seed: &str| {
        let (json, _) = done(folder, &["level", "coinrun", "--mode", "easy", "--level", seed, "--json"]);
        fs::write(folder.join("levels").join(name), json).expect("writable");
    };
    draw("a.json", "1");
    draw("b.json", "2");
    let levels = ["--levels", "files:levels/*.json"];
    done(folder, &[&["record", "coinrun"][..], &levels, &["--out", "bot.demo"]].concat());
    // People played the second one under another name and number.
    let reader = DemoReader::open(folder.join("bot.demo")).expect("recorded");
    let mut writer = DemoWriter::create(folder.join("people.demo"), reader.header().clone()).expect("a fresh file");
    let mut episode = reader.read_all().expect("whole").remove(1);
    let file = episode.level_file.as_mut().expect("a file");
    file.path = "elsewhere/x.json".to_owned();
    episode.level_seed = 7;
    episode.deciders.fill(Decider::Human);
    writer.push(&episode).expect("writable");
    drop(writer);

    let test = playbot(folder, &[&["test", "coinrun", "--out", "out"][..], &levels].concat());
    assert!([0, 1].contains(&code(&test)), "{}", errors(&test));
    let calibrate = ["report", "calibrate", "out", "people.demo", "--json"];
    let (line, words) = done(folder, &calibrate);
    let found = json_lines(&line).remove(0);
    assert_eq!(found["levels"].as_array().map(Vec::len), Some(1));
    assert_eq!(found["levels"][0]["level"], "levels/b.json");
    assert!(words.contains("With 1 level, too few are shared"), "{words}");
    draw("b.json", "9");
    let (_, words) = ended(folder, &calibrate, 3);
    assert!(words.contains("changed since the test"), "{words}");
}
