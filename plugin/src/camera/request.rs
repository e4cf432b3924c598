//! Requests of agents for pictures.

use crate::{
    agent::{Agent, AgentOrder, Control},
    camera::{CameraError, CameraSensor, CameraSource, NoImage, SensorCamera},
    episode::Episode,
    fault::Faults,
    vision::{ImageOptions, ImageSensor, NO_IMAGE, TileLayer, is_observed, lacks_image},
};
use bevy::{
    asset::{AssetId, LoadState, RenderAssetUsages},
    camera::{CameraOutputMode, ImageRenderTarget, RenderTarget, RenderTargetInfo},
    image::ImageSampler,
    prelude::*,
    render::{
        render_resource::{TextureFormat, TextureUsages},
        renderer::RenderDevice,
    },
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

// Drawn entities whose images are missing.

/// Sprites and tile layers whose image was missing when they were last looked at.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct MissingImages(Vec<Entity>);

/// Checks entities that have changed. Checks all again once an image is removed.
pub(super) fn note_missing_images(
    mut missing: ResMut<MissingImages>,
    mut events: MessageReader<AssetEvent<Image>>,
    images: Res<Assets<Image>>,
    sprites: Query<(Entity, Ref<Sprite>)>,
    layers: Query<(Entity, Ref<TileLayer>)>,
) {
    let removed = events.read().any(|event| matches!(event, AssetEvent::Removed { .. }));
    let sprites = sprites.iter().filter(|(_, sprite)| removed || sprite.is_changed());
    let sprites = sprites.map(|(entity, sprite)| (entity, Wanted::by_sprite(&sprite)));
    let layers = layers.iter().filter(|(_, layer)| removed || layer.is_changed());
    let layers = layers.map(|(entity, layer)| (entity, Wanted::by_tiles(&layer)));
    missing.0.extend(sprites.chain(layers).filter(|(_, wanted)| wanted.is_missing(&images)).map(|(entity, _)| entity));
}

/// The image that something needs to be drawn.
struct Wanted {
    /// The kind of entity: `sprite` or `tile layer`.
    by: &'static str,
    /// The image, or `None` if the entity names no image.
    image: Option<AssetId<Image>>,
}

impl Wanted {
    fn by_sprite(sprite: &Sprite) -> Self {
        Self { by: "sprite", image: (!lacks_image(sprite)).then(|| sprite.image.id()) }
    }

    fn by_tiles(layer: &TileLayer) -> Self {
        Self { by: "tile layer", image: Some(layer.tileset.id()) }
    }

    fn by_entity(world: &World, entity: Entity) -> Option<Self> {
        let sprite = world.get::<Sprite>(entity).map(Self::by_sprite);
        sprite.or_else(|| world.get::<TileLayer>(entity).map(Self::by_tiles))
    }

    fn is_missing(&self, images: &Assets<Image>) -> bool {
        self.image.is_none_or(|image| !images.contains(image))
    }
}

/// The state of all images.
pub(super) enum Images {
    Ready,
    Loading,
    Missing(NoImage),
}

/// Checks entities that lacked their image again. Hidden entities need no image.
pub(super) fn check(world: &mut World) -> Images {
    let mut missing = std::mem::take(&mut world.resource_mut::<MissingImages>().0);
    missing.sort_unstable();
    missing.dedup();
    let images = world.resource::<Assets<Image>>();
    missing.retain(|&entity| Wanted::by_entity(world, entity).is_some_and(|wanted| wanted.is_missing(images)));
    let mut found = Images::Ready;
    for &entity in &missing {
        let Some(Wanted { by: what, image }) = Wanted::by_entity(world, entity) else { continue };
        if !world.get::<InheritedVisibility>(entity).is_some_and(|visible| visible.get()) {
            continue;
        }
        let why = match image.map(|image| world.resource::<AssetServer>().get_load_state(image)) {
            None => NO_IMAGE.to_owned(),
            Some(Some(LoadState::Loading | LoadState::Loaded)) => {
                found = Images::Loading;
                continue;
            }
            Some(Some(LoadState::Failed(error))) => error.to_string(),
            Some(_) => "its handle leads to no image".to_owned(),
        };
        found = Images::Missing(NoImage { what, entity, name: world.get::<Name>(entity).cloned(), why });
        break;
    }
    world.resource_mut::<MissingImages>().0 = missing;
    found
}

// Pictures through cameras of the game.

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

// One texture for the pictures of many agents.

/// A texture's rows come back without padding if their length in bytes is a multiple of 256.
const COLUMNS: u32 = 64;

/// Cells in rows, from the top left.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect)]
pub(super) struct Layout {
    pub(super) size: UVec2,
    pub(super) cells: Vec<URect>,
}

impl Layout {
    /// Creates room for pictures of these sizes on a texture of at most `limit` pixels a side, about as high as wide.
    pub(super) fn new(sizes: &[UVec2], limit: u32) -> Result<Self, CameraError> {
        let area: u64 = sizes.iter().map(|size| u64::from(size.x) * u64::from(size.y)).sum();
        let widest = sizes.iter().map(|size| size.x).max().unwrap_or(1);
        let width = (area as f64).sqrt().ceil() as u32;
        let width = width.max(widest).next_multiple_of(COLUMNS).min(limit);
        let mut layout = Self { size: UVec2::new(width, 1), cells: Vec::with_capacity(sizes.len()) };
        let (mut corner, mut row) = (UVec2::ZERO, 0);
        for &size in sizes {
            if corner.x + size.x > width {
                corner = UVec2::new(0, corner.y + row);
                row = 0;
            }
            layout.cells.push(URect { min: corner, max: corner + size });
            corner.x += size.x;
            row = row.max(size.y);
        }
        layout.size.y = (corner.y + row).max(1);
        if layout.size.y > limit { Err(CameraError::TooMany { agents: sizes.len(), limit }) } else { Ok(layout) }
    }
}

/// Returns an image to draw on and to copy from. Its colours are stored as the bytes that image files hold.
pub(super) fn target_image(size: UVec2) -> Image {
    let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None);
    image.data = None;
    image.copy_on_resize = false;
    image.sampler = ImageSampler::nearest();
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    image.asset_usage = RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD;
    image
}

/// Returns a camera's target.
pub(super) fn render_target(image: Handle<Image>) -> bevy::camera::RenderTarget {
    bevy::camera::RenderTarget::Image(ImageRenderTarget { handle: image, scale_factor: 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_lie_inside_and_apart() {
        let sizes: Vec<UVec2> = (0..70).map(|i| UVec2::new(20 + i % 40, 30 + i % 7)).collect();
        let layout = Layout::new(&sizes, 4096).expect("small");
        assert_eq!(layout.size.x % COLUMNS, 0);
        for (i, cell) in layout.cells.iter().enumerate() {
            assert_eq!(cell.size(), sizes[i]);
            assert!(cell.max.x <= layout.size.x && cell.max.y <= layout.size.y);
            for other in &layout.cells[i + 1..] {
                assert!(cell.intersect(*other).is_empty(), "{cell:?} {other:?}");
            }
        }
    }

    #[test]
    fn too_many_are_refused() {
        let sizes = vec![UVec2::splat(64); 17];
        assert_eq!(Layout::new(&sizes, 256), Err(CameraError::TooMany { agents: 17, limit: 256 }));
        assert_eq!(Layout::new(&sizes[..16], 256).map(|layout| layout.size), Ok(UVec2::splat(256)));
    }
}
