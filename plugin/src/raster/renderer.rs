//! The system that fills the frames of all agents.

use bevy::prelude::*;

use super::{
    RasterSensor,
    canvas::{Canvas, View},
    colour::{Rgba, SRGB, Tint},
    error::RasterError,
    scene::{Item, ItemKind, Stages},
    sprite::SpriteOn,
    texture::Textures,
    tiles::{TileBuffers, TilesOn},
};
use crate::{
    agent::{Agent, AgentOrder},
    control::Control,
    episode::Episode,
    fault::Faults,
    tick::Tick,
    vision::{Frame, ImageSensor, is_observed},
};

/// Converted images, and memory that is reused for every picture.
#[derive(Default)]
pub(super) struct RasterRenderer {
    textures: Textures,
    viewpoints: Vec<Viewpoint>,
    items: Vec<Item>,
    visible: Vec<u64>,
    columns: Vec<u32>,
    tiles: TileBuffers,
}

/// An agent, and the position that its sensor looks at.
#[derive(Debug)]
struct Viewpoint {
    stage: Option<Entity>,
    row: usize,
    agent: Entity,
    centre: Vec2,
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

/// Draws the picture of each agent that is observed.
pub(super) fn fill_frames(
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
