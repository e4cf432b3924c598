//! Which entities are the game's, and which were there before it or belong to others.

use std::any::TypeId;

use bevy::{
    ecs::{component::ComponentId, entity::EntityHashSet, resource::IsResource, system::SystemIdMarker},
    input::gamepad::Gamepad,
    prelude::*,
    window::{Monitor, Window},
};

use bevy_playbot::agent::Agent;

/// A World before its game has begun: what is there later and was not there then belongs to the game.
pub(super) struct Baseline {
    entities: EntityHashSet,
    /// Components of entities that never belong to the game, where they exist.
    kept: Vec<TypeId>,
    /// Components of roots of scenes. What is beneath them comes when its file is loaded, and not in a certain tick.
    scenes: Vec<ComponentId>,
}

impl Baseline {
    /// To be made before the first systems of the game run.
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

    /// Everything that the game has spawned, in the order in which it is stored.
    pub(super) fn spawned(&self, world: &World) -> Vec<Entity> {
        let kept: Vec<ComponentId> = self.kept.iter().filter_map(|id| world.components().get_id(*id)).collect();
        let is_kept = |entity: Entity| kept.iter().any(|&component| world.entity(entity).contains_id(component));
        all(world).filter(|entity| !self.entities.contains(entity) && !is_kept(*entity)).collect()
    }

    /// Whether an entity of the game is where and when the game wants it: not part of a scene, which comes when its file is
    /// loaded.
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

/// The components that Bevy's scenes are spawned beneath, if this build has them.
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
