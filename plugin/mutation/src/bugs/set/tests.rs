//! Tests of sets of planted defects.

use crate::bugs::{general::testing::Track, set::*};

fn set() -> BugSet {
    let bug = |id: &str, planted: PlantedPart| PlantedBug {
        id: id.to_owned(),
        game: "track".to_owned(),
        class: "panic".to_owned(),
        about: "the game panics".to_owned(),
        mode: "random+size=9x9".to_owned(),
        level: 7,
        planted,
    };
    let file = LevelFile { path: "levels/track-hole-00.json".to_owned(), hash: u64::MAX - 1 };
    BugSet {
        seed: 5,
        games: vec![BugGame { name: "track".to_owned(), version: 1 }],
        mutants: vec![
            bug("track-panic-00", PlantedPart::Rules { variant: 2 }),
            bug("track-hole-00", PlantedPart::Level(file)),
        ],
        sound: vec![UnmutatedLevels { game: "track".to_owned(), range: "plain:3..9".parse().expect("a split") }],
    }
}

fn levels() -> Vec<(String, String)> {
    vec![("track-hole-00".to_owned(), "{}".to_owned())]
}

#[test]
fn a_set_is_read_back_as_it_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    set().write(folder.path(), &levels(), false).expect("written");
    assert_eq!(BugSet::read(folder.path()).expect("read"), set());
    let text = fs::read_to_string(folder.path().join(MUTANTS)).expect("there");
    for part in [
        r#""format": 1"#,
        r#""base": "random+size=9x9:7""#,
        r#""variant": 2"#,
        r#""hash": "fffffffffffffffe""#,
        r#""range": "plain:3..9""#,
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
    assert_eq!(fs::read_to_string(folder.path().join("levels/track-hole-00.json")).expect("there"), "{}\n");
}

#[test]
fn what_is_there_is_replaced_only_if_that_is_wanted() {
    let folder = tempfile::tempdir().expect("a folder");
    set().write(folder.path(), &levels(), false).expect("written");
    assert!(matches!(set().write(folder.path(), &[], false), Err(BugError::Exists(_))));
    assert!(folder.path().join("levels/track-hole-00.json").exists());
    set().write(folder.path(), &[], true).expect("replaced");
    assert!(!folder.path().join("levels/track-hole-00.json").exists(), "old levels are gone");
}

#[test]
fn damaged_files_are_refused_with_their_line() {
    let folder = tempfile::tempdir().expect("a folder");
    set().write(folder.path(), &levels(), false).expect("written");
    let path = folder.path().join(MUTANTS);
    let text = fs::read_to_string(&path).expect("there");
    let error = |old: &str, new: &str| {
        assert!(text.contains(old), "{old}");
        fs::write(&path, text.replacen(old, new, 1)).expect("writable");
        BugSet::read(folder.path()).expect_err("damaged").to_string()
    };
    for (old, new, words) in [
        ("\"seed\": 5,", "\"seed\": 5", "mutants.json, line 4: expected `,` or `}`"),
        ("\"seed\"", "\"sed\"", "line 3: unknown field `sed`"),
        ("\"format\": 1", "\"format\": 2", "line 1: it is of format 2"),
        ("\"variant\": 2", "\"variant\": -2", "invalid value: integer `-2`"),
        ("track-panic-00", "track-hole-00", "two mutants are called `track-hole-00`"),
        ("levels/track-hole-00", "../track-hole-00", "must be levels/ID.json"),
        ("fffffffffffffffe", "gone", "not made of hexadecimal digits"),
        ("9x9:7\"", "9x9\"", "must be MODE:N"),
        ("\"name\": \"track\"", "\"name\": \"truck\"", "is missing in `games`"),
        ("plain:3..9", "plain:9..3", "first level 9 is after last level 3"),
    ] {
        let reported = error(old, new);
        assert!(reported.contains(words) && reported.contains("make the set again"), "{reported}");
    }
    fs::remove_file(&path).expect("there");
    assert!(matches!(BugSet::read(folder.path()), Err(BugError::Missing(_))));
}

#[test]
fn sets_for_another_version_and_changed_levels_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let other = BugSet { games: vec![BugGame { name: "track".to_owned(), version: 9 }], ..set() };
    let words = other.check(folder.path(), &Track).expect_err("another version").to_string();
    assert!(words.contains("version 9") && words.contains("has version 1"), "{words}");
    let words = set().check(folder.path(), &Track).expect_err("a level is gone").to_string();
    assert!(words.contains("cannot read") && words.contains("track-hole-00.json"), "{words}");
    let mut rules = set();
    rules.mutants.truncate(1);
    rules.check(folder.path(), &Track).expect("there is such a variant");
    rules.mutants[0].planted = PlantedPart::Rules { variant: 99 };
    let words = rules.check(folder.path(), &Track).expect_err("no such variant").to_string();
    assert!(words.contains("has no defect `panic`, which `track-panic-00` needs"), "{words}");
}

#[test]
fn a_level_is_played_from_its_file_and_rules_on_the_sound_level() {
    let set = set();
    let folder = Path::new("bugs");
    assert_eq!(set.mutants[0].played(folder), ("random+size=9x9".to_owned(), 7));
    assert_eq!(set.mutants[1].played(folder), ("files:bugs/levels/track-hole-00.json".to_owned(), 0));
}
