//! The distinction of the game's entities from those that were there before it, or belong to the plugin.

use std::any::TypeId;

use bevy::{
    ecs::{component::ComponentId, entity::EntityHashSet, resource::IsResource, system::SystemIdMarker},
    input::gamepad::Gamepad,
    prelude::*,
    window::{Monitor, Window},
};

use bevy_playbot::agent::Agent;

/// A World before its game has started. Later entities belong to the game.
pub(super) struct Baseline {
    entities: EntityHashSet,
    /// Components of entities that never belong to the game, if they exist.
    kept: Vec<TypeId>,
    /// Components of roots of scenes. The entities below them appear when their file is loaded, not in a fixed tick.
    scenes: Vec<ComponentId>,
}

impl Baseline {
    /// Creates the baseline. Call it before the first systems of the game run.
    pub(super) fn of(world: &mut World) -> Self {
        let kept = vec![
            TypeId::of::<Agent>(),
            TypeId::of::<IsResource>(),
            TypeId::of::<SystemIdMarker>(),
            TypeId::of::<Gamepad>(),
            TypeId::of::<Window>(),
            TypeId::of::<Monitor>(),
            #[cfg(feature = "camera")]
            TypeId::of::<bevy_playbot::camera::SensorCamera>(),
        ];
        Self { entities: all(world).collect(), kept, scenes: scene_roots(world) }
    }

    /// Returns all entities that the game has spawned, in the order of their storage.
    pub(super) fn spawned(&self, world: &World) -> Vec<Entity> {
        let kept: Vec<ComponentId> = self.kept.iter().filter_map(|id| world.components().get_id(*id)).collect();
        let is_kept = |entity: Entity| kept.iter().any(|&component| world.entity(entity).contains_id(component));
        all(world).filter(|entity| !self.entities.contains(entity) && !is_kept(*entity)).collect()
    }

    /// Returns whether the game itself decides when and where an entity appears. Parts of a scene do not count: they
    /// appear when their file is loaded.
    pub(super) fn is_placed(&self, world: &World, entity: Entity) -> bool {
        let mut entity = entity;
        while let Some(parent) = world.get::<ChildOf>(entity).map(ChildOf::parent) {
            if self.scenes.iter().any(|&scene| world.entity(parent).contains_id(scene)) {
                return false;
            }
            entity = parent;
        }
        true
    }
}

fn all(world: &World) -> impl Iterator<Item = Entity> + '_ {
    let archetypes = world.archetypes().iter();
    archetypes.flat_map(|archetype| archetype.entities().iter().map(|entity| entity.id()))
}

/// Returns the components of the roots of Bevy's scenes, if this build has them.
fn scene_roots(world: &mut World) -> Vec<ComponentId> {
    let Some(registry) = world.get_resource::<AppTypeRegistry>().cloned() else { return Vec::new() };
    let registry = registry.read();
    let names = ["WorldAssetRoot", "DynamicWorldRoot"];
    let roots = names.iter().filter_map(|name| {
        let component = registry.get_with_short_type_path(name)?.data::<ReflectComponent>()?.clone();
        Some(component.register_component(world))
    });
    roots.collect()
}
