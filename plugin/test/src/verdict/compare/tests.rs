//! Tests of the comparison of results.

use crate::verdict::{
    Finding, LevelMaps, LevelOutcome, TesterRecord,
    compare::*,
    folder::{Earlier, TestFolder},
    reports::comparable_command,
    results::RESULTS,
    testing,
    testing::{tester, verdict},
};
use playbot_harness::detector::LevelProof;

fn record(testers: &[&str]) -> TestRecord {
    TestRecord {
        testers: testers.iter().map(|name| TesterRecord::bot(*name)).collect(),
        ..testing::record("hard:0..499")
    }
}

fn written(folder: &Path, record: &TestRecord, levels: &[LevelVerdict]) {
    let (mut open, _) = TestFolder::open(folder, record, Earlier::Replace).expect("writable");
    levels.iter().for_each(|level| open.keep(level).expect("writable"));
    open.finish().expect("writable");
}

/// Compares these levels, tested by `testers` before and now.
fn compared(before: &[LevelVerdict], now: &[LevelVerdict], testers: &[&str]) -> Comparison {
    let parent = tempfile::tempdir().expect("a folder");
    let (one, other) = (parent.path().join("before"), parent.path().join("now"));
    written(&one, &record(testers), before);
    written(&other, &TestRecord { seed: 9, ..record(testers) }, now);
    Comparison::read(&one, &other).expect("comparable")
}

/// Makes a level that a tester without randomness plays once.
fn exact(index: u64, solved: u64) -> LevelVerdict {
    LevelVerdict { testers: vec![tester("plan", solved, 1, true)], ..verdict(index, solved, 1) }
}

fn names(changes: &[Change]) -> Vec<&str> {
    changes.iter().map(|change| change.level.as_str()).collect()
}

#[test]
fn one_episode_is_enough_where_nothing_is_left_to_chance() {
    let before: Vec<_> = (0..500).map(|index| exact(index, u64::from(index != 9))).collect();
    let now: Vec<_> = (0..500).map(|index| exact(index, u64::from(![3, 77, 410].contains(&index)))).collect();
    let comparison = compared(&before, &now, &["plan"]);
    assert_eq!(names(&comparison.harder), ["hard:3", "hard:77", "hard:410"]);
    assert_eq!(names(&comparison.easier), ["hard:9"]);
    assert_eq!((comparison.levels, comparison.harder[0].probability), (500, None));
    assert!(comparison.has_alarms());
    let words = comparison.harder[0].to_string();
    assert_eq!(words, "hard:3: solved 1 of 1, now 0 of 1 (plan, which draws no random numbers)");
    let same = compared(&before, &before, &["plan"]);
    assert!(!same.has_alarms() && same.easier.is_empty(), "{same:?}");
}

#[test]
fn chance_gives_no_alarm_and_what_is_more_does() {
    // 500 levels of which each is solved 10 times of 20, give or take a few.
    let level = |index, solved| verdict(index, solved, 20);
    let before: Vec<_> = (0..500).map(|index| level(index, 8 + index % 5)).collect();
    let mut now: Vec<_> = (0..500).map(|index| level(index, 8 + (index + 2) % 5)).collect();
    assert!(!compared(&before, &now, &["random"]).has_alarms());
    // 0 or 20 of 20 instead of 8 to 12 survives 500 tests; 2 of 20 does not.
    (now[4], now[5], now[7]) = (level(4, 0), level(5, 20), level(7, 2));
    let comparison = compared(&before, &now, &["random"]);
    assert_eq!((names(&comparison.harder), names(&comparison.easier)), (vec!["hard:4"], vec!["hard:5"]));
    assert!(comparison.harder[0].probability.is_some_and(|p| p < 1e-4), "{comparison:?}");
    // A single episode of a tester that draws is not significant.
    assert!(!compared(&[verdict(0, 1, 1)], &[verdict(0, 0, 1)], &["random"]).has_alarms());
}

#[test]
fn a_new_proof_and_a_new_finding_are_always_reported() {
    let why = "walled in".to_owned();
    let finding = |tester: Option<&str>| Finding {
        detector: "panic".to_owned(),
        tester: tester.map(str::to_owned),
        episode: Some(0),
        tick: Some(4),
        message: "words".to_owned(),
        file: None,
        settings: Vec::new(),
    };
    let walled = LevelVerdict {
        outcome: LevelOutcome::ProvedUnsolvable,
        proof: LevelProof::Unsolvable { why },
        ..verdict(0, 0, 1)
    };
    let broken = LevelVerdict { findings: vec![finding(Some("random")), finding(Some("gone"))], ..verdict(1, 1, 1) };
    let (before, now) = ([verdict(0, 1, 1), verdict(1, 1, 1)], [walled, broken]);
    let comparison = compared(&before, &now, &["random"]);
    assert_eq!((names(&comparison.unsolvable), comparison.harder.len()), (vec!["hard:0"], 0));
    let found: Vec<String> = comparison.new_findings.iter().map(ToString::to_string).collect();
    assert_eq!(found, ["hard:1: panic (random)"]);
    let back = compared(&now, &before, &["random"]);
    assert_eq!((names(&back.easier), back.gone_findings.len()), (vec!["hard:0"], 1));
    assert!(!back.has_alarms());
}

#[test]
fn squares_of_a_level_that_is_no_longer_solved_are_reported_where_no_tester_comes_now() {
    // Four squares in a row and four above them, each of side 2, from -1, 0.
    let walked = |solved: u64, squares: &[u64]| {
        let visits = squares.iter().map(|square| [*square, 5]).collect();
        let maps = LevelMaps { x: -1.0, side: 2.0, columns: 4, rows: 2, visits, ..LevelMaps::default() };
        LevelVerdict { maps: Some(maps), ..exact(0, solved) }
    };
    let unreached = |before: LevelVerdict, now: LevelVerdict| compared(&[before], &[now], &["plan"]).unreached;
    let found = unreached(walked(1, &[0, 1, 2, 3, 7]), walked(0, &[0, 1, 4]));
    // Squares 2, 3 and 7; square 2 is beside square 1.
    let expected = UnreachedSquares { level: "hard:0".to_owned(), squares: 3, at: [4.0, 1.0], nearest: [2.0, 1.0] };
    assert_eq!(found, [expected]);
    let words =
        "hard:0: 3 squares visited before, such as (4.0, 1.0); now no tester comes further than (2.0, 1.0) there";
    assert_eq!(found[0].to_string(), words);
    assert!(unreached(walked(1, &[0, 1, 2]), walked(1, &[0, 1])).is_empty(), "another path leads to the goal");
    assert!(unreached(walked(1, &[0, 1]), walked(0, &[0, 1, 2])).is_empty(), "no square is missing");
    assert!(unreached(walked(1, &[0, 1]), exact(0, 0)).is_empty(), "there is no map now");
    let mut moved = walked(0, &[0]);
    moved.maps.iter_mut().for_each(|maps| maps.side = 3.0);
    assert!(unreached(walked(1, &[0, 1]), moved).is_empty(), "the squares are others");
}

#[test]
fn without_maps_the_cells_of_positions_are_compared_in_the_larger_size() {
    let went = |solved: u64, side: f32, columns: i32, entity: Option<&str>| {
        let cells = (0..columns).map(|column| [column, 0]).collect();
        let reached = Some(ReachedCells { side, cells, entity: entity.map(str::to_owned) });
        LevelVerdict { reached, ..exact(0, solved) }
    };
    let unreached = |before: LevelVerdict, now: LevelVerdict| compared(&[before], &[now], &["plan"]).unreached;
    // Six cells of side 1 are three of side 2.
    let found = unreached(went(1, 1.0, 6, None), went(0, 2.0, 2, None));
    let expected = UnreachedSquares { level: "hard:0".to_owned(), squares: 1, at: [5.0, 1.0], nearest: [3.0, 1.0] };
    assert_eq!(found, std::slice::from_ref(&expected));
    let unsolved = unreached(went(0, 1.0, 6, None), went(0, 2.0, 2, None));
    assert_eq!(unsolved, [expected], "a third is missing on a level that was not solved before either");
    assert!(unreached(went(0, 1.0, 6, None), went(0, 1.0, 5, None)).is_empty(), "a sixth may be chance");
    let drawn = |level: LevelVerdict| LevelVerdict { testers: vec![tester("plan", 0, 1, false)], ..level };
    let others = unreached(drawn(went(0, 1.0, 6, None)), drawn(went(0, 2.0, 2, None)));
    assert!(others.is_empty(), "another seed leads to other cells");
    assert_eq!(unreached(went(1, 1.0, 6, None), went(0, 1.0, 5, None)).len(), 1);
    assert!(unreached(went(1, 1.0, 6, None), went(1, 1.0, 5, None)).is_empty(), "it is solved");
    assert!(unreached(went(1, 1.0, 6, None), went(0, 1.0, 5, Some("the one"))).is_empty(), "another entity");
    assert!(unreached(went(1, 0.0, 6, None), went(0, 1.0, 5, None)).is_empty(), "no side of a cell");
    assert!(unreached(went(1, 0.75, 6, None), went(0, 1.0, 5, None)).is_empty(), "no power of two");
}

/// Makes an unsolved level of these testers, with the cells of so many columns; without cells for none.
fn unsolved(testers: &[&str], columns: i32) -> LevelVerdict {
    let cells = (0..columns).map(|column| [column, 0]).collect();
    let reached = (columns > 0).then_some(ReachedCells { side: 1.0, cells, entity: None });
    LevelVerdict {
        reached,
        testers: testers.iter().map(|name| tester(name, 0, 1, false)).collect(),
        ..verdict(0, 0, 1)
    }
}

/// Compares a level with an earlier one. Returns why its places are not compared, and the command that compares them.
fn left_out(before: (&TestRecord, LevelVerdict), now: (&TestRecord, LevelVerdict)) -> (Vec<String>, Option<String>) {
    let parent = tempfile::tempdir().expect("a folder");
    let (one, other) = (parent.path().join("before"), parent.path().join("now"));
    written(&one, before.0, &[before.1]);
    written(&other, now.0, &[now.1]);
    let comparison = Comparison::read(&one, &other).expect("comparable");
    let command = comparable_command("jump", now.0, &comparison);
    let command = command.map(|command| command.replace(&one.display().to_string(), "BEFORE"));
    assert!(comparison.unreached.is_empty(), "{comparison:?}");
    (comparison.places_left_out, command)
}

#[test]
fn places_of_other_testers_are_not_compared_and_the_command_names_the_earlier_ones() {
    let (two, one) = (["chaos", "random"], ["chaos"]);
    let before = TestRecord { seed: 4, episodes: 3, ..record(&two) };
    let (why, command) = left_out((&before, unsolved(&two, 6)), (&record(&one), unsolved(&one, 2)));
    let expected = "the testers differ (chaos; before: chaos, random): 1 unsolved level, such as hard:0";
    assert_eq!(why, [expected]);
    let expected = "jump test garden --levels hard:0..499 --bot chaos,random --episodes 3 --seed 4 --against BEFORE --out \
                    runs/comparable";
    assert_eq!(command.as_deref(), Some(expected));
    let (why, command) = left_out((&record(&two), unsolved(&two, 0)), (&record(&one), unsolved(&one, 0)));
    assert!(why.is_empty() && command.is_none(), "a game without positions: {why:?}");
    let solved = LevelVerdict { testers: vec![tester("chaos", 1, 1, false)], ..verdict(0, 1, 1) };
    let (why, _) = left_out((&record(&two), unsolved(&two, 6)), (&record(&one), solved));
    assert!(why.is_empty(), "a solved level needs no explanation: {why:?}");
}

#[test]
fn levels_that_only_testers_of_one_test_solved_are_named_and_are_no_change() {
    let level = |index, solved: [(&str, u64); 2]| LevelVerdict {
        testers: solved.map(|(name, solved)| tester(name, solved, 1, true)).to_vec(),
        ..verdict(index, solved[0].1 + solved[1].1, 2)
    };
    let parent = tempfile::tempdir().expect("a folder");
    let (one, other) = (parent.path().join("before"), parent.path().join("now"));
    let was = |index, search, chaos| level(index, [("search", search), ("chaos", chaos)]);
    let is = |index, jump, chaos| level(index, [("jump", jump), ("chaos", chaos)]);
    written(
        &one,
        &record(&["search", "chaos"]),
        &[was(0, 1, 0), was(1, 1, 0), was(2, 1, 1), was(3, 0, 0), was(4, 0, 0)],
    );
    written(&other, &record(&["jump", "chaos"]), &[is(0, 0, 0), is(1, 1, 0), is(2, 0, 0), is(3, 1, 0), is(4, 0, 0)]);
    let found = Comparison::read(&one, &other).expect("comparable");
    assert_eq!(found.left_out, ["the tester `jump` was not there before", "the tester `search` is not there now"]);
    let words: Vec<String> = found.other_testers.iter().map(ToString::to_string).collect();
    let expected = [
        "hard:0: solved before by search alone, and the testers differ",
        "hard:3: solved now by jump alone, and the testers differ",
    ];
    assert_eq!(words, expected);
    assert_eq!(names(&found.harder), ["hard:2"], "chaos solved it before, and does not now");
    let said = found.not_comparable().expect("there are such levels");
    let expected = "2 levels cannot be compared, since the testers differ and only those of one test solved them: hard:0, \
                    hard:3";
    assert_eq!(said, expected);
    assert_eq!(found.no_change_sentence(), "The testers of both tests show no change by more than chance.");
    let same = Comparison::read(&one, &one).expect("comparable");
    assert_eq!((same.not_comparable(), same.no_change()), (None, "nothing has changed by more than chance"));
}

#[test]
fn a_level_that_a_new_tester_solves_is_not_counted_as_unsolved() {
    let both = |jumped: u64| LevelVerdict {
        testers: vec![tester("chaos", 0, 1, false), tester("jump", jumped, 1, false)],
        ..unsolved(&["chaos", "jump"], 2)
    };
    let one = ["chaos"];
    let before = record(&one);
    let now = record(&["chaos", "jump"]);
    let solved = LevelVerdict { outcome: LevelOutcome::Solved, ..both(1) };
    let (why, _) = left_out((&before, unsolved(&one, 6)), (&now, solved));
    assert!(why.is_empty(), "{why:?}");
    let (why, _) = left_out((&before, unsolved(&one, 6)), (&now, both(0)));
    assert!(why[0].ends_with(": 1 unsolved level, such as hard:0"), "{why:?}");
}

#[test]
fn places_of_other_draws_and_of_results_without_positions_are_named() {
    let testers = ["chaos"];
    let (before, now) = (record(&testers), TestRecord { seed: 9, episodes: 2, ..record(&testers) });
    let (why, command) = left_out((&before, unsolved(&testers, 6)), (&now, unsolved(&testers, 2)));
    let expected = "the random seeds differ (9; before: 0) and the numbers of episodes differ (2; before: 1), so random \
                    testers went elsewhere on a level that no tester has solved: 1 unsolved level, such as hard:0";
    assert_eq!(why, [expected]);
    assert!(command.is_some_and(|command| command.contains(" --episodes 1 --seed 0 ")));
    let many = TestRecord { maps: MapScope::Failed, ..record(&testers) };
    let (why, command) = left_out((&many, unsolved(&testers, 0)), (&before, unsolved(&testers, 2)));
    let expected = "the earlier results have no visited squares (of so many levels, only failed ones have maps: test fewer): \
                    1 unsolved level, such as hard:0";
    assert_eq!((why, command), (vec![expected.to_owned()], None), "no other tester helps");
    let (why, _) = left_out((&before, unsolved(&testers, 2)), (&before, unsolved(&testers, 0)));
    assert_eq!(why, ["these results have no visited squares: 1 unsolved level, such as hard:0"]);
    let mut moved = unsolved(&testers, 2);
    moved.reached.iter_mut().for_each(|cells| cells.entity = Some("the one".to_owned()));
    let (why, _) = left_out((&before, unsolved(&testers, 2)), (&before, moved));
    assert!(why[0].starts_with("the squares are others: "), "{why:?}");
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let parent = tempfile::tempdir().expect("a folder");
    let (one, other) = (parent.path().join("before"), parent.path().join("now"));
    written(&one, &record(&["random"]), &[verdict(0, 1, 1), verdict(1, 1, 1)]);
    let said = |record: &TestRecord, index| {
        written(&other, record, &[verdict(index, 1, 1)]);
        Comparison::read(&one, &other).map(|comparison| comparison.left_out).map_err(|error| error.to_string())
    };
    let newer = TestRecord { game_version: 2, ..record(&["random"]) };
    assert!(said(&newer, 0).expect_err("newer").contains("versions 1 and 2 of `garden`"));
    let stranger = said(&record(&["jumper"]), 0).expect_err("a stranger");
    assert!(stranger.contains("the tester `jumper` was not there before"), "{stranger}");
    assert!(said(&record(&["random"]), 7).expect_err("other levels").contains("no level is in"));
    // Ranges are known before any play.
    let elsewhere = TestRecord { range: "easy:0..9".parse().expect("a split"), ..record(&["random"]) };
    let words = Comparison::check(&one, &elsewhere).expect_err("another mode").to_string();
    assert!(words.contains("no level is in hard:0..499 and in easy:0..9; name results"), "{words}");
    Comparison::check(&one, &record(&["random"])).expect("the same levels");
    let left_out = said(&record(&["random", "jumper"]), 0).expect("one in common");
    assert_eq!(left_out, ["the tester `jumper` was not there before"]);
    let retrained = TesterRecord { checksum: Some("1".to_owned()), ..TesterRecord::bot("random") };
    let retrained = TestRecord { testers: vec![retrained], ..record(&[]) };
    assert!(said(&retrained, 0).expect_err("another policy").contains("random (file 1)"));
}

#[test]
fn findings_of_detectors_that_did_not_look_before_are_no_news() {
    let parent = tempfile::tempdir().expect("a folder");
    let (one, other) = (parent.path().join("before"), parent.path().join("now"));
    let finding = |detector: &str| Finding {
        detector: detector.to_owned(),
        tester: Some("random".to_owned()),
        episode: Some(0),
        tick: Some(4),
        message: "words".to_owned(),
        file: None,
        settings: Vec::new(),
    };
    let looked = |detectors: &[&str]| {
        let detectors = detectors.iter().map(|detector| (*detector).to_owned()).collect();
        TestRecord { detectors, ..record(&["random"]) }
    };
    written(&one, &looked(&["stuck ticks=300", "runaway"]), &[verdict(0, 1, 1)]);
    let all = ["stuck", "runaway", "late", "panic"].map(finding).to_vec();
    let now = LevelVerdict { findings: all, ..verdict(0, 1, 1) };
    written(&other, &looked(&["stuck ticks=200", "runaway", "late"]), &[now]);
    let comparison = Comparison::read(&one, &other).expect("they can be compared");
    let found: Vec<&str> = comparison.new_findings.iter().map(|finding| finding.detector.as_str()).collect();
    assert_eq!(found, ["panic", "runaway"]);
    assert_eq!(comparison.left_out.len(), 2, "{:?}", comparison.left_out);
}

#[test]
fn earlier_results_with_a_flipped_bit_are_refused_before_anybody_plays() {
    let folder = tempfile::tempdir().expect("a folder");
    let before = folder.path().join("before");
    written(&before, &record(&["random"]), &[verdict(0, 1, 1)]);
    let path = before.join(RESULTS);
    let whole = std::fs::read(&path).expect("results");
    Comparison::check(&before, &record(&["random"])).expect("the same levels");
    for at in 0..whole.len() * 8 {
        let mut bytes = whole.clone();
        bytes[at / 8] ^= 1 << (at % 8);
        std::fs::write(&path, bytes).expect("writable");
        let error = Comparison::check(&before, &record(&["random"])).expect_err("damaged");
        let is_of_file = matches!(error, TestError::Damaged { .. } | TestError::Io { .. });
        assert!(is_of_file && error.to_string().contains(RESULTS), "bit {at}: {error}");
    }
}

fn sharded((range, shard): (&str, Option<&str>)) -> TestRecord {
    TestRecord {
        range: range.parse().expect("a split"),
        shard: shard.map(|shard| shard.parse().expect("a shard")),
        ..record(&["random"])
    }
}

#[test]
fn ranges_and_shards_without_a_common_level_are_reported() {
    let may =
        |one: (&str, Option<&str>), other: (&str, Option<&str>)| may_have_common_levels(&sharded(one), &sharded(other));
    assert!(may(("hard:0..9", None), ("hard:9..20", None)));
    assert!(!may(("hard:0..9", None), ("hard:10..20", None)));
    assert!(!may(("hard:0..9", None), ("easy:0..9", None)));
    assert!(may(("hard:0..9", Some("0/2")), ("hard:0..9", None)));
    assert!(!may(("hard:0..9", Some("0/2")), ("hard:0..9", Some("1/2"))));
    assert!(may(("hard:0..9", Some("0/2")), ("hard:1..9", Some("1/2"))), "1 + 1 is in both");
    assert!(may(("files:a/*.json:0..3", None), ("files:a/b.json:0..0", None)), "it is not known yet");
    assert!(!may(("files:a/*.json:0..3", None), ("hard:0..3", None)));
    let words = no_common_level(&sharded(("hard:0..9", Some("0/2"))), &sharded(("easy:3..4", None)));
    assert_eq!(words, "no level is in shard 0/2 of hard:0..9 and in easy:3..4");
}
