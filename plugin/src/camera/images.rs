//! Things to be drawn whose images are not there.

use bevy::{
    asset::{AssetId, LoadState},
    prelude::*,
};

use super::error::NoImage;
use crate::vision::TileLayer;

/// Sprites and tile layers whose image was missing when they were last looked at.
#[derive(Resource, Default)]
pub(super) struct MissingImages(Vec<Entity>);

/// Looks at what has changed. All is looked at again once an image is removed.
pub(super) fn note_missing_images(
    mut missing: ResMut<MissingImages>,
    mut events: MessageReader<AssetEvent<Image>>,
    images: Res<Assets<Image>>,
    sprites: Query<(Entity, Ref<Sprite>)>,
    layers: Query<(Entity, Ref<TileLayer>)>,
) {
    let removed = events.read().any(|event| matches!(event, AssetEvent::Removed { .. }));
    let changed = sprites.iter().filter(|(_, sprite)| removed || sprite.is_changed());
    let changed = changed.map(|(entity, sprite)| (entity, sprite.image.id()));
    let tiles = layers.iter().filter(|(_, layer)| removed || layer.is_changed());
    let tiles = tiles.map(|(entity, layer)| (entity, layer.tileset.id()));
    missing.0.extend(changed.chain(tiles).filter(|(_, image)| !images.contains(*image)).map(|(entity, _)| entity));
}

/// Whether everything has its image.
pub(super) enum Images {
    Ready,
    Loading,
    Missing(NoImage),
}

/// Looks again at those that lacked their image.
pub(super) fn check(world: &mut World) -> Images {
    let mut missing = std::mem::take(&mut world.resource_mut::<MissingImages>().0);
    missing.sort_unstable();
    missing.dedup();
    missing.retain(|&entity| {
        image(world, entity).is_some_and(|(_, image)| !world.resource::<Assets<Image>>().contains(image))
    });
    let mut found = Images::Ready;
    for &entity in &missing {
        let Some((what, image)) = image(world, entity) else { continue };
        let why = match world.resource::<AssetServer>().get_load_state(image) {
            Some(LoadState::Loading | LoadState::Loaded) => {
                found = Images::Loading;
                continue;
            }
            Some(LoadState::Failed(error)) => error.to_string(),
            _ => "its handle leads to no image".to_owned(),
        };
        found = Images::Missing(NoImage { what, entity, name: world.get::<Name>(entity).cloned(), why });
        break;
    }
    world.resource_mut::<MissingImages>().0 = missing;
    found
}

fn image(world: &World, entity: Entity) -> Option<(&'static str, AssetId<Image>)> {
    let sprite = world.get::<Sprite>(entity).map(|sprite| ("sprite", sprite.image.id()));
    sprite.or_else(|| world.get::<TileLayer>(entity).map(|layer| ("tile layer", layer.tileset.id())))
}
