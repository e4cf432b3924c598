//! The comparison of two copies of a game after the same tick, component by component and resource by resource.

use crate::{
    doctor,
    doctor::{
        DifferenceKind, DoctorComparison, DoctorDifference,
        field::{EntityMatch, FieldComparison, FieldDifference, each_entity},
        game_copy::{GameCopy, GroupKey, Groups, KnownType, KnownTypes, types_of},
    },
};
use bevy::{
    ecs::{
        component::ComponentId,
        entity::{EntityHashMap, EntityHashSet},
    },
    prelude::{Entity, *},
};
use std::{
    any::TypeId,
    collections::{BTreeMap, BTreeSet},
};

/// The settings of a comparison.
pub(super) struct Comparer<'a> {
    pub known_types: &'a KnownTypes,
    pub comparison: DoctorComparison,
    /// Parts of type paths that are ignored.
    pub ignored: &'a [String],
    /// Types of fields that could not be compared.
    pub incomparable: BTreeSet<String>,
}

/// The differences after a tick.
#[derive(Default)]
pub(super) struct Found {
    pub differences: Vec<DoctorDifference>,
    pub unmatched: usize,
}

/// Group and index of an entity.
type Places = EntityHashMap<(usize, usize)>;

/// The partners of the entities of two copies.
struct Matching<'a> {
    known_types: &'a KnownTypes,
    pairs: &'a [Pairs],
    left: Places,
    right: Places,
    /// True if entities of one kind may have another order: that of their spawning may differ from a first episode's.
    is_loose: bool,
}

impl<'a> Matching<'a> {
    fn new(known_types: &'a KnownTypes, pairs: &'a [Pairs], is_loose: bool) -> Self {
        let places = |side: fn(&Pairs) -> &Vec<Entity>| -> Places {
            let numbered = pairs.iter().enumerate();
            let placed = numbered
                .flat_map(|(group, pairs)| side(pairs).iter().enumerate().map(move |(at, e)| (*e, (group, at))));
            placed.collect()
        };
        let (left, right) = (places(|pairs| &pairs.left), places(|pairs| &pairs.right));
        Self { known_types, pairs, left, right, is_loose }
    }
}

impl EntityMatch for Matching<'_> {
    fn is_same(&self, left: Entity, right: Entity) -> bool {
        match (self.left.get(&left), self.right.get(&right)) {
            (Some(left), Some(right)) => left == right || (self.is_loose && left.0 == right.0),
            // Entities outside of the game, such as observers, have no partner and are not compared.
            _ => true,
        }
    }

    fn describe(&self, left: Entity, right: Entity) -> [String; 2] {
        let in_words = |places: &Places, entity: Entity| match places.get(&entity) {
            Some(&(group, at)) => describe(self.known_types, &self.pairs[group], at, entity),
            None => entity.to_string(),
        };
        [in_words(&self.left, left), in_words(&self.right, right)]
    }
}

impl Comparer<'_> {
    /// Returns all differences, nearest to their cause first. These are types of the game before those of the engine,
    /// and resources before components, whose values often come from them.
    pub fn compare(&mut self, left: &GameCopy, right: &GameCopy, tick: u32) -> Found {
        let mut found = Found::default();
        let pairs = self.pair_up(left, right, tick, &mut found);
        let entities = Matching::new(self.known_types, &pairs, self.is_loose());
        self.compare_resources(left, right, tick, &entities, &mut found);
        for group in &pairs {
            found.differences.extend(self.compare_group(left, right, tick, group, &entities));
        }
        found.differences.sort_by_key(|difference| rank(self.comparison, difference));
        found
    }

    /// Returns whether entities of one kind may have another order.
    fn is_loose(&self) -> bool {
        match self.comparison {
            DoctorComparison::Repeat | DoctorComparison::Clock | DoctorComparison::Threads => false,
            DoctorComparison::Archetypes | DoctorComparison::Arenas => true,
            DoctorComparison::Restart | DoctorComparison::Snapshots | DoctorComparison::OtherLevel => true,
        }
    }

    fn is_wanted(&self, known: &KnownType) -> bool {
        let path = known.path.as_deref().unwrap_or_default();
        known.is_compared()
            && doctor::is_compared_in(self.comparison, path)
            && !self.ignored.iter().any(|part| path.contains(part.as_str()))
    }

    fn compare_resources(
        &mut self,
        left: &GameCopy,
        right: &GameCopy,
        tick: u32,
        entities: &dyn EntityMatch,
        found: &mut Found,
    ) {
        // Lists in resources contain both agents of a shared World, so the second one has another index than alone.
        if self.comparison == DoctorComparison::Arenas && left.number(0) != right.number(0) {
            return;
        }
        let (lefts, rights) = (self.resources(left), self.resources(right));
        let all: BTreeSet<TypeId> = lefts.keys().chain(rights.keys()).copied().collect();
        for id in all {
            let Some(known) = self.known_types.get(id).filter(|known| self.is_wanted(known)) else { continue };
            let name = known.path.clone().unwrap_or_default();
            let difference = match (lefts.get(&id), rights.get(&id)) {
                (Some(&a), Some(&b)) => self.field(known, (&left.world, a), (&right.world, b), entities),
                (a, b) => presence(a.is_some(), b.is_some()),
            };
            found.differences.extend(difference.map(|field| DoctorDifference {
                tick,
                kind: DifferenceKind::Resource,
                name,
                entity: None,
                field: field.path,
                left: field.left,
                right: field.right,
                value_type: field.value_type,
            }));
        }
    }

    fn resources(&self, copy: &GameCopy) -> BTreeMap<TypeId, Entity> {
        let typed =
            |(id, entity): (ComponentId, Entity)| Some((copy.world.components().get_info(id)?.type_id()?, entity));
        copy.world.resource_entities().iter().filter_map(typed).collect()
    }

    /// Returns the first field in which a component or resource of two entities differs.
    fn field(
        &mut self,
        known: &KnownType,
        left: (&World, Entity),
        right: (&World, Entity),
        entities: &dyn EntityMatch,
    ) -> Option<FieldDifference> {
        let reflect = known.reflect.as_ref()?;
        let (a, b) = (reflect.reflect(left.0.entity(left.1)), reflect.reflect(right.0.entity(right.1)));
        let (Some(a), Some(b)) = (a, b) else { return presence(a.is_some(), b.is_some()) };
        let mut comparison = FieldComparison {
            entities,
            handles: !self.is_loose(),
            right_may_hold_more: self.comparison == DoctorComparison::Arenas,
            incomparable: &mut self.incomparable,
        };
        comparison.first(a.as_partial_reflect(), b.as_partial_reflect())
    }

    fn compare_group(
        &mut self,
        left: &GameCopy,
        right: &GameCopy,
        tick: u32,
        group: &Pairs,
        entities: &dyn EntityMatch,
    ) -> Vec<DoctorDifference> {
        let mut differences = Vec::new();
        for (place, (&a, &b)) in group.left.iter().zip(&group.right).enumerate() {
            for (name, field) in self.components(left, a, right, b, entities) {
                let entity = describe(self.known_types, group, place, a);
                let (kind, FieldDifference { path, left, right, value_type }) = (DifferenceKind::Component, field);
                let (entity, field) = (Some(entity), path);
                differences.push(DoctorDifference { tick, kind, name, entity, field, left, right, value_type });
            }
        }
        let in_another_order =
            self.is_loose() && !differences.is_empty() && self.is_reordered(left, right, group, entities);
        if in_another_order { Vec::new() } else { differences }
    }

    /// Returns whether every entity on the left has an equal one on the right, in any order.
    fn is_reordered(&mut self, left: &GameCopy, right: &GameCopy, group: &Pairs, entities: &dyn EntityMatch) -> bool {
        let mut free = group.right.clone();
        group.left.iter().all(|&a| {
            let equal = free.iter().position(|&b| self.components(left, a, right, b, entities).is_empty());
            equal.map(|at| free.remove(at)).is_some()
        })
    }

    /// Returns the components of two entities that differ, and the first field in which they do. Components that only
    /// one of them has are the engine's: those of the game decided the matching.
    fn components(
        &mut self,
        left: &GameCopy,
        a: Entity,
        right: &GameCopy,
        b: Entity,
        entities: &dyn EntityMatch,
    ) -> Vec<(String, FieldDifference)> {
        let types = types_of(&left.world, left.world.entity(a).archetype().components());
        let shared = types.into_iter().filter(|id| right.world.entity(b).contains_type_id(*id));
        let known_types = self.known_types;
        let mut differences = Vec::new();
        for known in shared.filter_map(|id| known_types.get(id)) {
            if self.is_wanted(known)
                && let Some(field) = self.field(known, (&left.world, a), (&right.world, b), entities)
            {
                differences.push((known.path.clone().unwrap_or_default(), field));
            }
        }
        differences
    }
}

fn presence(left: bool, right: bool) -> Option<FieldDifference> {
    let word = |there: bool| if there { "there" } else { "not there" }.to_owned();
    let [left_word, right_word] = [left, right].map(word);
    let empty = String::new;
    let difference = FieldDifference { path: empty(), left: left_word, right: right_word, value_type: empty() };
    (left != right).then_some(difference)
}

/// Returns the place of a difference among those of its tick. Differences in types of the game come before those of the
/// engine, and resources before components.
pub(super) fn rank(comparison: DoctorComparison, difference: &DoctorDifference) -> (bool, u8) {
    // After a restart or a snapshot, a surplus of entities is itself the cause, so it comes early. In other comparisons
    // it is the effect of another difference, and comes last.
    let is_cause = comparison.returns();
    match difference.kind {
        DifferenceKind::Entities => (false, if is_cause { 1 } else { 3 }),
        DifferenceKind::Resource => (doctor::is_engine(&difference.name), 0),
        _ => (doctor::is_engine(&difference.name), 2),
    }
}

/// Entities of one kind, pair by pair.
pub(super) struct Pairs {
    pub key: GroupKey,
    pub left: Vec<Entity>,
    pub right: Vec<Entity>,
}

impl Comparer<'_> {
    /// Finds the partners of all entities. Kinds with more entities on one side are reported and left out.
    pub(super) fn pair_up(&self, left: &GameCopy, right: &GameCopy, tick: u32, found: &mut Found) -> Vec<Pairs> {
        let lefts = left.census.groups(&left.world, self.known_types);
        let mut rights = right.census.groups(&right.world, self.known_types);
        if self.comparison == DoctorComparison::Arenas {
            return self.pair_with_share(left, right, lefts, &rights, found);
        }
        let mut pairs = Vec::new();
        for (key, left) in lefts {
            let right = rights.remove(&key).unwrap_or_default();
            if left.len() == right.len() {
                pairs.push(Pairs { key, left, right });
            } else {
                found.differences.extend(self.of_counts(&key, left.len(), right.len(), tick));
            }
        }
        let only_right = rights.iter().filter_map(|(key, right)| self.of_counts(key, 0, right.len(), tick));
        found.differences.extend(only_right);
        pairs
    }

    fn pair_with_share(
        &self,
        left: &GameCopy,
        right: &GameCopy,
        lefts: Groups,
        rights: &Groups,
        found: &mut Found,
    ) -> Vec<Pairs> {
        let owners = owners(self.known_types, right, rights.values().flatten().copied());
        let number = left.number(0);
        let mut pairs = Vec::new();
        for (key, left) in lefts {
            let all = rights.get(&key).map_or(&[][..], Vec::as_slice);
            match share_of(&owners, number, left.len(), all) {
                Some(right) => pairs.push(Pairs { key, left, right }),
                None => found.unmatched += left.len(),
            }
        }
        pairs
    }

    fn of_counts(&self, key: &GroupKey, left: usize, right: usize, tick: u32) -> Option<DoctorDifference> {
        let ignored = |id: &TypeId| {
            let path = self.known_types.get(*id).and_then(|known| known.path.as_deref()).unwrap_or_default();
            self.ignored.iter().any(|part| path.contains(part.as_str()))
        };
        (!key.types.iter().any(ignored)).then(|| DoctorDifference {
            tick,
            kind: DifferenceKind::Entities,
            name: describe_kind(self.known_types, key),
            entity: None,
            field: String::new(),
            left: left.to_string(),
            right: right.to_string(),
            value_type: String::new(),
        })
    }
}

/// Returns the kind, such as `"Paddle" [Velocity, Collider]`.
fn describe_kind(known_types: &KnownTypes, key: &GroupKey) -> String {
    let types = key.types.iter().filter_map(|id| known_types.get(*id)?.short_name());
    let types: Vec<_> = types.collect();
    let is_nameless = types.is_empty();
    let types = format!("[{}]", types.join(", "));
    match (&key.agent, &key.name) {
        (Some(number), _) => format!("agent {number}"),
        (None, Some(name)) => format!("\"{name}\" {types}"),
        (None, None) if is_nameless => "entities without components of the game that have a name".to_owned(),
        (None, None) => types,
    }
}

/// Returns the entity, such as `entity 3v0, number 2 of 5 [Brick]`.
fn describe(known_types: &KnownTypes, group: &Pairs, place: usize, entity: Entity) -> String {
    let kind = describe_kind(known_types, &group.key);
    match group.left.len() {
        1 => kind,
        count => format!("{kind}, number {} of {count} in the order of spawning (entity {entity})", place + 1),
    }
}

// Entities of each agent, in a World with several arenas.

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
