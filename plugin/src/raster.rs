//! Pictures of 2D sprites drawn on the CPU.
//!
//! A [`RasterSensor`] draws the picture of Bevy's sprite renderer on a camera with nearest
//! sampling, without multisampling and tonemapping. The background is Bevy's
//! [`ClearColor`], or black without one. It draws:
//!
//! - [`Sprite`] with image or atlas, tint, flips, rectangle, `custom_size`, [`Anchor`](bevy::sprite::Anchor) and the
//!   image modes `Auto` and `Scale`, and [`TileLayer`](crate::vision::TileLayer);
//! - with the [`Transform`] and [`Visibility`]
//!   of entities and their parents; the [`GlobalTransform`] is not
//!   read and need not be kept;
//! - the farthest z first. At equal z, parents come first and then the order of their
//!   [`Children`]. Bevy leaves this open, so give overlapping entities
//!   different z.
//!
//! Texels of half alpha are mixed in linear light. The centre of a pixel selects the texel that it
//! shows. Only sums, products and quotients in a fixed order are used, so a picture has the same
//! bytes on every machine.
//!
//! The files of the folder, in reading order:
//!
//! - `scene`: the items that are drawn on a stage, and how they are painted.
//! - `canvas`: the pixels of a picture, colours, poses and positions.
//! - `texture`: images as texels.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{prelude::*, raster::{RasterPlugin, RasterSensor}, vision::ImageOptions};
//!
//! let mut app = headless_app();
//! app.add_plugins(RasterPlugin);
//! let red = Sprite::from_color(Color::srgb(1.0, 0.0, 0.0), Vec2::splat(2.0));
//! let player = app.world_mut().spawn((red, Transform::default())).id();
//! // Four units of the world around the player, one pixel per unit.
//! let sensor = RasterSensor::following(player, 4.0, ImageOptions { width: 4, height: 4, ..default() });
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human, sensor)).id();
//! app.tick().expect("it can be drawn");
//! let red = &app.world().get::<Observation>(agent).expect("every agent has one").image[..16];
//! assert_eq!(red, [0, 0, 0, 0, 0, 255, 255, 0, 0, 255, 255, 0, 0, 0, 0, 0]);
//! ```

mod canvas;
mod scene;
mod texture;

use crate::{
    agent::{Agent, AgentOrder, Control},
    episode::{Episode, Tick},
    fault::Faults,
    raster::{
        canvas::{Canvas, Rgba, SRGB, Tint, View},
        scene::{Item, ItemKind, SpriteOn, Stages, TileBuffers, TilesOn},
        texture::Textures,
    },
    systems::ObserveSchedule,
    vision::{Frame, ImageOptions, ImageSensor, NO_IMAGE, VisionPlugin, VisionSystems, is_observed},
};
use bevy::prelude::*;
use thiserror::Error;

/// Draws the surroundings of an entity, as a `CameraSensor` would show them, without a GPU.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
#[require(ImageSensor)]
pub struct RasterSensor {
    /// The entity in the middle of the picture.
    pub target: Entity,
    /// World units from the left to the right edge of the picture.
    pub width: f32,
}

impl RasterSensor {
    /// Returns the components of an agent that sees `width` units of the world around `target`.
    pub fn following(target: Entity, width: f32, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { target, width }, ImageSensor(image))
    }
}

/// Adds [`RasterSensor`]s to a game.
#[derive(Clone, Copy, Debug, Default)]
pub struct RasterPlugin;

impl Plugin for RasterPlugin {
    fn build(&self, app: &mut App) {
        VisionPlugin::add_to(app);
        app.init_resource::<Assets<Image>>()
            .init_resource::<Assets<TextureAtlasLayout>>()
            .add_systems(ObserveSchedule, fill_frames.in_set(VisionSystems::Render));
    }
}

/// Draws the picture of each agent that is observed.
fn fill_frames(
    (order, tick, clear): (Res<AgentOrder>, Res<Tick>, Option<Res<ClearColor>>),
    stages: Stages,
    mut agents: RasterAgents,
    names: Query<&Name>,
    mut faults: ResMut<Faults>,
    mut renderer: Local<RasterRenderer>,
) {
    let mut report = |agents: &RasterAgents, entity: Entity, error: RasterError| {
        let Ok(((agent, _, episode), ..)) = agents.get(entity) else { return };
        let name = error.entity().and_then(|entity| names.get(entity).ok());
        let name = name.map_or_else(String::new, |name| format!(" (`{name}`)"));
        faults.report(format!("{}: {error}{name}", episode.moment(agent)));
    };
    let renderer = &mut *renderer;
    renderer.textures.refresh(&stages.images);
    renderer.find_viewpoints(&order, &agents, &stages, &mut report);
    let clear = clear.map_or([0, 0, 0, 255], |clear| SRGB.opaque(Tint::of(clear.0)));
    let mut first = 0;
    while let Some(&Viewpoint { stage, agent, .. }) = renderer.viewpoints.get(first) {
        let group =
            first..first + renderer.viewpoints[first..].iter().take_while(|viewpoint| viewpoint.stage == stage).count();
        first = group.end;
        if let Err(error) = stages.gather(stage, &mut renderer.textures, &mut renderer.items) {
            report(&agents, agent, error);
            continue;
        }
        for number in group {
            let Viewpoint { agent, centre, .. } = renderer.viewpoints[number];
            let Ok((_, (sensor, image), mut frame)) = agents.get_mut(agent) else { continue };
            let size = UVec2::new(image.0.width, image.0.height);
            let painted =
                renderer.paint(&stages, &View::new(centre, sensor.width, size), size, clear, &mut frame.pixels);
            match painted {
                Ok(()) => frame.tick = Some(tick.0),
                Err(error) => report(&agents, agent, error),
            }
        }
    }
}

/// Agents and their frames.
type RasterAgents<'w, 's> = Query<
    'w,
    's,
    (
        (&'static Agent, &'static Control, &'static Episode),
        (&'static RasterSensor, &'static ImageSensor),
        &'static mut Frame,
    ),
>;

/// Converted images, and memory that is reused for every picture.
#[derive(Default)]
struct RasterRenderer {
    textures: Textures,
    viewpoints: Vec<Viewpoint>,
    items: Vec<Item>,
    visible: Vec<u64>,
    columns: Vec<u32>,
    tiles: TileBuffers,
}

impl RasterRenderer {
    /// Lists the agents that are observed, grouped by stage.
    fn find_viewpoints(
        &mut self,
        order: &AgentOrder,
        agents: &RasterAgents,
        stages: &Stages,
        report: &mut impl FnMut(&RasterAgents, Entity, RasterError),
    ) {
        self.viewpoints.clear();
        for (row, &agent) in order.entities().iter().enumerate() {
            let Ok(((_, control, episode), (sensor, image), _)) = agents.get(agent) else { continue };
            if !is_observed(control, episode) {
                continue;
            }
            match locate(sensor, image, stages) {
                Ok((stage, centre)) => self.viewpoints.push(Viewpoint { stage, row, agent, centre }),
                Err(error) => report(agents, agent, error),
            }
        }
        self.viewpoints.sort_unstable_by_key(|viewpoint| (viewpoint.stage, viewpoint.row));
    }

    /// Paints the gathered items, the farthest first. Equally far items keep the order in which
    /// they were found.
    fn paint(
        &mut self,
        stages: &Stages,
        view: &View,
        size: UVec2,
        clear: Rgba,
        pixels: &mut Vec<Rgba>,
    ) -> Result<(), RasterError> {
        let (width, height) = (size.x as usize, size.y as usize);
        pixels.clear();
        pixels.resize(width * height, clear);
        let mut canvas = Canvas { pixels, width, height };
        self.visible.clear();
        self.visible.extend((0u64..).zip(&self.items).filter_map(|(number, item)| {
            let seen = match item.kind {
                ItemKind::Tiles(_) => true,
                ItemKind::Sprite { .. } => {
                    let (columns, rows) = canvas.cut(&view.place(&item.quad));
                    !columns.is_empty() && !rows.is_empty()
                }
            };
            seen.then(|| u64::from(rank(item.z)) << 32 | number)
        }));
        self.visible.sort_unstable();
        for number in &self.visible {
            let item = &self.items[*number as u32 as usize];
            let quad = view.place(&item.quad);
            let texture = self.textures.get(item.texture);
            match item.kind {
                ItemKind::Sprite { region, colour } => {
                    let area = canvas.cut(&quad);
                    let sprite = SpriteOn { quad, region, texture, tint: Tint::of(colour) };
                    sprite.paint(&mut canvas, area, &mut self.columns);
                }
                ItemKind::Tiles(entity) => {
                    let Ok(layer) = stages.layers.get(entity) else { continue };
                    let tiles = TilesOn { cell: quad, layer, strip: texture };
                    tiles.paint(&mut canvas, &mut self.tiles).map_err(|why| RasterError::Thing(entity, why))?;
                }
            }
        }
        Ok(())
    }
}

/// An agent, and the position that its sensor looks at.
#[derive(Debug)]
struct Viewpoint {
    stage: Option<Entity>,
    row: usize,
    agent: Entity,
    centre: Vec2,
}

/// Returns the stage that a sensor sees, and the position it looks at.
fn locate(sensor: &RasterSensor, image: &ImageSensor, stages: &Stages) -> Result<(Option<Entity>, Vec2), RasterError> {
    image.0.check()?;
    if !(sensor.width > 0.0 && sensor.width.is_finite()) {
        return Err(RasterError::Width(sensor.width));
    }
    let (stage, centre) = stages.locate(sensor.target).ok_or(RasterError::NoTarget(sensor.target))?;
    if centre.is_finite() { Ok((stage, centre)) } else { Err(RasterError::LostTarget(centre)) }
}

/// Returns a number that grows with z.
fn rank(z: f32) -> u32 {
    // -0 becomes 0.
    let bits = (z + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// The reason why a picture cannot be drawn. The report names the entity.
#[derive(Clone, Debug, PartialEq, Error)]
enum RasterError {
    #[error("the width of what the sensor sees is {0}; it must be a number above 0")]
    Width(f32),
    #[error("the sensor's target {0} is gone or has no Transform; remove the sensor with it, or give it another")]
    NoTarget(Entity),
    #[error("the sensor's target is at {0}; the game must give it a finite position")]
    LostTarget(Vec2),
    #[error("{0}")]
    Options(#[from] crate::vision::VisionError),
    #[error("entity {0}: {1}")]
    Thing(Entity, Undrawable),
}

impl RasterError {
    /// Returns the entity that causes the error.
    pub fn entity(&self) -> Option<Entity> {
        match self {
            Self::Thing(entity, _) => Some(*entity),
            _ => None,
        }
    }
}

/// The reason why an entity cannot be drawn.
#[derive(Clone, Debug, PartialEq, Error)]
enum Undrawable {
    #[error("the sprite has no image: {NO_IMAGE}")]
    NoImage,
    #[error("the image is not loaded; wait for it before the first episode, or add it to `Assets<Image>`")]
    NotLoaded,
    #[error("the image's pixels were given to the GPU and dropped; load it with `RenderAssetUsages::default()`")]
    NoPixels,
    #[error("the image has no pixels: its size is {width}x{height}; it must have at least one")]
    Empty { width: u32, height: u32 },
    #[error("images of format {0} cannot be drawn; use Rgba8UnormSrgb, Bgra8UnormSrgb or Rgba8Unorm")]
    Format(String),
    #[error(
        "the image has {bytes} bytes, but its size is {width}x{height}; only flat images without mipmaps are drawn"
    )]
    Bytes { bytes: usize, width: u32, height: u32 },
    #[error("the texture atlas has no layout, or no section {0}")]
    Atlas(usize),
    #[error("the image mode {0} cannot be drawn; use `SpriteImageMode::Auto` or `Scale`")]
    Mode(&'static str),
    #[error("the tile layer has {cells} cells for {columns} columns and {rows} rows")]
    Cells { cells: usize, columns: u32, rows: u32 },
    #[error("the tileset is {width}x{height}; it must be a strip of square tiles, one below the other")]
    Strip { width: u32, height: u32 },
    #[error("the tile layer asks for tile {tile}, but its tileset has {tiles}")]
    Tile { tile: u16, tiles: u32 },
}
