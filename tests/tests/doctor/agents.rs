//! Tests of the doctor on games whose agents come and go, and on actions of people and masks.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{
    doctor::{DoctorOptions, DoctorReport, FindingKind, examine},
    foreign::{ForeignGame, Restart},
};
use playbot_tests::come_and_go::{Crowded, Deadly};

fn examined(game: &dyn Game) -> DoctorReport {
    let options = DoctorOptions { ticks: 60, ..DoctorOptions::new(game.modes()[0]) };
    examine(game, &options, |_| {}).expect("the game has this mode")
}

/// Returns the only finding, which must be a fault.
fn fault(game: &dyn Game) -> String {
    let report = examined(game);
    let [finding] = report.findings.as_slice() else { panic!("one finding: {report}") };
    assert_eq!(finding.kind, FindingKind::Fault, "{report}");
    finding.what.clone()
}

#[test]
fn an_agent_that_dies_is_a_finding_with_its_number_and_the_remedy() {
    let fault = fault(&Deadly { agent: 0, tick: 20 });
    assert!(fault.starts_with("agent 0: the game despawned it in tick 20 of its World, "), "{fault}");
    assert!(fault.contains("`Episode::terminate`"), "{fault}");
}

#[test]
fn an_agent_that_joins_is_a_finding_with_its_number() {
    let fault = fault(&Crowded);
    assert!(fault.starts_with("agent 9: the game spawned it in tick "), "{fault}");
}

/// Ticks of a game.
#[derive(Resource)]
struct Turn(u32);

/// A game whose first two actions take turns in being illegal. It counts ticks with a legal action, and those with an
/// illegal one.
fn masked(counted: &Arc<[AtomicU64; 2]>) -> ForeignGame {
    let counts = counted.clone();
    let game = move |app: &mut App| {
        let counts = counts.clone();
        app.insert_resource(Turn(0)).add_systems(Startup, |mut turn: ResMut<Turn>| turn.0 = 0).add_systems(
            Update,
            move |keys: Res<ButtonInput<KeyCode>>, mut turn: ResMut<Turn>| {
                let illegal = if turn.0.is_multiple_of(2) { KeyCode::KeyB } else { KeyCode::KeyA };
                // Frames in which a level loads hold no key.
                if keys.get_pressed().next().is_some() {
                    counts[usize::from(keys.pressed(illegal))].fetch_add(1, Ordering::Relaxed);
                    turn.0 += 1;
                }
            },
        );
    };
    ForeignGame::new("turns", 1, game)
        .keys([vec![KeyCode::KeyA], vec![KeyCode::KeyB], vec![KeyCode::KeyC]])
        .legal(|turn: Res<Turn>| [turn.0.is_multiple_of(2), !turn.0.is_multiple_of(2), true])
        .observe(["turn"], |turn: Res<Turn>| [turn.0 as f32])
        .time_limit(20)
        .restart(Restart::Startup)
}

#[test]
fn the_random_actions_of_an_examination_are_legal() {
    let counts: Arc<[AtomicU64; 2]> = Arc::default();
    let report = examined(&masked(&counts));
    assert!(report.is_healthy(), "{report}");
    let [legal, illegal] = [0, 1].map(|at: usize| counts[at].load(Ordering::Relaxed));
    // Two copies play 60 ticks, several times.
    assert!(legal >= 120, "{legal}");
    assert_eq!(illegal, 0);
}

#[test]
fn a_game_in_which_no_action_holds_nothing_has_a_note_with_the_remedy() {
    let report = examined(&masked(&Arc::default()));
    let words =
        "no action of turns holds nothing: while you hold no key, it gets action 0 (KeyA); add `vec![]` to its keys";
    assert_eq!(report.without_idle.as_deref(), Some(words));
    let text = report.to_string();
    assert!(text.contains("Actions: no action of turns holds nothing") && text.ends_with(" 1 note."), "{text}");
    let idle = ForeignGame::new("idle", 1, |_: &mut App| {}).keys([vec![], vec![KeyCode::KeyA]]);
    assert_eq!(examined(&idle.observe(["x"], || [0.0]).time_limit(20)).without_idle, None);
}
