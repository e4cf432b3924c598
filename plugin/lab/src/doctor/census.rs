//! The game's entities, in the order in which they were spawned.

use std::{any::TypeId, collections::BTreeMap};

use bevy::{
    ecs::{entity::EntityHashMap, observer::Observer, resource::IsResource, system::SystemIdMarker},
    prelude::*,
};
use bevy_playbot::agent::Agent;

use super::types::KnownTypes;

/// The key by which entities of two Worlds are matched: the name, and the game's own components. Components of the
/// engine come and go with the loading of files.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct GroupKey {
    /// Number of the agent, if it is one.
    pub agent: Option<u32>,
    /// Its name, if it has one.
    pub name: Option<String>,
    /// Components of the game.
    pub types: Vec<TypeId>,
}

/// Entities of the same kind, in the order of their spawning.
pub(super) type Groups = BTreeMap<GroupKey, Vec<Entity>>;

/// Numbers entities in the order of their spawning, from tick to tick. Their ids are reused after a despawn, in another
/// order.
#[derive(Default)]
pub(super) struct Census {
    numbers: EntityHashMap<u64>,
    next: u64,
}

impl Census {
    /// Adds new entities and removes despawned ones. Call it after each tick.
    pub fn update(&mut self, world: &World) {
        let mut numbers = EntityHashMap::default();
        let mut new = Vec::new();
        for (place, entity) in game_entities(world).into_iter().enumerate() {
            match self.numbers.get(&entity) {
                Some(&number) => {
                    numbers.insert(entity, number);
                }
                // Entities of one kind lie in the order in which they came.
                None => new.push((world.entity(entity).spawn_tick().get(), place, entity)),
            }
        }
        new.sort();
        for (_, _, entity) in new {
            numbers.insert(entity, self.next);
            self.next += 1;
        }
        self.numbers = numbers;
    }

    /// Returns all entities, by kind.
    pub fn groups(&self, world: &World, known_types: &KnownTypes) -> Groups {
        let mut numbered: Vec<_> = self.numbers.iter().map(|(&entity, &number)| (number, entity)).collect();
        numbered.sort();
        let mut groups = Groups::new();
        for (_, entity) in numbered {
            groups.entry(key(world, entity, known_types)).or_default().push(entity);
        }
        groups
    }
}

/// Returns every entity except those with resources, observers and systems.
fn game_entities(world: &World) -> Vec<Entity> {
    let components = world.components();
    let hidden = [
        components.component_id::<IsResource>(),
        components.component_id::<Observer>(),
        components.component_id::<SystemIdMarker>(),
    ];
    let archetypes = world.archetypes().iter();
    let shown = archetypes.filter(|archetype| !hidden.iter().flatten().any(|&id| archetype.contains(id)));
    shown.flat_map(|archetype| archetype.entities().iter().map(|entity| entity.id())).collect()
}

fn key(world: &World, entity: Entity, known_types: &KnownTypes) -> GroupKey {
    let entity = world.entity(entity);
    let types = types_of(world, entity.archetype().components());
    GroupKey {
        agent: entity.get::<Agent>().map(|agent| agent.index),
        name: entity.get::<Name>().map(|name| name.as_str().to_owned()),
        types: types.into_iter().filter(|id| known_types.get(*id).is_some_and(|known| !known.engine)).collect(),
    }
}

/// Returns the types of components, in an order that is the same in all Worlds of a process.
pub(super) fn types_of(world: &World, components: &[bevy::ecs::component::ComponentId]) -> Vec<TypeId> {
    let infos = components.iter().filter_map(|&id| world.components().get_info(id));
    let mut types: Vec<_> = infos.filter_map(|info| info.type_id()).collect();
    types.sort();
    types
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Component)]
    struct Brick;

    fn order(world: &World, census: &Census) -> Vec<Entity> {
        let groups = census.groups(world, &KnownTypes::new(&World::new()));
        groups.into_values().flatten().collect()
    }

    #[test]
    fn entities_stand_in_the_order_in_which_they_came_whatever_ids_they_got() {
        let (mut world, mut census) = (World::new(), Census::default());
        let old: Vec<_> = (0..3).map(|_| world.spawn(Brick).id()).collect();
        census.update(&world);
        assert_eq!(order(&world, &census), old);
        world.despawn(old[0]);
        world.despawn(old[1]);
        let new: Vec<_> = (0..2).map(|_| world.spawn(Brick).id()).collect();
        census.update(&world);
        assert_eq!(order(&world, &census), [old[2], new[0], new[1]]);
    }

    #[test]
    fn resources_and_observers_are_no_entities_of_the_game() {
        let (mut world, mut census) = (World::new(), Census::default());
        world.init_resource::<bevy_playbot::tick::Tick>();
        world.add_observer(|_: On<Add, Brick>| {});
        let brick = world.spawn(Brick).id();
        census.update(&world);
        assert_eq!(order(&world, &census), [brick]);
    }
}
