//! Tests of the doctor on snapshots: it names the state that they forget.

use bevy::prelude::*;
use playbot_harness::{
    doctor::{
        CauseKind, DifferenceKind, DoctorComparison, DoctorFinding, DoctorOptions, DoctorReport, FindingKind, examine,
    },
    foreign::{ForeignGame, Restart},
};

#[derive(Component)]
struct Walker;

/// Steps to the right so far. Each is longer than the one before.
#[derive(Resource, Clone, Copy, Default, Reflect)]
#[reflect(Resource)]
struct Steps(u32);

/// Frames in which the walker looked back, which nothing depends on.
#[derive(Resource, Clone, Copy, Default, Reflect)]
#[reflect(Resource)]
struct Looks(u32);

fn game(app: &mut App) {
    app.init_resource::<Steps>().init_resource::<Looks>().add_systems(Startup, begin).add_systems(Update, walk);
}

fn begin(mut commands: Commands, mut steps: ResMut<Steps>, mut looks: ResMut<Looks>) {
    (steps.0, looks.0) = (0, 0);
    commands.spawn((Walker, Transform::default()));
}

fn walk(
    keys: Res<ButtonInput<KeyCode>>,
    mut steps: ResMut<Steps>,
    mut looks: ResMut<Looks>,
    mut walker: Single<&mut Transform, With<Walker>>,
) {
    if keys.pressed(KeyCode::ArrowRight) {
        steps.0 += 1;
        walker.translation.x += 1.0 + 0.125 * steps.0 as f32;
    }
    if keys.pressed(KeyCode::ArrowLeft) {
        looks.0 += 1;
        walker.translation.x -= 1.0;
    }
}

/// Returns the game without snapshots.
fn strip() -> ForeignGame {
    ForeignGame::new("strip", 1, game)
        .keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
        .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
        .reward_delta(|walker: Single<&Transform, With<Walker>>| walker.translation.x)
        .time_limit(60)
        .restart(Restart::Startup)
}

fn place(world: &mut World, at: Transform) {
    let mut walkers = world.query_filtered::<&mut Transform, With<Walker>>();
    if let Ok(mut walker) = walkers.single_mut(world) {
        *walker = at;
    }
}

/// Returns the game with snapshots, which leave the steps or the looks out if the game says so.
fn saving(has_steps: bool, has_looks: bool) -> ForeignGame {
    strip().snapshot(
        |walker: Single<&Transform, With<Walker>>, steps: Res<Steps>, looks: Res<Looks>| (**walker, *steps, *looks),
        move |world: &mut World, (at, steps, looks): &(Transform, Steps, Looks)| {
            place(world, *at);
            if has_steps {
                world.insert_resource(*steps);
            }
            if has_looks {
                world.insert_resource(*looks);
            }
        },
    )
}

fn examined(game: &ForeignGame) -> DoctorReport {
    let options = DoctorOptions { ticks: 120, ..DoctorOptions::new("default") };
    examine(game, &options, |_| {}).expect("the game has this mode")
}

/// Checks that this is a difference in a resource, right after the first return by a snapshot.
fn check(found: &DoctorFinding, kind: FindingKind, resource: &str, report: &DoctorReport) {
    assert_eq!((found.kind, found.comparison), (kind, Some(DoctorComparison::Snapshots)), "{report}");
    let difference = found.difference.as_ref().expect("a difference");
    assert_eq!((difference.kind, difference.tick), (DifferenceKind::Resource, 1), "{report}");
    assert!(difference.name.ends_with(resource) && difference.field == ".0", "{report}");
    assert_eq!(found.causes[0].kind, CauseKind::IncompleteSnapshot, "{report}");
}

#[test]
fn a_snapshot_of_all_state_has_neither_findings_nor_notes() {
    let report = examined(&saving(true, true));
    assert!(report.is_healthy() && report.notes.is_empty(), "{report}");
    let compared = report.of(DoctorComparison::Snapshots).expect("it was made");
    assert_eq!((compared.same(), compared.ticks), (Some(true), 120), "{report}");
    assert_eq!(report.safety.snapshots.safe, Some(true), "{report}");
}

#[test]
fn a_snapshot_that_forgets_a_resource_is_a_finding_that_names_it() {
    let report = examined(&saving(false, true));
    assert_eq!((report.findings.len(), report.notes.len()), (1, 0), "{report}");
    check(&report.findings[0], FindingKind::Differs, "::Steps", &report);
    assert_eq!(report.safety.snapshots.safe, Some(false), "{report}");
    assert_eq!(report.safety.resume.safe, Some(true), "{report}");
    let text = report.to_string();
    for words in [
        "after loading a snapshot: resource `",
        "::Steps.0` differs at tick 1",
        "snapshot loaded: ",
        "common cause: state that the game's snapshot does not hold",
        "NO: differs after loading a snapshot",
    ] {
        assert!(text.contains(words), "`{words}` is missing in:\n{text}");
    }
}

/// Steps so far, on the walker itself.
#[derive(Component, Clone, Copy, Default, Reflect)]
#[reflect(Component)]
struct Stride(u32);

/// Returns a game whose walker steps further each time, with snapshots that leave its stride out unless `has_stride`.
fn pacer(has_stride: bool) -> ForeignGame {
    let game = |app: &mut App| {
        app.add_systems(Startup, |mut commands: Commands| {
            commands.spawn((Walker, Stride::default(), Transform::default()));
        })
        .add_systems(
            Update,
            |keys: Res<ButtonInput<KeyCode>>, walker: Single<(&mut Transform, &mut Stride)>| {
                let (mut at, mut stride) = walker.into_inner();
                if keys.pressed(KeyCode::ArrowRight) {
                    stride.0 += 1;
                    at.translation.x += 1.0 + 0.125 * stride.0 as f32;
                }
            },
        );
    };
    ForeignGame::new("pacer", 1, game)
        .keys([vec![], vec![KeyCode::ArrowRight]])
        .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
        .time_limit(60)
        .restart(Restart::Startup)
        .snapshot(
            |walker: Single<(&Transform, &Stride)>| {
                let (at, stride) = *walker;
                (*at, *stride)
            },
            move |world: &mut World, (at, stride): &(Transform, Stride)| {
                place(world, *at);
                let mut strides = world.query::<&mut Stride>();
                for mut kept in strides.iter_mut(world).filter(|_| has_stride) {
                    *kept = *stride;
                }
            },
        )
}

#[test]
fn a_snapshot_that_forgets_a_component_is_a_finding_that_names_it() {
    let whole = examined(&pacer(true));
    assert!(whole.is_healthy() && whole.notes.is_empty(), "{whole}");
    let report = examined(&pacer(false));
    let [found] = report.findings.as_slice() else { panic!("one finding: {report}") };
    assert_eq!((found.kind, found.comparison), (FindingKind::Differs, Some(DoctorComparison::Snapshots)), "{report}");
    let difference = found.difference.as_ref().expect("a difference");
    assert_eq!((difference.kind, difference.tick), (DifferenceKind::Component, 1), "{report}");
    assert!(difference.name.ends_with("::Stride") && difference.field == ".0", "{report}");
    assert_eq!(found.causes[0].kind, CauseKind::IncompleteSnapshot, "{report}");
    assert!(report.to_string().contains("after loading a snapshot: component `"), "{report}");
}

#[test]
fn forgotten_state_that_no_agent_notices_is_a_note() {
    let report = examined(&saving(true, false));
    assert!(report.is_healthy(), "{report}");
    assert_eq!(report.notes.len(), 1, "{report}");
    check(&report.notes[0], FindingKind::Unnoticed, "::Looks", &report);
}

#[test]
fn a_game_without_snapshots_is_not_compared_with_any() {
    let report = examined(&strip());
    assert!(report.is_healthy(), "{report}");
    let skipped = report.of(DoctorComparison::Snapshots).and_then(|of| of.skipped.clone()).expect("there is none");
    assert!(skipped.starts_with("no snapshot was saved in ") && skipped.ends_with("return by replays"), "{skipped}");
    assert_eq!(report.safety.snapshots.safe, None, "{report}");
}

#[test]
fn inputs_that_snapshots_do_not_hold_are_named() {
    let (clicking, turning) = (saving(true, true).clicks(["Start"]), saving(true, true).wheel([0.0, 1.0]));
    for (game, inputs) in
        [(turning.clone(), "`.wheel`"), (clicking, "`.clicks`"), (turning.clicks(["Start"]), "`.wheel` and `.clicks`")]
    {
        let report = examined(&game);
        let skipped = report.of(DoctorComparison::Snapshots).and_then(|of| of.skipped.clone()).expect("none was saved");
        let why = format!("(snapshots do not hold the state of {inputs}), so explorers return by replays");
        assert!(skipped.starts_with("no snapshot was saved in ") && skipped.ends_with(&why), "{skipped}");
    }
}

#[test]
fn a_snapshot_that_cannot_be_loaded_is_not_compared() {
    let broken = strip().snapshot(
        |walker: Single<&Transform, With<Walker>>| **walker,
        |_: &mut World, _: &Transform| panic!("the saved place is lost"),
    );
    let report = examined(&broken);
    assert!(report.is_healthy(), "{report}");
    let skipped = report.of(DoctorComparison::Snapshots).and_then(|of| of.skipped.clone()).expect("none was loaded");
    assert_eq!(skipped, "the snapshot before tick 1 could not be loaded, so explorers return by replays");
}
