//! Filling the frames of all eyes.

use bevy::prelude::*;

use super::{
    RasterSensor,
    canvas::{Canvas, View},
    colour::{Rgba, SRGB, Tint},
    error::RasterError,
    scene::{Item, Stages, What},
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

/// Converted images, and memory that is used again for every picture.
#[derive(Default)]
pub(super) struct Studio {
    textures: Textures,
    eyes: Vec<Eye>,
    items: Vec<Item>,
    visible: Vec<u64>,
    columns: Vec<u32>,
    tiles: TileBuffers,
}

/// An agent that looks.
#[derive(Debug)]
struct Eye {
    stage: Option<Entity>,
    row: usize,
    agent: Entity,
    centre: Vec2,
}

/// Agents and their frames.
type Eyes<'w, 's> = Query<
    'w,
    's,
    (
        (&'static Agent, &'static Control, &'static Episode),
        (&'static RasterSensor, &'static ImageSensor),
        &'static mut Frame,
    ),
>;

/// Draws the picture of each agent that is observed.
pub(super) fn look(
    (order, tick, clear): (Res<AgentOrder>, Res<Tick>, Option<Res<ClearColor>>),
    stages: Stages,
    mut eyes: Eyes,
    names: Query<&Name>,
    mut faults: ResMut<Faults>,
    mut studio: Local<Studio>,
) {
    let mut report = |eyes: &Eyes, eye: Entity, error: RasterError| {
        let Ok(((agent, _, episode), ..)) = eyes.get(eye) else { return };
        let name = error.entity().and_then(|entity| names.get(entity).ok());
        let name = name.map_or_else(String::new, |name| format!(" (`{name}`)"));
        faults.report(format!("{}: {error}{name}", episode.moment(agent)));
    };
    let studio = &mut *studio;
    studio.textures.refresh(&stages.images);
    studio.find_eyes(&order, &eyes, &stages, &mut report);
    let clear = clear.map_or([0, 0, 0, 255], |clear| SRGB.opaque(Tint::of(clear.0)));
    let mut first = 0;
    while let Some(&Eye { stage, agent, .. }) = studio.eyes.get(first) {
        let group = first..first + studio.eyes[first..].iter().take_while(|eye| eye.stage == stage).count();
        first = group.end;
        if let Err(error) = stages.gather(stage, &mut studio.textures, &mut studio.items) {
            report(&eyes, agent, error);
            continue;
        }
        for eye in group {
            let Eye { agent, centre, .. } = studio.eyes[eye];
            let Ok((_, (sensor, image), mut frame)) = eyes.get_mut(agent) else { continue };
            let size = UVec2::new(image.0.width, image.0.height);
            let painted = studio.paint(&stages, &View::new(centre, sensor.width, size), size, clear, &mut frame.pixels);
            match painted {
                Ok(()) => frame.tick = Some(tick.0),
                Err(error) => report(&eyes, agent, error),
            }
        }
    }
}

impl Studio {
    /// Lists the agents that are observed, those of one stage together.
    fn find_eyes(
        &mut self,
        order: &AgentOrder,
        eyes: &Eyes,
        stages: &Stages,
        report: &mut impl FnMut(&Eyes, Entity, RasterError),
    ) {
        self.eyes.clear();
        for (row, &agent) in order.entities().iter().enumerate() {
            let Ok(((_, control, episode), (sensor, image), _)) = eyes.get(agent) else { continue };
            if !is_observed(control, episode) {
                continue;
            }
            match locate(sensor, image, stages) {
                Ok((stage, centre)) => self.eyes.push(Eye { stage, row, agent, centre }),
                Err(error) => report(eyes, agent, error),
            }
        }
        self.eyes.sort_unstable_by_key(|eye| (eye.stage, eye.row));
    }

    /// Paints what was gathered, the farthest first, and what is equally far in the order in which it was found.
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
            let seen = match item.what {
                What::Tiles(_) => true,
                What::Sprite { .. } => {
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
            match item.what {
                What::Sprite { part, colour } => {
                    let area = canvas.cut(&quad);
                    let sprite = SpriteOn { quad, part, texture, tint: Tint::of(colour) };
                    sprite.paint(&mut canvas, area, &mut self.columns);
                }
                What::Tiles(entity) => {
                    let Ok(layer) = stages.layers.get(entity) else { continue };
                    let tiles = TilesOn { cell: quad, layer, strip: texture };
                    tiles.paint(&mut canvas, &mut self.tiles).map_err(|why| RasterError::Thing(entity, why))?;
                }
            }
        }
        Ok(())
    }
}

/// The stage that a sensor sees, and the place it looks at.
fn locate(sensor: &RasterSensor, image: &ImageSensor, stages: &Stages) -> Result<(Option<Entity>, Vec2), RasterError> {
    image.0.check()?;
    if !(sensor.width > 0.0 && sensor.width.is_finite()) {
        return Err(RasterError::Width(sensor.width));
    }
    let (stage, centre) = stages.locate(sensor.target).ok_or(RasterError::NoTarget(sensor.target))?;
    if centre.is_finite() { Ok((stage, centre)) } else { Err(RasterError::LostTarget(centre)) }
}

/// A number that grows with z.
fn rank(z: f32) -> u32 {
    // There is only one zero.
    let bits = (z + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}
