//! The assignment of entities to agents, in a World with several arenas.

use bevy::{
    ecs::entity::{EntityHashMap, EntityHashSet},
    prelude::*,
};

use super::{census::types_of, game_copy::GameCopy, types::KnownTypes, values::each_entity};

/// The number of the agent that an entity is tied to, or `None` if several are.
pub(super) type Owners = EntityHashMap<Option<u32>>;

/// Follows the entities that components name, from every agent outwards, in both directions. An entity that two agents
/// reach at the same distance belongs to neither, and the search stops there.
pub(super) fn owners(known_types: &KnownTypes, copy: &GameCopy, entities: impl Iterator<Item = Entity>) -> Owners {
    let mut ties: EntityHashMap<EntityHashSet> = EntityHashMap::default();
    for entity in entities {
        for named in named_by(known_types, &copy.world, entity) {
            ties.entry(entity).or_default().insert(named);
            ties.entry(named).or_default().insert(entity);
        }
    }
    let mut owners = Owners::default();
    let mut frontier: Vec<(Entity, u32)> = Vec::new();
    for (row, &agent) in copy.agents.iter().enumerate() {
        owners.insert(agent, Some(copy.number(row)));
        frontier.push((agent, copy.number(row)));
    }
    while !frontier.is_empty() {
        let mut reached = Owners::default();
        for (entity, number) in frontier.drain(..) {
            for &next in ties.get(&entity).into_iter().flatten() {
                if !owners.contains_key(&next) {
                    let owner = reached.entry(next).or_insert(Some(number));
                    *owner = owner.filter(|other| *other == number);
                }
            }
        }
        frontier.extend(reached.iter().filter_map(|(&entity, owner)| Some((entity, (*owner)?))));
        owners.extend(reached);
    }
    owners
}

fn named_by(known_types: &KnownTypes, world: &World, entity: Entity) -> Vec<Entity> {
    let entity = world.entity(entity);
    let mut named = Vec::new();
    for id in types_of(world, entity.archetype().components()) {
        let known = known_types.get(id).filter(|known| known.is_compared());
        if let Some(value) = known.and_then(|known| known.reflect.as_ref()?.reflect(entity)) {
            each_entity(value.as_partial_reflect(), &mut |other| named.push(other));
        }
    }
    named
}

/// Returns the entities of one kind in the shared World that correspond to the `wanted` ones of agent `number` alone.
/// `None` if that is ambiguous.
pub(super) fn share_of(owners: &Owners, number: u32, wanted: usize, all: &[Entity]) -> Option<Vec<Entity>> {
    let own = |entity: &&Entity| owners.get(*entity) == Some(&Some(number));
    let common = |entity: &&Entity| owners.get(*entity).copied().flatten().is_none();
    let picks: [&dyn Fn(&&Entity) -> bool; 3] = [&own, &common, &|entity| own(entity) || common(entity)];
    let mut shares = picks.iter().map(|pick| all.iter().filter(|entity| pick(entity)).copied().collect::<Vec<_>>());
    shares.find(|share| share.len() == wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entities(count: u32) -> Vec<Entity> {
        let mut world = World::new();
        (0..count).map(|_| world.spawn_empty().id()).collect()
    }

    #[test]
    fn an_agents_share_is_its_own_or_what_all_have_in_common() {
        let all = entities(4);
        let owners: Owners = [(all[0], Some(0)), (all[1], Some(1)), (all[2], None)].into_iter().collect();
        assert_eq!(share_of(&owners, 1, 1, &all), Some(vec![all[1]]), "its own");
        assert_eq!(share_of(&owners, 1, 2, &all), Some(vec![all[2], all[3]]), "the common ones");
        assert_eq!(share_of(&owners, 0, 3, &all), Some(vec![all[0], all[2], all[3]]), "both together");
        assert_eq!(share_of(&owners, 0, 4, &all), None);
    }
}
