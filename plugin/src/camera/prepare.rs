//! Preparation of textures for the requested pictures.

use bevy::{prelude::*, render::renderer::RenderDevice};

use super::{
    CameraError, TileBorder,
    atlas::{Layout, render_target, target_image},
    borrow::BorrowedTargets,
    request::{FollowRequest, Requests},
    sensor_view::{SensorViews, spawn_camera},
};

/// The common texture and its division into cells.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct Atlas {
    /// Sizes of the pictures for which it was made.
    sizes: Vec<UVec2>,
    pub(super) layout: Layout,
    pub(super) image: Option<Handle<Image>>,
}

/// Makes room for all pictures. Does nothing as long as their sizes are unchanged.
pub(super) fn prepare(world: &mut World, requests: &Requests) -> Result<(), CameraError> {
    divide_atlas(world, requests)?;
    let mut cameras: Vec<(Entity, UVec2)> = Vec::new();
    for (request, camera) in &requests.through {
        if !cameras.contains(&(*camera, request.size)) {
            cameras.push((*camera, request.size));
        }
    }
    world.resource_scope(|world, mut targets: Mut<BorrowedTargets>| {
        targets.update(&cameras, &mut world.resource_mut::<Assets<Image>>());
    });
    raise_border(world, requests);
    Ok(())
}

fn divide_atlas(world: &mut World, requests: &Requests) -> Result<(), CameraError> {
    let sizes: Vec<UVec2> = requests.following.iter().map(|follow| follow.request.size).collect();
    if sizes.is_empty() || sizes == world.resource::<Atlas>().sizes {
        return Ok(());
    }
    let limit = world.resource::<RenderDevice>().limits().max_texture_dimension_2d;
    let layout = Layout::new(&sizes, limit)?;
    let atlas = world.resource::<Atlas>();
    let mut image = atlas.image.clone().filter(|_| atlas.layout.size == layout.size);
    if image.is_none() {
        let new = world.resource_mut::<Assets<Image>>().add(target_image(layout.size));
        point_camera(world, new.clone());
        image = Some(new);
    }
    *world.resource_mut::<Atlas>() = Atlas { sizes, layout, image };
    Ok(())
}

/// Lets the shared camera draw on the texture.
fn point_camera(world: &mut World, image: Handle<Image>) {
    let camera = world.resource::<SensorViews>().camera.filter(|&camera| world.get::<Camera>(camera).is_some());
    let camera = camera.unwrap_or_else(|| spawn_camera(world));
    world.resource_mut::<SensorViews>().camera = Some(camera);
    let mut camera = world.entity_mut(camera);
    camera.insert(render_target(image));
    if let Some(mut projection) = camera.get_mut::<Projection>() {
        // Makes Bevy look at the new target's size.
        projection.set_changed();
    }
}

/// Raises the border of tile layers to the largest visible distance.
fn raise_border(world: &mut World, requests: &Requests) {
    let seen = |follow: &FollowRequest| {
        let size = follow.request.size.as_vec2();
        follow.width.max(follow.width * size.y / size.x) / 2.0 + 1.0
    };
    let needed = requests.following.iter().map(seen).fold(0.0, f32::max);
    if world.resource::<TileBorder>().0 < needed {
        world.resource_mut::<TileBorder>().0 = needed;
    }
}
