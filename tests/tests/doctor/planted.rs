//! Tests of the doctor: it finds and names each planted fault, and finds nothing in healthy games.

use playbot_games::{antmaze::AntMaze, coinrun::CoinRun, maze2d::Maze2d};
use playbot_harness::{
    doctor::{
        CauseKind, DifferenceKind, DoctorComparison, DoctorFinding, DoctorOptions, DoctorReport, FindingKind,
        NonFiniteValue, examine,
    },
    game::Game,
};
use playbot_tests::{Corridor, faulty::Fault};

fn examined(game: &dyn Game, ticks: u32, ignored: &[&str]) -> DoctorReport {
    let options = DoctorOptions {
        ticks,
        ignored: ignored.iter().map(|part| (*part).to_owned()).collect(),
        ..DoctorOptions::new(game.modes()[0])
    };
    examine(game, &options, |_| {}).expect("the game has this mode")
}

/// Returns the only finding in a copy with this fault.
fn finding(fault: Fault) -> (DoctorFinding, DoctorReport) {
    let report = examined(&fault, 60, &[]);
    assert_eq!(report.findings.len(), 1, "{fault:?}:\n{report}");
    (report.findings[0].clone(), report)
}

/// Returns the only finding, which must be a difference of this kind of thing in this comparison.
fn named(
    fault: Fault,
    comparison: DoctorComparison,
    kind: DifferenceKind,
    name: &str,
    field: &str,
) -> (DoctorFinding, DoctorReport) {
    let (finding, report) = finding(fault);
    let difference = finding.difference.clone().expect("a difference");
    assert_eq!((finding.kind, finding.comparison), (FindingKind::Differs, Some(comparison)), "{}", finding.what);
    assert_eq!(difference.kind, kind, "{}", finding.what);
    assert!(difference.name.ends_with(name) && difference.field == field, "{}", finding.what);
    assert_ne!(difference.left, difference.right);
    (finding, report)
}

/// Returns the only note on a copy with this fault, which has no findings.
fn note(fault: Fault) -> (DoctorFinding, DoctorReport) {
    let report = examined(&fault, 60, &[]);
    assert!(report.is_healthy(), "{fault:?}:\n{report}");
    assert_eq!(report.notes.len(), 1, "{fault:?}:\n{report}");
    assert_eq!(report.notes[0].kind, FindingKind::Unnoticed);
    (report.notes[0].clone(), report)
}

fn likeliest(finding: &DoctorFinding) -> CauseKind {
    finding.causes.first().expect("every difference has common causes").kind
}

/// Returns the names of the observed values that never changed.
fn constant(report: &DoctorReport) -> Vec<&str> {
    report.observation.constant.iter().map(|it| it.name.as_str()).collect()
}

#[test]
fn a_healthy_game_has_no_findings() {
    let report = examined(&Fault::None, 60, &[]);
    assert!(report.is_healthy() && report.notes.is_empty(), "{report}");
    assert_eq!(report.comparisons.len(), DoctorComparison::OF_ONE_LEVEL.len());
    for comparison in report.comparisons.iter().filter(|of| of.comparison != DoctorComparison::Snapshots) {
        assert_eq!((comparison.same(), comparison.ticks, comparison.unmatched), (Some(true), 60, 0), "{report}");
    }
    for (what, verdict) in report.safety.all() {
        assert_eq!(verdict.safe, (what != "snapshots of explorers").then_some(true), "{what}: {report}");
    }
}

#[test]
fn what_reflection_sees_and_what_it_does_not_see_is_said() {
    let report = examined(&Fault::None, 30, &[]);
    let compared = |name: &str| report.types.compared.iter().any(|path| path.ends_with(name));
    for name in ["::Gardener", "::Plant", "::Soil", "::Transform"] {
        assert!(compared(name), "{name} is missing in {:?}", report.types.compared);
    }
    let hidden = report.types.not_reflected.len() + report.types.unnamed;
    assert_eq!(hidden, 2, "`Secret` and `Planted` are not reflected: {:?}", report.types);
    assert_eq!(constant(&report), ["gardens"]);
    assert!(report.observation.state_hash);
}

#[test]
fn unseeded_randomness_is_found_at_its_source() {
    let (finding, report) =
        named(Fault::UnseededRandomness, DoctorComparison::Repeat, DifferenceKind::Resource, "::Wind", ".force");
    assert!(finding.causes.iter().any(|cause| cause.kind == CauseKind::Randomness));
    assert_eq!(report.safety.recording.safe, Some(false));
    let skipped = report.of(DoctorComparison::Restart).and_then(|restart| restart.skipped.clone());
    assert!(skipped.expect("it would only repeat the finding").contains("differs from itself"));
}

#[test]
fn iteration_over_a_hash_map_is_found_and_the_map_is_named() {
    let (note, _) = note(Fault::HashOrder);
    let difference = note.difference.clone().expect("a difference");
    assert_eq!((note.comparison, difference.kind), (Some(DoctorComparison::Repeat), DifferenceKind::Component));
    assert!(difference.name.ends_with("::Smells") && difference.field == ".mixture", "{}", note.what);
    assert_eq!(likeliest(&note), CauseKind::HashOrder);
    let evidence = &note.causes[0].evidence;
    assert!(evidence.iter().any(|hint| hint.contains("Herbs.strengths")), "{evidence:?}");
}

#[test]
fn a_reader_of_the_wall_clock_is_found_although_no_clock_runs_without_a_window() {
    let (finding, report) =
        named(Fault::WallClock, DoctorComparison::Clock, DifferenceKind::Resource, "::Sun", ".pace");
    assert_eq!(likeliest(&finding), CauseKind::WallClock);
    assert_eq!(report.of(DoctorComparison::Repeat).and_then(|repeat| repeat.same()), Some(true));
    assert_eq!((report.safety.window.safe, report.safety.recording.safe), (Some(false), Some(true)));
}

#[test]
fn a_wall_clock_that_goes_on_after_a_restart_is_named_as_a_clock_there_too() {
    let report = examined(&Fault::WallTime, 60, &[]);
    let of = |comparison| report.findings.iter().find(|finding| finding.comparison == Some(comparison));
    for comparison in [DoctorComparison::Clock, DoctorComparison::Restart] {
        let finding = of(comparison).unwrap_or_else(|| panic!("{report}"));
        assert_eq!(likeliest(finding), CauseKind::WallClock, "{report}");
    }
    assert_eq!(report.findings.len(), 2, "{report}");
    assert!(report.to_string().contains("it differs with another wall clock, too"), "{report}");
}

#[test]
fn a_score_that_two_arenas_share_is_found() {
    let (finding, report) =
        named(Fault::SharedScore, DoctorComparison::Arenas, DifferenceKind::Resource, "::Score", ".0");
    assert_eq!(likeliest(&finding), CauseKind::SharedByArenas);
    let difference = finding.difference.expect("a difference");
    assert_eq!((difference.left.as_str(), difference.right.as_str()), ("1", "2"));
    let effect = report.of(DoctorComparison::Arenas).and_then(|arenas| arenas.effect.clone()).expect("it is paid out");
    assert_eq!((effect.kind, effect.tick), (DifferenceKind::Reward, 0));
    assert_eq!((report.safety.arenas.safe, report.safety.resume.safe), (Some(false), Some(true)));
}

#[test]
fn state_that_survives_a_restart_is_found() {
    let (finding, report) =
        named(Fault::Survivor, DoctorComparison::Restart, DifferenceKind::Resource, "::Soil", ".wet");
    assert_eq!(likeliest(&finding), CauseKind::SurvivesRestart);
    assert_eq!((report.safety.resume.safe, report.safety.threads.safe), (Some(false), Some(true)));
}

#[test]
fn entities_that_survive_a_restart_are_counted() {
    let (finding, _) = finding(Fault::LeftOvers);
    let difference = finding.difference.expect("a difference");
    assert_eq!((finding.comparison, difference.kind), (Some(DoctorComparison::Restart), DifferenceKind::Entities));
    assert!(difference.name.contains("Plant"), "{}", difference.name);
    assert_eq!((difference.left.as_str(), difference.right.as_str()), ("4", "8"));
}

#[test]
fn a_record_that_lasts_and_that_no_agent_notices_is_a_note_and_can_be_left_out() {
    let (note, report) = note(Fault::LastingRecord);
    assert_eq!(note.comparison, Some(DoctorComparison::Restart), "{report}");
    let difference = note.difference.clone().expect("a difference");
    assert!(difference.name.ends_with("::Record") && difference.field == ".0", "{report}");
    assert_eq!(likeliest(&note), CauseKind::SurvivesRestart);
    assert_eq!(report.safety.resume.safe, Some(true));
    let text = report.to_string();
    for words in [
        "Notes: state that differs, and that no agent noticed",
        "no difference that agents notice in ",
        "but see the notes on state that differs",
        "for 60 ticks. 1 note.",
    ] {
        assert!(text.contains(words), "`{words}` is missing in:\n{text}");
    }
    assert!(examined(&Fault::LastingRecord, 60, &["::Record"]).notes.is_empty());
}

#[test]
fn a_measurement_that_no_agent_notices_is_noted_once_as_a_clock() {
    let (note, report) = note(Fault::Measured);
    assert_eq!((note.comparison, likeliest(&note)), (Some(DoctorComparison::Repeat), CauseKind::WallClock), "{report}");
    assert!(note.causes[0].evidence[0].starts_with("`Labour.took` is a `"), "{:?}", note.causes[0]);
    let compared = report.comparisons.iter().filter(|comparison| comparison.skipped.is_none());
    let all_but_snapshots = DoctorComparison::OF_ONE_LEVEL.len() - 1;
    assert_eq!(compared.count(), all_but_snapshots, "a note hides no other comparison");
}

#[test]
fn another_entity_that_no_agent_notices_is_a_note_that_names_both() {
    let (note, report) = note(Fault::Favourite);
    assert_eq!(likeliest(&note), CauseKind::EntityOrder, "{report}");
    let difference = note.difference.clone().expect("a difference");
    assert!(difference.left.starts_with("[Plant], number "), "{}", difference.left);
    assert_ne!(difference.left, difference.right);
}

#[test]
fn a_clock_comes_before_its_effects_in_the_list_of_a_finding() {
    let (finding, report) =
        named(Fault::MeasuredWind, DoctorComparison::Repeat, DifferenceKind::Resource, "::Labour", ".took");
    assert_eq!(likeliest(&finding), CauseKind::WallClock);
    let others = report.of(DoctorComparison::Repeat).map(|repeat| repeat.others.clone()).expect("it was made");
    assert!(others.iter().any(|other| other.name.ends_with("::Wind")), "{report}");
}

#[test]
fn a_difference_is_a_finding_if_agents_notice_it_only_when_their_episode_ends() {
    let report = examined(&Fault::Sleeper, 10, &[]);
    assert_eq!((report.findings.len(), report.notes.len()), (1, 0), "{report}");
    let repeat = report.of(DoctorComparison::Repeat).expect("it was made");
    let (first, effect) = (repeat.first.as_ref().expect("it differs"), repeat.effect.as_ref().expect("it is paid out"));
    assert_eq!((first.tick, effect.kind), (0, DifferenceKind::Reward), "{report}");
    assert!(effect.tick >= 10, "an episode lasts longer than the ten ticks: {report}");
}

#[test]
fn what_reflection_cannot_see_shows_in_what_agents_get() {
    let (finding, _) = named(Fault::Hidden, DoctorComparison::Repeat, DifferenceKind::Reward, "reward", "");
    assert!(finding.causes.iter().any(|cause| cause.kind == CauseKind::Randomness));
}

#[test]
fn values_that_are_no_numbers_are_named_with_their_tick() {
    let (finding, report) = finding(Fault::NotFinite);
    assert_eq!(finding.kind, FindingKind::NotFinite);
    let first = NonFiniteValue { tick: 7, name: "tallest".to_owned(), value: "inf".to_owned() };
    assert_eq!(report.observation.not_finite, Some(first));
}

#[test]
fn a_panic_is_a_finding_and_ends_only_the_examination() {
    let (finding, _) = finding(Fault::Panic);
    assert_eq!(finding.kind, FindingKind::Fault);
    assert!(finding.what.contains("the garden burns"), "{}", finding.what);
}

#[test]
fn an_observation_that_never_changes_is_a_finding() {
    let (finding, report) = finding(Fault::Blind);
    assert_eq!(finding.kind, FindingKind::Blind);
    assert_eq!(constant(&report), ["x", "tallest", "gardens"]);
}

#[test]
fn the_report_names_the_cause_and_what_to_do() {
    let text = finding(Fault::Survivor).1.to_string();
    for words in [
        "again after a restart",
        "DIFFERS at tick 0",
        "second episode",
        "common cause: state that survives a restart: a resource, a Local, a static",
        "what to do: set it back when an episode starts",
        "`Restart::Rebuild`, which builds the World anew",
        "a field with #[reflect(ignore)]",
        "1 finding.",
    ] {
        assert!(text.contains(words), "`{words}` is missing in:\n{text}");
    }
}

#[test]
fn the_report_says_how_much_was_compared_and_how_to_compare_more() {
    let report = examined(&Fault::None, 60, &[]);
    assert!(report.comparisons.iter().all(|comparison| comparison.episodes >= 1), "{report}");
    assert_eq!(
        report.safety.window.comparisons,
        [DoctorComparison::Repeat, DoctorComparison::Clock, DoctorComparison::Archetypes]
    );
    let text = report.to_string();
    for words in [
        "no difference in 60 ticks, ",
        "yes (compared: twice in one thread, on two threads)",
        "no difference was found in 60 ticks of this one level",
        "`--ticks 600` plays longer, `--level 1` another level",
        "No findings: the same actions played the same game for 60 ticks.",
    ] {
        assert!(text.contains(words), "`{words}` is missing in:\n{text}");
    }
}

/// Returns the report on levels 0 and 1 of a copy with this fault.
fn examined_on_two_levels(fault: Fault) -> DoctorReport {
    let options = DoctorOptions { ticks: 60, further_levels: vec![1], ..DoctorOptions::new("bed") };
    examine(&fault, &options, |_| {}).expect("the game has this mode")
}

#[test]
fn further_levels_are_played_twice_and_each_level_after_another() {
    let report = examined_on_two_levels(Fault::None);
    assert!(report.is_healthy() && report.notes.is_empty(), "{report}");
    let further = &report.comparisons[DoctorComparison::OF_ONE_LEVEL.len()..];
    let made: Vec<_> = further.iter().map(|of| (of.comparison, of.level, of.before, of.ticks)).collect();
    let other = DoctorComparison::OtherLevel;
    assert_eq!(
        made,
        [(other, 0, Some(1), 60), (DoctorComparison::Repeat, 1, None, 60), (other, 1, Some(0), 60)],
        "{report}"
    );
    assert_eq!((report.level, report.further_levels.as_slice()), (0, &[1][..]));
    let text = report.to_string();
    for words in [
        "mode bed, levels 0 and 1\n",
        "Copies of the game played level 0 for 60 ticks",
        "\nThen level 1, in fewer ways: `--level 1` alone makes all comparisons on it.\n  twice in one thread ",
        "\n  after level 1 ",
        "\n  after level 0 ",
        "(compared: twice in one thread, again after a restart, after another level)",
        "no difference was found in 60 ticks of levels 0 and 1, not that there",
        "`--level 2` another level",
    ] {
        assert!(text.contains(words), "`{words}` is missing in:\n{text}");
    }
}

#[test]
fn state_of_one_level_that_survives_into_the_next_is_found() {
    assert!(examined(&Fault::Flood, 60, &[]).is_healthy(), "one level alone does not show it");
    let report = examined_on_two_levels(Fault::Flood);
    assert_eq!(report.findings.len(), 1, "{report}");
    let finding = &report.findings[0];
    assert_eq!((finding.comparison, finding.level), (Some(DoctorComparison::OtherLevel), Some(1)), "{report}");
    let difference = finding.difference.as_ref().expect("a difference");
    assert!(difference.name.ends_with("::Soil") && difference.field == ".wet", "{report}");
    assert_eq!((difference.left.as_str(), difference.right.as_str()), ("0.5", "2.0"), "{report}");
    assert_eq!(likeliest(finding), CauseKind::SurvivesRestart);
    assert!(finding.what.starts_with("level 1 after level 0: resource `"), "{}", finding.what);
    assert_eq!(report.safety.resume.why, "differs on level 1 after level 0", "{report}");
    assert_eq!(report.safety.threads.safe, Some(true), "{report}");
}

#[test]
fn a_fault_of_the_second_level_alone_is_found_there() {
    let report = examined_on_two_levels(Fault::Storm);
    assert_eq!(report.findings.len(), 1, "{report}");
    let finding = &report.findings[0];
    assert_eq!((finding.comparison, finding.level), (Some(DoctorComparison::Repeat), Some(1)), "{report}");
    assert!(finding.what.starts_with("level 1, twice in one thread: resource `"), "{}", finding.what);
    assert_eq!(report.safety.recording.why, "differs on level 1, twice in one thread", "{report}");
    let last = report.comparisons.last().and_then(|of| of.skipped.clone()).expect("it would only repeat the finding");
    assert!(last.contains("differs from itself"), "{last}");
}

#[test]
fn what_a_restart_leaves_is_not_sought_after_another_level_again() {
    let report = examined_on_two_levels(Fault::Survivor);
    assert_eq!(report.findings.len(), 1, "{report}");
    assert_eq!(report.findings[0].comparison, Some(DoctorComparison::Restart), "{report}");
    let skipped = report.of(DoctorComparison::OtherLevel).and_then(|of| of.skipped.clone()).expect("it is skipped");
    assert!(skipped.contains("differs after a restart of one level"), "{skipped}");
}

#[test]
fn an_unknown_mode_is_an_error() {
    assert!(examine(&Fault::None, &DoctorOptions::new("desert"), |_| {}).is_err());
}

#[test]
fn the_games_of_this_workspace_are_healthy() {
    let games: [(&dyn Game, u32); 3] = [(&CoinRun::default(), 150), (&Maze2d::default(), 150), (&AntMaze, 60)];
    for (game, ticks) in games {
        let report = examined(game, ticks, &[]);
        assert!(report.is_healthy(), "{report}");
        let mut compared = report.comparisons.iter().filter(|comparison| comparison.skipped.is_none());
        assert!(compared.all(|comparison| comparison.ticks == ticks), "{report}");
    }
    assert!(examined(&Corridor, 60, &[]).is_healthy());
}
