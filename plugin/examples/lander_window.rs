//! A game with a window and a shipped policy, on `bevy_playbot` alone: land a capsule softly.
//!
//! `cargo run --release -p bevy_playbot --features camera,window --example lander_window [-- FILE.policy]`
//!
//! The policy is part of the program, and plays. F9 hands the controls to you and takes them back;
//! the space bar burns. A file, or `PLAYBOT`, lets another policy play, or records or replays
//! instead. The policy was trained by the example `lander` of `playbot`.

#[path = "lander_rules/rules.rs"]
pub mod lander_rules;

use bevy::prelude::*;
use bevy_playbot::{
    headless::set_fixed_step,
    policy_file::{DeviceKind, GameMetadata, PolicyFile, check_policy, install_policy},
    prelude::*,
    takeover::{GameIdentity, TakeoverPlugin, TakeoverRequest},
};

use lander_rules::{Capsule, OBSERVATION, TICK_HZ, add_rules, capsule};

/// The policy that the game ships with.
const SHIPPED: &[u8] = include_bytes!("lander.policy");

/// Pixels per metre.
const SCALE: f32 = 10.0;
/// The ground, in pixels below the middle of the window.
const GROUND: f32 = 280.0;

fn main() -> AppExit {
    // `PLAYBOT` takes precedence.
    let mut takeover = TakeoverPlugin::new(GameIdentity::new("lander", 1).with_mode("moon"));
    if let (None, Some(file)) = (&takeover.request, std::env::args_os().nth(1)) {
        takeover = takeover.with_request(TakeoverRequest::Policy(file.into()));
    }
    let ships_alone = takeover.request.is_none();
    if ships_alone {
        // The key is reserved for the policy that is part of the program.
        takeover.key = None;
    }
    let window = Window { title: "Lander: space burns, F9 takes over".to_owned(), ..default() };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .add_plugins(PlaybotPlugins::new("lander", 1).with_mode("moon").set(takeover))
        .add_systems(Startup, setup)
        .add_systems(Update, draw);
    set_fixed_step(&mut app, TICK_HZ);
    add_rules(&mut app);
    if ships_alone && let Err(error) = add_shipped_policy(&mut app) {
        error!("{error}");
        return AppExit::error();
    }
    app.run()
}

/// Lets the policy that is part of the program play agents under [`Control::Policy`]. F9 hands them
/// to a person.
///
/// # Errors
///
/// The file is damaged, or was made for other rules.
pub fn add_shipped_policy(app: &mut App) -> Result<(), Box<dyn std::error::Error>> {
    let file = PolicyFile::from_bytes("lander.policy".as_ref(), SHIPPED, DeviceKind::default())?;
    let metadata = GameMetadata {
        name: "lander",
        version: 1,
        observations: OBSERVATION.map(String::from).into(),
        actions: ActionSpace::Discrete(2),
        action_names: Vec::new(),
        has_picture: false,
    };
    check_policy(&metadata, &file)?;
    install_policy(app.world_mut(), &file, ActionDraw::Sample);
    app.add_systems(Update, hand_over);
    Ok(())
}

/// Between two ticks, F9 switches the controls between the person and the policy.
fn hand_over(keys: Option<Res<ButtonInput<KeyCode>>>, mut capsules: Query<(&mut Control, &mut ActiveSkill)>) {
    if keys.is_none_or(|keys| !keys.just_pressed(KeyCode::F9)) {
        return;
    }
    for (mut control, mut skill) in &mut capsules {
        *control = if *control == Control::Policy { Control::Human } else { Control::Policy };
        // A skill that was drawn for another state does not fit this one.
        skill.ticks_left = 0;
    }
}

fn setup(mut commands: Commands, shipped: Option<Res<ActivePolicy>>) {
    commands.spawn(Camera2d);
    let ground = Sprite::from_color(Color::srgb(0.4, 0.4, 0.4), Vec2::new(2000.0, 40.0));
    commands.spawn((ground, Transform::from_xyz(0.0, -GROUND - 20.0, 0.0)));
    commands.spawn((
        capsule(0),
        if shipped.is_some() { Control::Policy } else { Control::Human },
        KeyBindings::of_sets(&[vec![], vec![KeyCode::Space]]),
        LevelQueue::Uniform { first: 64, last: 127 },
        Sprite::from_color(Color::WHITE, Vec2::new(24.0, 36.0)),
        Transform::default(),
    ));
}

/// Draws the capsule at its position between two ticks. It glows while it burns.
fn draw(ticks: Res<Time<Fixed>>, mut capsules: Query<(&Capsule, &Action, &mut Transform, &mut Sprite)>) {
    for (capsule, action, mut place, mut sprite) in &mut capsules {
        let height = (capsule.height + capsule.speed * ticks.overstep().as_secs_f32()).max(0.0);
        place.translation.y = SCALE * height - GROUND + 18.0;
        let burns = action.discrete() == Some(1) && capsule.fuel > 0.0;
        sprite.color = if burns { Color::srgb(1.0, 0.6, 0.2) } else { Color::WHITE };
    }
}
