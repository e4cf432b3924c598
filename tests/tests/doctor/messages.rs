//! Tests of the doctor on messages that outlive an episode.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{
    doctor::{CauseKind, DoctorComparison, DoctorOptions, DoctorReport, examine},
    foreign::{ForeignGame, Restart},
};

/// Frames of an episode.
const FRAMES: u32 = 8;

#[derive(Component)]
struct Hero;

#[derive(Message)]
struct Died;

#[derive(Resource, Default)]
struct Frames(u32);

#[derive(Resource, Default)]
struct Deaths(usize);

/// A game that counts its deaths. The count begins at 0 in each level.
fn game(app: &mut App) {
    app.add_message::<Died>()
        .init_resource::<Frames>()
        .init_resource::<Deaths>()
        .add_systems(Startup, |mut commands: Commands| _ = commands.spawn((Hero, Transform::default())))
        .add_systems(Update, (count_deaths, |mut frames: ResMut<Frames>| frames.0 += 1).chain());
}

fn count_deaths(mut died: MessageReader<Died>, mut deaths: ResMut<Deaths>) {
    deaths.0 += died.read().count();
}

/// Returns the adapter of a game with this plugin besides.
fn heroes(more: fn(&mut App)) -> ForeignGame {
    let game = move |app: &mut App| {
        game(app);
        more(app);
    };
    ForeignGame::new("heroes", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["frames", "deaths"], |frames: Res<Frames>, deaths: Res<Deaths>| [frames.0 as f32, deaths.0 as f32])
        .end(|frames: Res<Frames>| (frames.0 >= FRAMES).then_some(EpisodeEnd::LOST))
        .restart(Restart::Startup)
        .level(|mut frames: ResMut<Frames>, mut deaths: ResMut<Deaths>| (frames.0, deaths.0) = (0, 0))
}

/// The hero dies in the last frame of each episode, after the deaths are counted.
fn dies_last(app: &mut App) {
    app.add_systems(PostUpdate, |frames: Res<Frames>, mut died: MessageWriter<Died>| {
        if frames.0 >= FRAMES {
            died.write(Died);
        }
    });
}

/// A hero that is taken away has died.
fn dies_if_removed(app: &mut App) {
    app.add_observer(|_: On<Remove, Hero>, mut died: MessageWriter<Died>| _ = died.write(Died));
}

fn examined(game: &ForeignGame, ignored: &[&str]) -> DoctorReport {
    let ignored = ignored.iter().map(|part| (*part).to_owned()).collect();
    let options = DoctorOptions { ticks: 40, ignored, ..DoctorOptions::new("default") };
    examine(game, &options, |_| {}).expect("the game has this mode")
}

/// Returns the call that drops the messages of these games.
fn call() -> String {
    format!("`.forget_messages::<{}>()`", std::any::type_name::<Died>())
}

#[test]
fn messages_that_change_the_next_episode_are_a_hint_of_the_finding_with_the_call_that_drops_them() {
    let report = examined(&heroes(dies_last), &[]);
    let restart = report.findings.iter().find(|finding| finding.comparison == Some(DoctorComparison::Restart));
    let finding = restart.unwrap_or_else(|| panic!("{report}"));
    assert_eq!(finding.causes[0].kind, CauseKind::SurvivesRestart, "{report}");
    assert!(finding.causes[0].evidence.iter().any(|hint| hint.contains(&call())), "{report}");
    assert!(report.left_messages.is_empty(), "some systems may have read them: {report}");
    let mended = examined(&heroes(dies_last).forget_messages::<Died>(), &[]);
    assert!(mended.is_healthy() && !mended.to_string().contains(&call()), "{mended}");
}

#[test]
fn messages_of_a_restart_are_a_note_even_if_each_episode_begins_with_them() {
    let report = examined(&heroes(dies_if_removed), &[]);
    assert_eq!(report.left_messages, [std::any::type_name::<Died>()], "{report}");
    assert!(report.is_healthy(), "the first episode has them, too: {report}");
    let text = report.to_string();
    assert!(text.contains(&call()) && text.ends_with(" 1 note."), "{text}");
    for silent in [
        examined(&heroes(dies_if_removed).forget_messages::<Died>(), &[]),
        examined(&heroes(dies_if_removed), &["::Died"]),
        examined(&heroes(|_| {}), &[]),
    ] {
        assert!(silent.is_healthy() && silent.left_messages.is_empty(), "{silent}");
    }
}
