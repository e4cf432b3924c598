//! The game of catching with a planted fault that its adapter does not know, for tests of the doctor.

use std::hash::{BuildHasher, Hasher, RandomState};

use bevy::{prelude::*, time::Real};
use playbot_harness::foreign::ForeignGame;

use super::catch::{Apple, adapted, game};

/// The fault of a copy of the game.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CatchFault {
    /// The unseeded [`Wind`] blows the apple aside.
    UnseededWind,
    /// A gust does the same that is stored nowhere.
    UnseededGust,
    /// Apples fall faster and faster with the [`Season`], which goes on from episode to episode.
    EndlessSeason,
    /// A number of frames in a `Local` does the same.
    EndlessLocal,
    /// Apples sink at the pace of `Time<Real>`.
    WallClock,
    /// Two [`Gale`]s of different archetypes are there, and the first that a query finds blows apples aside.
    FirstGale,
    /// A [`Mood`] is drawn without a seed. Reflection cannot see it, and no observation depends on it.
    HiddenMood,
}

/// Blows apples aside.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Wind {
    force: f32,
}

/// Time for which apples have been ripening.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Season {
    frames: u32,
}

/// Blows apples aside, if it is the first.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(Component)]
pub struct Gale {
    force: f32,
}

/// Makes a gale another archetype.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(Component)]
pub struct Cold;

/// Mood of the gardener.
#[derive(Resource, Default)]
pub struct Mood(pub u32);

/// Returns an unseeded number between 0 and 1.
fn unseeded() -> f32 {
    f32::from(RandomState::new().build_hasher().finish() as u16) / f32::from(u16::MAX)
}

/// Returns the game with this fault, and its default adapter.
pub fn faulty_catch(fault: CatchFault) -> ForeignGame {
    adapted(move |app: &mut App| {
        game(app);
        plant(app, fault);
    })
}

/// Adds the fault before the game's own systems, so that no order is left open.
fn plant(app: &mut App, fault: CatchFault) {
    match fault {
        CatchFault::UnseededWind => app.init_resource::<Wind>().add_systems(PreUpdate, blow),
        CatchFault::UnseededGust => app.add_systems(PreUpdate, gust),
        CatchFault::EndlessSeason => app.init_resource::<Season>().add_systems(PreUpdate, ripen),
        CatchFault::EndlessLocal => app.add_systems(PreUpdate, ripen_unseen),
        CatchFault::WallClock => app.add_systems(PreUpdate, sink),
        CatchFault::FirstGale => app.add_systems(Startup, rise).add_systems(PreUpdate, blow_first),
        CatchFault::HiddenMood => app.init_resource::<Mood>().add_systems(PreUpdate, feel),
    };
}

fn blow(mut wind: ResMut<Wind>, mut apples: Query<&mut Transform, With<Apple>>) {
    wind.force = unseeded();
    for mut apple in &mut apples {
        apple.translation.x += 0.01 * wind.force;
    }
}

fn gust(mut apples: Query<&mut Transform, With<Apple>>) {
    for mut apple in &mut apples {
        apple.translation.x += 0.01 * unseeded();
    }
}

fn ripen(mut season: ResMut<Season>, mut apples: Query<&mut Apple>) {
    season.frames += 1;
    for mut apple in &mut apples {
        apple.speed = 10.0 + 0.01 * season.frames as f32;
    }
}

fn ripen_unseen(mut frames: Local<u32>, mut apples: Query<&mut Apple>) {
    *frames += 1;
    for mut apple in &mut apples {
        apple.speed = 10.0 + 0.01 * *frames as f32;
    }
}

fn sink(real: Res<Time<Real>>, mut apples: Query<&mut Transform, With<Apple>>) {
    for mut apple in &mut apples {
        apple.translation.y -= real.delta_secs();
    }
}

fn rise(mut commands: Commands) {
    commands.spawn(Gale { force: 0.01 });
    commands.spawn((Gale { force: -0.01 }, Cold));
}

fn blow_first(gales: Query<&Gale>, mut apples: Query<&mut Transform, With<Apple>>) {
    let Some(gale) = gales.iter().next() else { return };
    for mut apple in &mut apples {
        apple.translation.x += gale.force;
    }
}

fn feel(mut mood: ResMut<Mood>) {
    mood.0 = unseeded().to_bits();
}
