//! The items that are drawn on a stage.

use bevy::{ecs::system::SystemParam, prelude::*, sprite::Anchor};

use super::{
    error::{RasterError, Undrawable},
    pose::Pose,
    quad::{ImageRegion, Quad, lay_out},
    texture::{TextureId, Textures},
};
use crate::vision::{Stage, TileLayer, lacks_image};

/// An item to draw, in the coordinates of its stage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub z: f32,
    pub texture: TextureId,
    /// The sprite, or the first cell of the tiles.
    pub quad: Quad,
    pub kind: ItemKind,
}

/// The kind of an item.
#[derive(Clone, Copy, Debug)]
pub(super) enum ItemKind {
    Sprite { region: ImageRegion, colour: Color },
    Tiles(Entity),
}

/// Entities that may be on a stage, or hold one that is.
#[derive(SystemParam)]
pub(super) struct Stages<'w, 's> {
    parents: Query<'w, 's, &'static ChildOf>,
    places: Query<'w, 's, &'static Transform>,
    visibilities: Query<'w, 's, &'static Visibility>,
    stages: Query<'w, 's, (), With<Stage>>,
    things: Query<
        'w,
        's,
        (
            Option<&'static Transform>,
            Option<&'static Visibility>,
            Option<(&'static Sprite, &'static Anchor)>,
            Option<&'static TileLayer>,
            Option<&'static Children>,
            Has<Stage>,
        ),
    >,
    roots: Query<'w, 's, Entity, (Without<ChildOf>, Or<(With<Transform>, With<Children>)>)>,
    pub layers: Query<'w, 's, &'static TileLayer>,
    pub images: Res<'w, Assets<Image>>,
    pub layouts: Res<'w, Assets<TextureAtlasLayout>>,
}

impl Stages<'_, '_> {
    /// Returns the stage of an entity, if it is beneath one, and its position there.
    pub fn locate(&self, entity: Entity) -> Option<(Option<Entity>, Vec2)> {
        let mut pose = Pose::of(self.places.get(entity).ok()?);
        let mut lowest = entity;
        while let Ok(&ChildOf(parent)) = self.parents.get(lowest) {
            if self.stages.contains(parent) {
                return Some((Some(parent), pose.at.truncate()));
            }
            if let Ok(transform) = self.places.get(parent) {
                pose = Pose::of(transform).then(&pose);
            }
            lowest = parent;
        }
        Some((None, pose.at.truncate()))
    }

    /// Returns whether entities that inherit their visibility from this one are visible.
    fn is_visible(&self, mut entity: Entity) -> bool {
        loop {
            match self.visibilities.get(entity) {
                Ok(Visibility::Hidden) => return false,
                Ok(Visibility::Visible) => return true,
                _ => {}
            }
            match self.parents.get(entity) {
                Ok(&ChildOf(parent)) => entity = parent,
                Err(_) => return true,
            }
        }
    }

    /// Lists the items on a stage, or outside of all stages, parents before their children and
    /// children in order.
    pub fn gather(
        &self,
        stage: Option<Entity>,
        textures: &mut Textures,
        items: &mut Vec<Item>,
    ) -> Result<(), RasterError> {
        items.clear();
        let mut gathering = Gathering { stages: self, textures, items };
        let Some(stage) = stage else {
            return self.roots.iter().try_for_each(|root| gathering.visit(root, None, true));
        };
        let Ok((.., Some(children), _)) = self.things.get(stage) else { return Ok(()) };
        let visible = self.is_visible(stage);
        children.iter().try_for_each(|child| gathering.visit(child, None, visible))
    }
}

struct Gathering<'a, 'w, 's> {
    stages: &'a Stages<'w, 's>,
    textures: &'a mut Textures,
    items: &'a mut Vec<Item>,
}

impl Gathering<'_, '_, '_> {
    fn visit(&mut self, entity: Entity, parent: Option<&Pose>, visible: bool) -> Result<(), RasterError> {
        let Ok((transform, visibility, sprite, layer, children, is_stage)) = self.stages.things.get(entity) else {
            return Ok(());
        };
        if is_stage {
            return Ok(());
        }
        let visible = match visibility {
            Some(Visibility::Hidden) => false,
            Some(Visibility::Visible) => true,
            _ => visible,
        };
        let pose = transform.map(|transform| Pose::child(parent, transform));
        if let (true, Some(pose)) = (visible, &pose) {
            let blame = |why| RasterError::Thing(entity, why);
            if let Some((sprite, anchor)) = sprite {
                let item = self.sprite(sprite, anchor, pose).map_err(blame)?;
                self.items.push(item);
            }
            if let Some(layer) = layer {
                let item = self.tiles(entity, layer, pose).map_err(blame)?;
                self.items.push(item);
            }
        }
        let inherited = pose.as_ref().or(parent);
        children.map_or(Ok(()), |children| children.iter().try_for_each(|child| self.visit(child, inherited, visible)))
    }

    fn sprite(&mut self, sprite: &Sprite, anchor: &Anchor, pose: &Pose) -> Result<Item, Undrawable> {
        if lacks_image(sprite) {
            return Err(Undrawable::NoImage);
        }
        let texture = self.textures.find(&sprite.image, &self.stages.images)?;
        let image = self.textures.get(texture);
        let size = UVec2::new(image.width, image.height).as_vec2();
        let (quad, region) = lay_out(sprite, anchor, pose, size, &self.stages.layouts)?;
        Ok(Item { z: pose.at.z, texture, quad, kind: ItemKind::Sprite { region, colour: sprite.color } })
    }

    fn tiles(&mut self, entity: Entity, layer: &TileLayer, pose: &Pose) -> Result<Item, Undrawable> {
        if !layer.is_complete() {
            let TileLayer { columns, rows, ref cells, .. } = *layer;
            return Err(Undrawable::Cells { cells: cells.len(), columns, rows });
        }
        let texture = self.textures.find(&layer.tileset, &self.stages.images)?;
        let strip = self.textures.get(texture);
        if !strip.height.is_multiple_of(strip.width) {
            return Err(Undrawable::Strip { width: strip.width, height: strip.height });
        }
        let quad = Quad { corner: pose.at.truncate(), across: pose.x.truncate(), up: pose.y.truncate() };
        Ok(Item { z: pose.at.z, texture, quad, kind: ItemKind::Tiles(entity) })
    }
}
