//! Tests of the doctor on foreign games: each planted fault is found and named as precisely as possible.

use bevy::prelude::*;
use playbot_harness::{
    doctor::{
        CauseKind, DifferenceKind, DoctorComparison, DoctorDifference, DoctorFinding, DoctorOptions, DoctorReport,
        FindingKind, examine,
    },
    foreign::ForeignGame,
};
use playbot_tests::foreign::{
    catch::{catch_game, game},
    faulty_catch::{CatchFault, Mood, faulty_catch},
};

fn examined(game: &ForeignGame) -> DoctorReport {
    let options = DoctorOptions { ticks: 120, ..DoctorOptions::new("default") };
    examine(game, &options, |_| {}).expect("the game has this mode")
}

/// Returns the finding of this comparison in a copy with this fault, after a check that it is the only one.
fn found(fault: CatchFault, comparison: DoctorComparison) -> (DoctorFinding, DoctorDifference, DoctorReport) {
    let report = examined(&faulty_catch(fault));
    let finding = report.findings.iter().find(|finding| finding.comparison == Some(comparison));
    let finding = finding.unwrap_or_else(|| panic!("{fault:?}:\n{report}")).clone();
    let difference = finding.difference.clone().unwrap_or_else(|| panic!("{fault:?}:\n{report}"));
    (finding, difference, report)
}

/// Positions of apples are reflected, whatever moves them.
fn check_that_the_apple_is_named(difference: &DoctorDifference, report: &DoctorReport) {
    assert_eq!(difference.kind, DifferenceKind::Component, "{report}");
    assert!(difference.name.ends_with("Transform"), "{report}");
    assert_eq!(difference.entity.as_deref(), Some("[Apple]"), "{report}");
}

#[test]
fn a_healthy_foreign_game_has_no_findings() {
    let report = examined(&catch_game());
    assert!(report.is_healthy(), "{report}");
    let arenas =
        report.of(DoctorComparison::Arenas).and_then(|arenas| arenas.skipped.clone()).expect("there can be only one");
    assert!(arenas.contains("holds only one arena"), "{arenas}");
    assert_eq!(report.safety.arenas.safe, None);
    let skipped = [DoctorComparison::Arenas, DoctorComparison::Snapshots];
    for comparison in DoctorComparison::OF_ONE_LEVEL.into_iter().filter(|comparison| !skipped.contains(comparison)) {
        let compared = report.of(comparison).expect("it was made");
        assert_eq!((compared.same(), compared.ticks), (Some(true), 120), "{report}");
    }
}

#[test]
fn a_panic_in_a_startup_system_is_the_only_finding() {
    fn open_door() {
        panic!("the door is locked");
    }
    let broken = ForeignGame::new("broken", 1, |app: &mut App| {
        game(app);
        app.add_systems(Startup, open_door);
    });
    let broken = broken.keys([vec![], vec![KeyCode::ArrowLeft]]).observe(["a", "b"], || [0.0, 1.0]);
    let report = examined(&broken);
    assert_eq!(report.findings.len(), 1, "{report}");
    assert_eq!(report.findings[0].kind, FindingKind::Fault, "{report}");
    assert!(report.findings[0].what.contains("the game panicked: the door is locked"), "{report}");
    assert_eq!((report.observation.length, report.observation.ticks), (None, 0), "{report}");
}

#[test]
fn unseeded_randomness_is_found_in_the_resource_that_holds_it() {
    let (finding, difference, report) = found(CatchFault::UnseededWind, DoctorComparison::Repeat);
    assert_eq!((difference.kind, difference.tick), (DifferenceKind::Resource, 0), "{report}");
    assert!(difference.name.ends_with("::Wind") && difference.field == ".force", "{report}");
    assert_eq!(finding.causes[0].kind, CauseKind::Randomness);
    assert_eq!((report.findings.len(), report.safety.recording.safe), (1, Some(false)), "{report}");
}

#[test]
fn unseeded_randomness_that_is_kept_nowhere_is_found_in_what_it_moves() {
    let (finding, difference, report) = found(CatchFault::UnseededGust, DoctorComparison::Repeat);
    check_that_the_apple_is_named(&difference, &report);
    assert_eq!((finding.causes[0].kind, report.findings.len()), (CauseKind::Randomness, 1), "{report}");
    let effect = report.of(DoctorComparison::Repeat).and_then(|repeat| repeat.effect.clone()).expect("it is seen");
    assert_eq!((effect.kind, effect.name.as_str()), (DifferenceKind::Observation, "apple_x"), "{report}");
}

#[test]
fn a_resource_that_survives_a_restart_is_named() {
    let (finding, difference, report) = found(CatchFault::EndlessSeason, DoctorComparison::Restart);
    assert_eq!((difference.kind, difference.tick), (DifferenceKind::Resource, 0), "{report}");
    assert!(difference.name.ends_with("::Season") && difference.field == ".frames", "{report}");
    assert_eq!((finding.causes[0].kind, report.findings.len()), (CauseKind::SurvivesRestart, 1), "{report}");
    assert_eq!((report.safety.resume.safe, report.safety.threads.safe), (Some(false), Some(true)), "{report}");
}

#[test]
fn a_local_that_survives_a_restart_is_found_in_what_it_moves_and_is_a_listed_cause() {
    let (finding, difference, report) = found(CatchFault::EndlessLocal, DoctorComparison::Restart);
    check_that_the_apple_is_named(&difference, &report);
    assert_eq!((finding.causes[0].kind, report.findings.len()), (CauseKind::SurvivesRestart, 1), "{report}");
    assert!(report.to_string().contains("a Local"), "{report}");
}

#[test]
fn a_foreign_reader_of_the_wall_clock_is_found() {
    let (finding, difference, report) = found(CatchFault::WallClock, DoctorComparison::Clock);
    check_that_the_apple_is_named(&difference, &report);
    assert_eq!(finding.causes[0].kind, CauseKind::WallClock);
    assert_eq!(report.of(DoctorComparison::Repeat).and_then(|repeat| repeat.same()), Some(true), "{report}");
    assert_eq!(report.safety.window.safe, Some(false), "{report}");
}

#[test]
fn an_order_of_archetypes_that_decides_is_found() {
    let (finding, difference, report) = found(CatchFault::FirstGale, DoctorComparison::Archetypes);
    check_that_the_apple_is_named(&difference, &report);
    assert_eq!((finding.causes[0].kind, report.findings.len()), (CauseKind::ArchetypeOrder, 1), "{report}");
    let [recording, window, resume] =
        [&report.safety.recording, &report.safety.window, &report.safety.resume].map(|verdict| verdict.safe);
    assert_eq!((recording, window, resume), (Some(false), Some(false), Some(true)), "{report}");
    // Another clock brings nothing that changes the order.
    assert_eq!(report.of(DoctorComparison::Clock).and_then(|clock| clock.same()), Some(true), "{report}");
}

#[test]
fn invisible_state_is_listed_with_what_to_do_about_it() {
    let report = examined(&faulty_catch(CatchFault::HiddenMood));
    assert!(report.is_healthy(), "{report}");
    assert!(report.types.not_reflected.iter().any(|path| path.ends_with("::Mood")), "{:?}", report.types);
    let text = report.to_string();
    for words in ["::Mood`", "are not reflected", "Derive `Reflect`", "#[reflect(Resource)]", "`.state_hash`"] {
        assert!(text.contains(words), "`{words}` is missing in:\n{text}");
    }
}

#[test]
fn what_reflection_cannot_see_is_found_through_the_state_hash() {
    let game = faulty_catch(CatchFault::HiddenMood).state_hash(|mood: Res<Mood>| u64::from(mood.0));
    let report = examined(&game);
    assert_eq!(report.findings.len(), 1, "{report}");
    let difference = report.findings[0].difference.as_ref().expect("a difference");
    assert_eq!((difference.kind, difference.tick), (DifferenceKind::StateHash, 0), "{report}");
    assert_eq!(report.findings[0].causes[0].kind, CauseKind::Randomness, "{report}");
}
