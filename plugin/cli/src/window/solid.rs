//! A view in space for games that have one, and the key that switches between it and the view from above.

use crate::window::{
    camera::Zoom,
    session::{Deciders, OwnKeys, OwnKeysRead},
};
use bevy::{
    camera::RenderTarget, core_pipeline::tonemapping::Tonemapping, prelude::*, transform::helper::TransformHelper,
};
use playbot_harness::{game::Game, inspect::CameraFocus};

/// Offset of the camera from its target at the nearest zoom, metres. It is so steep that the wall behind an agent does
/// not hide it.
const BEHIND: Vec3 = Vec3::new(0.0, -3.2, 8.0);

/// Speed of the camera: in a second it covers the share 1 - exp(-HASTE) of its distance to the agent.
const HASTE: f32 = 6.0;

pub(super) fn build(app: &mut App, game: &dyn Game) {
    game.tools().pictures.build_space_view(app);
    app.insert_resource(Solid(true))
        .insert_resource(ClearColor(Color::srgb(0.62, 0.72, 0.82)))
        .add_systems(Startup, spawn_camera)
        .add_systems(PreUpdate, change_view.after(OwnKeysRead))
        .add_systems(PostUpdate, (choose, follow).before(TransformSystems::Propagate));
}

/// The view in space is shown.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct Solid(bool);

/// The camera in space, and its target position.
#[derive(Component, Reflect)]
#[reflect(Component)]
struct SolidCamera(Option<Vec3>);

fn spawn_camera(mut commands: Commands) {
    commands.spawn((SolidCamera(None), Camera3d::default(), Tonemapping::AcesFitted, Camera { order: 1, ..default() }));
}

/// Switches with V between the view from above and the view in space.
fn change_view(keys: Res<OwnKeys>, mut solid: ResMut<Solid>) {
    if keys.just_pressed(KeyCode::KeyV) {
        solid.0 = !solid.0;
    }
}

/// Lets only one of the window's cameras draw.
fn choose(solid: Res<Solid>, mut cameras: Query<(&mut Camera, &RenderTarget, Has<SolidCamera>)>) {
    for (mut camera, target, in_space) in &mut cameras {
        let wanted = in_space == solid.0;
        if matches!(target, RenderTarget::Window(_)) && camera.is_active != wanted {
            camera.is_active = wanted;
        }
    }
}

fn follow(
    clock: Res<Time<Real>>,
    deciders: Res<Deciders>,
    zoom: Res<Zoom>,
    focuses: Query<&CameraFocus>,
    mut set: ParamSet<(TransformHelper, Single<(&mut SolidCamera, &mut Transform)>)>,
) {
    let Ok(focus) = focuses.get(deciders.agent) else { return };
    let Ok(at) = set.p0().compute_global_transform(focus.0) else { return };
    let (mut camera, mut transform) = set.p1().into_inner();
    let at = at.translation();
    let before = camera.0.filter(|before| before.distance(at) < 3.0).unwrap_or(at);
    let looks_at = before.lerp(at, (HASTE * clock.delta_secs()).min(1.0));
    camera.0 = Some(looks_at);
    *transform = Transform::from_translation(looks_at + BEHIND * zoom.factor()).looking_at(looks_at, Vec3::Z);
}
