//! Pictures through cameras of the game.

use bevy::{
    camera::{CameraOutputMode, RenderTarget, RenderTargetInfo},
    prelude::*,
};

use super::{
    atlas::{render_target, target_image},
    sensor_view::SensorCamera,
};

/// The textures that cameras of the game draw on for sensors.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct BorrowedTargets(Vec<BorrowedTarget>);

#[derive(Reflect)]
pub(super) struct BorrowedTarget {
    pub(super) camera: Entity,
    pub(super) size: UVec2,
    pub(super) image: Handle<Image>,
}

impl BorrowedTargets {
    /// Keeps one texture for each camera that is asked for.
    pub(super) fn update(&mut self, wanted: &[(Entity, UVec2)], images: &mut Assets<Image>) {
        self.0.retain(|target| wanted.contains(&(target.camera, target.size)));
        for &(camera, size) in wanted {
            if self.get(camera).is_none() {
                self.0.push(BorrowedTarget { camera, size, image: images.add(target_image(size)) });
            }
        }
    }

    pub(super) fn get(&self, camera: Entity) -> Option<&BorrowedTarget> {
        self.0.iter().find(|target| target.camera == camera)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &BorrowedTarget> {
        self.0.iter()
    }
}

/// A camera as the game left it.
struct BorrowedCamera {
    camera: Entity,
    was: Camera,
    target: RenderTarget,
}

/// The cameras of the game while sensors look. Cameras without a sensor are switched off; the others draw for
/// sensors.
#[derive(Default)]
pub(super) struct BorrowedCameras {
    cameras: Vec<BorrowedCamera>,
    off: Vec<Entity>,
}

impl BorrowedCameras {
    /// Switches the game's cameras off, and those with sensors on. Call it before visibility is computed.
    pub(super) fn select(world: &mut World, targets: &BorrowedTargets) -> Self {
        let mut borrowed = Self::default();
        let mut cameras =
            world.query_filtered::<(Entity, &mut Camera, &RenderTarget, &mut Projection), Without<SensorCamera>>();
        for (entity, mut camera, target, mut projection) in cameras.iter_mut(world) {
            let Some(wanted) = targets.get(entity) else {
                if camera.is_active {
                    camera.bypass_change_detection().is_active = false;
                    borrowed.off.push(entity);
                }
                continue;
            };
            borrowed.cameras.push(BorrowedCamera { camera: entity, was: camera.clone(), target: target.clone() });
            let camera = camera.bypass_change_detection();
            camera.is_active = true;
            if camera.computed.target_info.is_none() {
                projection.update(wanted.size.x as f32, wanted.size.y as f32);
                camera.computed.clip_from_view = projection.get_clip_from_view();
            }
        }
        borrowed
    }

    /// Points the cameras at their textures. Call it after visibility was computed for what they see in the game.
    pub(super) fn point(&self, world: &mut World, targets: &BorrowedTargets) {
        for borrowed in &self.cameras {
            let Some(wanted) = targets.get(borrowed.camera) else { continue };
            let mut camera = world.entity_mut(borrowed.camera);
            if let Some(mut target) = camera.get_mut::<RenderTarget>() {
                *target.bypass_change_detection() = render_target(wanted.image.clone());
            }
            if let Some(mut camera) = camera.get_mut::<Camera>() {
                let camera = camera.bypass_change_detection();
                camera.viewport = None;
                camera.output_mode = CameraOutputMode::default();
                camera.computed.target_info = Some(RenderTargetInfo { physical_size: wanted.size, scale_factor: 1.0 });
            }
        }
    }

    /// Restores the cameras.
    pub(super) fn give_back(self, world: &mut World) {
        for borrowed in self.cameras {
            let mut entity = world.entity_mut(borrowed.camera);
            if let Some(mut target) = entity.get_mut::<RenderTarget>() {
                *target.bypass_change_detection() = borrowed.target;
            }
            if let Some(mut camera) = entity.get_mut::<Camera>() {
                *camera.bypass_change_detection() = borrowed.was;
            }
        }
        for camera in self.off {
            if let Some(mut camera) = world.get_mut::<Camera>(camera) {
                camera.bypass_change_detection().is_active = true;
            }
        }
    }
}
