//! A game with a window that ships with a policy, on `bevy_playbot` alone: land a capsule softly.
//!
//! `cargo run --release -p bevy_playbot --features camera,window,bevy/x11 --example lander_window [-- FILE.policy]`
//!
//! The policy plays; F9 gives you the controls, of which there is one (space burns), and takes them back. `PLAYBOT`
//! records or replays instead. The policy was made by `playbot_lab`'s example `lander`.

mod lander_rules;

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_playbot::{
    headless::set_fixed_step,
    prelude::*,
    takeover::{GameIdentity, TakeoverPlugin, TakeoverRequest},
};

use lander_rules::rules::{Capsule, TICK_HZ, add_rules, capsule};

/// Pixels per metre.
const SCALE: f32 = 10.0;
/// The ground, in pixels below the middle of the window.
const GROUND: f32 = 280.0;

fn main() -> AppExit {
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/models/lander.policy");
    let policy = std::env::args_os().nth(1).map_or_else(|| shipped.into(), PathBuf::from);
    // What `PLAYBOT` says goes first.
    let mut takeover = TakeoverPlugin::new(GameIdentity::new("lander", 1).with_mode("moon"));
    if takeover.request.is_none() {
        takeover = takeover.with_request(TakeoverRequest::Policy(policy));
    }
    let window = Window { title: "Lander: space burns, F9 takes over".to_owned(), ..default() };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .add_plugins(PlaybotPlugins::new("lander", 1).with_mode("moon").set(takeover))
        .add_systems(Startup, setup)
        .add_systems(Update, draw);
    set_fixed_step(&mut app, TICK_HZ);
    add_rules(&mut app);
    app.run()
}

fn setup(mut commands: Commands) {
    commands.spawn(Camera2d);
    let ground = Sprite::from_color(Color::srgb(0.4, 0.4, 0.4), Vec2::new(2000.0, 40.0));
    commands.spawn((ground, Transform::from_xyz(0.0, -GROUND - 20.0, 0.0)));
    commands.spawn((
        capsule(0),
        Control::Human,
        KeyBindings::of_sets(&[vec![], vec![KeyCode::Space]]),
        LevelQueue::Uniform { first: 64, last: 127 },
        Sprite::from_color(Color::WHITE, Vec2::new(24.0, 36.0)),
        Transform::default(),
    ));
}

/// Between two ticks the capsule is drawn where its speed has taken it. It glows while it burns.
fn draw(ticks: Res<Time<Fixed>>, mut capsules: Query<(&Capsule, &Action, &mut Transform, &mut Sprite)>) {
    for (capsule, action, mut place, mut sprite) in &mut capsules {
        let height = (capsule.height + capsule.speed * ticks.overstep().as_secs_f32()).max(0.0);
        place.translation.y = SCALE * height - GROUND + 18.0;
        let burns = action.discrete() == Some(1) && capsule.fuel > 0.0;
        sprite.color = if burns { Color::srgb(1.0, 0.6, 0.2) } else { Color::WHITE };
    }
}
