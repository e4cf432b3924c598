//! Tests of the game itself, without any bot: its levels can be finished by hand.

#[path = "../src/game.rs"]
#[allow(dead_code, reason = "what the adapter reads")]
mod game;

use std::time::Duration;

use bevy::{
    input::{InputSystems, keyboard::KeyCode},
    prelude::*,
    render::{RenderPlugin, settings::WgpuSettings},
    time::TimeUpdateStrategy,
    winit::WinitPlugin,
};
use game::{Hero, Level, Map, Run, Screen, game};

/// Returns the game without a window, at 60 frames a second.
fn app(level: u64) -> App {
    let mut app = App::new();
    let render = WgpuSettings { backends: None, ..default() };
    let plugins = DefaultPlugins
        .build()
        .disable::<WinitPlugin>()
        .set(WindowPlugin { primary_window: None, exit_condition: bevy::window::ExitCondition::DontExit, ..default() })
        .set(RenderPlugin { render_creation: render.into(), ..default() });
    app.add_plugins(plugins)
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0)))
        .add_plugins(game);
    app.insert_resource(Level(level)).add_systems(PreUpdate, hop_along.after(InputSystems));
    app.finish();
    app.cleanup();
    app
}

/// Plays as a person who runs, and hops where the ground ahead is another.
fn hop_along(mut keys: ResMut<ButtonInput<KeyCode>>, hero: Option<Single<(&Transform, &Hero)>>, map: Res<Map>) {
    let Some(hero) = hero else { return };
    let next = map.columns[(hero.0.translation.x + 0.8) as usize];
    keys.press(KeyCode::ArrowRight);
    if next.spikes || f32::from(next.ground) != hero.0.translation.y.floor() || hero.1.velocity.y > 0.0 {
        keys.press(KeyCode::Space);
    } else {
        keys.release(KeyCode::Space);
    }
}

/// Plays a level to its end; returns the end, the number of frames and the number of gems.
fn play(level: u64) -> (Screen, u32, u32) {
    let mut app = app(level);
    for frame in 0..2000 {
        app.update();
        let screen = *app.world().resource::<State<Screen>>().get();
        if matches!(screen, Screen::Won | Screen::Lost) {
            return (screen, frame, app.world().resource::<Run>().gems);
        }
    }
    (Screen::Playing, 2000, 0)
}

#[test]
fn most_levels_can_be_finished() {
    let ends: Vec<_> = (0..24).map(play).collect();
    let won = ends.iter().filter(|end| end.0 == Screen::Won).count();
    assert!(won >= 20, "{won} of 24: {ends:?}");
    assert!(ends.iter().all(|end| end.0 != Screen::Playing), "the clock ends what nothing else does: {ends:?}");
    assert!(ends.iter().any(|end| end.2 > 2), "gems lie on the way: {ends:?}");
}

#[test]
fn a_level_plays_the_same_twice() {
    assert_eq!(play(3), play(3));
}
