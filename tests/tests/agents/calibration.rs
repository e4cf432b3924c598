//! Tests of results beside recordings of people, both made by hand, so every number is known.

use std::{
    fs,
    path::{Path, PathBuf},
};

use bevy_playbot::action::{ActionSpace, Actions};
use bevy_playbot::demo::file::{Decider, DemoEnd, DemoEpisode, DemoHeader, DemoWriter};
use playbot_mutation::calibration::{Agreement, Calibration, CalibrationError, LevelNumbers, Measure, RankCorrelation};

const WON: DemoEnd = DemoEnd::Terminated { success: true };
const LOST: DemoEnd = DemoEnd::Terminated { success: false };

/// Results of `garden` in which `ppo` solved so many of ten episodes of each level, in so many ticks.
fn results(folder: &Path, levels: &[(u64, u64)]) {
    let last = levels.len() - 1;
    let head = format!(
        r#"{{"game":"garden","game_version":3,"range":"bed:0..{last}","seed":0,"testers":[{{"name":"ppo"}}],"episodes":10,"levels":["#
    );
    let lines: Vec<String> = (0..).zip(levels).map(|(index, (solved, ticks))| level(index, *solved, *ticks)).collect();
    fs::create_dir_all(folder).expect("writable");
    fs::write(folder.join("results.json"), format!("{head}\n{}\n]}}\n", lines.join(",\n"))).expect("writable");
}

fn level(index: u64, solved: u64, ticks: u64) -> String {
    let lost = 10 - solved;
    let ticks = if solved > 0 {
        format!(r#"{{"lower_quartile":{ticks}.0,"median":{ticks}.0,"upper_quartile":{ticks}.0}}"#)
    } else {
        "null".to_owned()
    };
    let score = format!(
        r#""solved":{solved},"episodes":10,"interval":[0.0,1.0],"ticks":{ticks},"lost":{lost},"timed_out":0,"broken":0"#
    );
    let outcome = if solved > 0 { "solved" } else { "bot-failed" };
    format!(
        r#"{{"level":"bed:{index}","index":{index},"outcome":"{outcome}","proof":"unknown",{score},"ends":[],"testers":[{{"tester":"ppo",{score},"exact":true}}],"findings":[]}}"#
    )
}

fn header(name: &str) -> DemoHeader {
    let header = DemoHeader::new("garden", 3, "bed", 20.0, ActionSpace::Discrete(2));
    DemoHeader { demonstrator: name.to_owned(), ..header }
}

fn episode(level: u64, ticks: usize, end: DemoEnd, decider: Decider) -> DemoEpisode {
    DemoEpisode {
        actions: Actions::Discrete(vec![0; ticks]),
        rewards: vec![0.0; ticks],
        state_hashes: vec![0; ticks],
        deciders: vec![decider; ticks],
        end,
        ..DemoEpisode::new(level, ActionSpace::Discrete(2))
    }
}

/// Writes a recording of these tries of a person: level, ticks and end.
fn recorded(path: &Path, header: DemoHeader, tries: &[(u64, usize, DemoEnd)]) -> PathBuf {
    let mut writer = DemoWriter::create(path, header).expect("a fresh file");
    for (level, ticks, end) in tries {
        writer.push(&episode(*level, *ticks, *end, Decider::Human)).expect("writable");
    }
    path.to_owned()
}

fn agreement(found: &Calibration, measure: Measure) -> &Agreement {
    found.agreements.iter().find(|agreement| agreement.measure == measure).expect("all measures")
}

#[test]
fn the_rank_correlation_with_several_people_is_known() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    // The bot is slower from level to level, and solves all of them; the last one has no recording.
    let levels: Vec<(u64, u64)> = (1..=13).map(|level| (10, 10 * level)).collect();
    results(&path("out"), &levels);
    // Alice too, but for two pairs of neighbours that change places.
    let order = [2, 1, 4, 3, 5, 6, 7, 8, 9, 10, 11, 12];
    let alice: Vec<(u64, usize, DemoEnd)> = (0..).zip(order).map(|(level, place)| (level, 100 * place, WON)).collect();
    let alice = recorded(&path("a.demo"), header("alice"), &alice);
    // Bob dies once on the first level, is as fast as Alice there, and plays one that was not tested.
    let bob = [(0, 30, LOST), (0, 200, WON), (99, 10, WON), (1, 5, DemoEnd::Aborted)];
    let bob = recorded(&path("b.demo"), header("bob"), &bob);
    let mut writer = DemoWriter::append(&bob, &header("bob")).expect("it is there");
    writer.push(&episode(2, 50, WON, Decider::Policy)).expect("writable");
    drop(writer);

    let found = Calibration::read(&path("out"), &[alice, bob.clone(), bob], None).expect("they fit");
    assert_eq!((found.levels.len(), found.only_tested, found.only_recorded), (12, 1, 1));
    assert_eq!(found.people, ["alice", "bob"]);
    assert_eq!(found.left_out, ["1 episode not played by a person", "1 episode left in the middle"]);
    let first = &found.levels[0];
    assert_eq!((first.level.as_str(), first.persons), ("bed:0", 2));
    assert_eq!(first.people, LevelNumbers { tries: 3, completion: 0.75, ticks: Some(200.0), deaths: 0.25 });
    assert_eq!(first.testers, [LevelNumbers { tries: 10, completion: 1.0, ticks: Some(10.0), deaths: 0.0 }]);
    // Four squares of 1: 1 - 6 * 4 / (12 * 143). Two of 66 pairs are in the other order.
    let time = agreement(&found, Measure::Time);
    let RankCorrelation { value, interval } = time.spearman.expect("both vary");
    assert!((value - (1.0 - 24.0 / 1716.0)).abs() < 1e-8, "{value}");
    let [low, high] = interval.expect("twelve levels");
    assert!(low > 0.9 && low < value && value < high && high < 1.0, "{low} to {high}");
    assert!(time.kendall.is_some_and(|tau| (tau.value - 62.0 / 66.0).abs() < 1e-8), "{time:?}");
    assert_eq!((time.levels, &time.note), (12, &None));
    let completion = agreement(&found, Measure::Completion);
    assert_eq!(completion.spearman, None);
    assert_eq!(completion.note.as_deref(), Some("the tester has the same number on all levels"));

    let words = found.words().join(" ");
    assert!(words.starts_with("12 levels of bed:0..12 were played by 2 people (alice, bob) in 14 tries."), "{words}");
    assert!(words.contains("1 level not played by people, 1 level played by people and not tested"), "{words}");
    assert!(!words.contains("too few"), "{words}");
    let page = found.to_html();
    assert_eq!(
        page.matches("<circle class=\"dot").count(),
        39,
        "a dot for each level and measure, and one in each legend"
    );
    assert!(page.contains("0.99 (") && page.contains("Bonett and Wright"), "{page}");
    let text = found.to_markdown();
    assert!(text.contains("| ppo | time | 12 | 0.99 (") && text.contains("| bed:0 | 2 | 3 | 75.0 % | 200"), "{text}");
}

#[test]
fn few_levels_are_called_too_few() {
    let folder = tempfile::tempdir().expect("a folder");
    results(folder.path(), &[(10, 40), (5, 60), (0, 0)]);
    let tries = [(0, 40, WON), (1, 60, LOST), (1, 50, WON), (2, 10, LOST)];
    let path = recorded(&folder.path().join("a.demo"), header("human"), &tries);
    let found = Calibration::read(folder.path(), std::slice::from_ref(&path), None).expect("they fit");
    assert_eq!(found.people, [path.display().to_string()], "who has no name is known by the file");
    let words = found.words().join(" ");
    assert!(words.contains("With 3 levels, too few are shared to say how well bots and people agree"), "{words}");
    let completion = agreement(&found, Measure::Completion);
    assert_eq!(completion.spearman, Some(RankCorrelation { value: 1.0, interval: None }));
    assert_eq!(completion.note.as_deref(), Some("too few levels for an interval"));
    // The last one was completed by no person.
    assert_eq!(agreement(&found, Measure::Time).levels, 2);
    assert_eq!(found.levels[2].people.ticks, None);
}

#[test]
fn what_does_not_belong_together_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    results(&path("out"), &[(10, 40), (5, 60)]);
    let error = |file: PathBuf| Calibration::read(&path("out"), &[file], None).expect_err("it does not fit");
    let own = |name: &str, header: DemoHeader| recorded(&path(name), header, &[(0, 10, WON)]);
    let found = error(own("game.demo", DemoHeader { game: "bed".to_owned(), ..header("a") })).to_string();
    assert!(found.contains("game.demo: a recording of the game `bed`, but") && found.contains("`garden`"), "{found}");
    let found = error(own("version.demo", DemoHeader { game_version: 2, ..header("a") })).to_string();
    assert!(found.contains("version.demo: recorded with version 2 of `garden`") && found.contains("version 3"));
    let found = error(own("mode.demo", DemoHeader { mode: "lawn".to_owned(), ..header("a") })).to_string();
    assert!(found.contains("people played lawn:0") && found.contains("bed:0..1"), "{found}");
    let found = error(recorded(&path("left.demo"), header("a"), &[(0, 10, DemoEnd::Aborted)])).to_string();
    assert!(found.contains("left.demo was played by a person to its end (1 episode left in the middle)"), "{found}");
    let whole = own("cut.demo", header("a"));
    let bytes = fs::read(&whole).expect("written");
    fs::write(&whole, &bytes[..bytes.len() - 2]).expect("writable");
    let found = error(whole);
    assert!(matches!(found, CalibrationError::Recording(_)) && found.to_string().contains("demo repair"), "{found}");
    assert!(matches!(error(path("none.demo")), CalibrationError::Recording(_)));
    let none = Calibration::read(&path("none"), &[path("cut.demo")], None).expect_err("no results");
    assert!(none.to_string().contains("has no results.json"), "{none}");
}
