//! Requests of agents for pictures.

use bevy::{camera::RenderTarget, prelude::*, render::renderer::RenderDevice};

use super::{CameraError, CameraSensor, CameraSource, SensorCamera};
use crate::{
    agent::{Agent, AgentOrder},
    control::Control,
    episode::Episode,
    fault::Faults,
    vision::{ImageOptions, ImageSensor, is_observed},
};

/// The cameras of the game.
type GameCameras = QueryState<(Entity, &'static Camera), Without<SensorCamera>>;

/// One agent's picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Request {
    pub(super) agent: Entity,
    /// The agent's number, its level and the tick of its episode, for messages.
    index: u32,
    level: u64,
    tick: u32,
    /// Columns and rows of pixels.
    pub(super) size: UVec2,
}

/// The picture of an agent whose sensor follows a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct FollowRequest {
    pub(super) request: Request,
    pub(super) target: Entity,
    /// Width of the picture, world units.
    pub(super) width: f32,
}

/// All possible requests, in the order of the agents' numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Requests {
    pub(super) following: Vec<FollowRequest>,
    /// Requests through a camera of the game.
    pub(super) through: Vec<(Request, Entity)>,
}

impl Requests {
    pub(super) fn is_empty(&self) -> bool {
        self.following.is_empty() && self.through.is_empty()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Request> {
        let following = self.following.iter().map(|follow| &follow.request);
        following.chain(self.through.iter().map(|(request, _)| request))
    }
}

/// Reports an error for some agents.
pub(super) fn report<'a>(world: &mut World, requests: impl Iterator<Item = &'a Request>, error: &CameraError) {
    let mut faults = world.resource_mut::<Faults>();
    for Request { index, level, tick, .. } in requests {
        faults.report(format!("agent {index}, level {level}, tick {tick}: {error}"));
    }
}

/// Collects the requests of observed agents, and reports impossible ones.
pub(super) fn gather_requests(world: &mut World) -> Requests {
    let limit =
        world.get_resource::<RenderDevice>().map_or(u32::MAX, |device| device.limits().max_texture_dimension_2d);
    let mut sensors = world.query::<((&Agent, &Control, &Episode), (&CameraSensor, &ImageSensor))>();
    let mut cameras: GameCameras = world.query_filtered();
    cameras.update_archetypes(world);
    let targets = check_targets(world, &cameras);
    let mut requests = Requests::default();
    let mut refused = Vec::new();
    for &entity in world.resource::<AgentOrder>().entities() {
        let Ok(((agent, control, episode), (sensor, image))) = sensors.get(world, entity) else { continue };
        if !is_observed(control, episode) {
            continue;
        }
        let size = UVec2::new(image.0.width, image.0.height);
        let (level, tick) = (episode.level, episode.tick);
        let request = Request { agent: entity, index: agent.index, level, tick, size };
        let possible = targets.clone().and_then(|()| check_size(&image.0, limit));
        let result = possible.and_then(|()| match sensor.source {
            CameraSource::Following { target, width } => check_target(world, target, width)
                .map(|()| requests.following.push(FollowRequest { request, target, width })),
            CameraSource::OfGame => match own_camera(world, &cameras) {
                Some(camera) => {
                    check_camera(world, &requests, &request, camera).map(|()| requests.through.push((request, camera)))
                }
                None => Err(CameraError::NoOwnCamera),
            },
            CameraSource::Camera(camera) => {
                check_camera(world, &requests, &request, camera).map(|()| requests.through.push((request, camera)))
            }
        });
        refused.extend(result.err().map(|error| (request, error)));
    }
    for (request, error) in &refused {
        report(world, [request].into_iter(), error);
    }
    requests
}

/// Returns the game's own camera: of the active ones, the one that draws first.
fn own_camera(world: &World, cameras: &GameCameras) -> Option<Entity> {
    let active = cameras.iter_manual(world).filter(|(_, camera)| camera.is_active);
    active.min_by_key(|(entity, camera)| (camera.order, *entity)).map(|(entity, _)| entity)
}

/// Reports cameras whose target has no pixels. The renderer makes a texture of each target, and cannot go on after
/// such a one.
fn check_targets(world: &World, cameras: &GameCameras) -> Result<(), CameraError> {
    let Some(images) = world.get_resource::<Assets<Image>>() else { return Ok(()) };
    let size = |camera| Some(images.get(world.get::<RenderTarget>(camera)?.as_image()?)?.size());
    let targets = cameras.iter_manual(world).filter_map(|(camera, _)| Some((camera, size(camera)?)));
    let first = targets.filter(|(_, size)| size.min_element() == 0).min_by_key(|(camera, _)| *camera);
    first.map_or(Ok(()), |(camera, size)| Err(CameraError::EmptyTarget { camera, size }))
}

fn check_size(options: &ImageOptions, limit: u32) -> Result<(), CameraError> {
    options.check()?;
    let ImageOptions { width, height, .. } = *options;
    if width.max(height) > limit { Err(CameraError::OverLimit { width, height, limit }) } else { Ok(()) }
}

fn check_target(world: &World, target: Entity, width: f32) -> Result<(), CameraError> {
    if !(width.is_finite() && width > 0.0) {
        return Err(CameraError::Width(width));
    }
    world.get::<GlobalTransform>(target).map(|_| ()).ok_or(CameraError::NoTarget(target))
}

fn check_camera(world: &World, requests: &Requests, request: &Request, camera: Entity) -> Result<(), CameraError> {
    if world.get::<Camera>(camera).is_none() || world.get::<Projection>(camera).is_none() {
        return Err(CameraError::NoCamera(camera));
    }
    if let Some(&RenderTarget::None { size }) = world.get::<RenderTarget>(camera)
        && size.min_element() == 0
    {
        return Err(CameraError::EmptyTarget { camera, size });
    }
    let shared = requests.through.iter().any(|(other, used)| *used == camera && other.size != request.size);
    if shared { Err(CameraError::CameraShared(camera)) } else { Ok(()) }
}
