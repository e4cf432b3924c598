//! Drawn entities whose images are missing.

use bevy::{
    asset::{AssetId, LoadState},
    prelude::*,
};

use super::error::NoImage;
use crate::vision::{NO_IMAGE, TileLayer, lacks_image};

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
