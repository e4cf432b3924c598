//! The comparison of two copies of a game after the same tick, component by component and resource by resource.

use std::{
    any::TypeId,
    collections::{BTreeMap, BTreeSet},
};

use bevy::{
    ecs::{component::ComponentId, entity::EntityHashMap},
    prelude::*,
};

use super::{
    census::types_of,
    field::{FieldComparison, FieldDifference},
    game_copy::GameCopy,
    pairs::Pairs,
    report::{Comparison, Difference, DifferenceKind},
    scope,
    types::{KnownType, KnownTypes},
};

/// The settings of a comparison.
pub(super) struct Comparer<'a> {
    pub known_types: &'a KnownTypes,
    pub comparison: Comparison,
    /// Parts of type paths that are ignored.
    pub ignored: &'a [String],
    /// Types of fields that could not be compared.
    pub incomparable: BTreeSet<String>,
}

/// The differences after a tick.
#[derive(Default)]
pub(super) struct Found {
    pub differences: Vec<Difference>,
    pub unmatched: usize,
}

/// Group and index of an entity.
type Places = EntityHashMap<(usize, usize)>;

impl Comparer<'_> {
    /// Returns all differences, nearest to their cause first: types of the game before those of the engine, and
    /// resources before components, whose values often come from them.
    pub fn compare(&mut self, left: &GameCopy, right: &GameCopy, tick: u32) -> Found {
        let mut found = Found::default();
        let pairs = self.pair_up(left, right, tick, &mut found);
        let places = |side: fn(&Pairs) -> &Vec<Entity>| -> Places {
            let numbered = pairs.iter().enumerate();
            let placed = numbered
                .flat_map(|(group, pairs)| side(pairs).iter().enumerate().map(move |(at, e)| (*e, (group, at))));
            placed.collect()
        };
        let (left_places, right_places) = (places(|pairs| &pairs.left), places(|pairs| &pairs.right));
        let loose = self.is_loose();
        let same_entity = |a: Entity, b: Entity| match (left_places.get(&a), right_places.get(&b)) {
            // A list of entities has the order of their spawning, which may differ from that of a first episode.
            (Some(a), Some(b)) => {
                if loose {
                    a.0 == b.0
                } else {
                    a == b
                }
            }
            // Entities outside of the game, such as observers, have no partner and are not compared.
            _ => true,
        };
        self.compare_resources(left, right, tick, &same_entity, &mut found);
        for group in &pairs {
            found.differences.extend(self.compare_group(left, right, tick, group, &same_entity));
        }
        // After a restart, a surplus of entities is itself the cause, so it comes early. In other comparisons it is the
        // effect of another difference, and comes last.
        let is_cause = self.comparison == Comparison::Restart;
        let rank = |difference: &Difference| match difference.kind {
            DifferenceKind::Entities => (false, if is_cause { 1 } else { 3 }),
            DifferenceKind::Resource => (scope::is_engine(&difference.name), 0),
            _ => (scope::is_engine(&difference.name), 2),
        };
        found.differences.sort_by_key(rank);
        found
    }

    /// Returns whether entities of one kind may have another order.
    fn is_loose(&self) -> bool {
        matches!(self.comparison, Comparison::Archetypes | Comparison::Restart | Comparison::Arenas)
    }

    fn is_wanted(&self, known: &KnownType) -> bool {
        let path = known.path.as_deref().unwrap_or_default();
        known.is_compared()
            && scope::is_compared_in(self.comparison, path)
            && !self.ignored.iter().any(|part| path.contains(part.as_str()))
    }

    fn compare_resources(
        &mut self,
        left: &GameCopy,
        right: &GameCopy,
        tick: u32,
        same_entity: &dyn Fn(Entity, Entity) -> bool,
        found: &mut Found,
    ) {
        // Lists in resources contain both agents of a shared World, so the second one has another index than alone.
        if self.comparison == Comparison::Arenas && left.number(0) != right.number(0) {
            return;
        }
        let (lefts, rights) = (self.resources(left), self.resources(right));
        let all: BTreeSet<TypeId> = lefts.keys().chain(rights.keys()).copied().collect();
        for id in all {
            let Some(known) = self.known_types.get(id).filter(|known| self.is_wanted(known)) else { continue };
            let name = known.path.clone().unwrap_or_default();
            let difference = match (lefts.get(&id), rights.get(&id)) {
                (Some(&a), Some(&b)) => self.field(known, (&left.world, a), (&right.world, b), same_entity),
                (a, b) => presence(a.is_some(), b.is_some()),
            };
            found.differences.extend(difference.map(|field| Difference {
                tick,
                kind: DifferenceKind::Resource,
                name,
                entity: None,
                field: field.path,
                left: field.left,
                right: field.right,
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
        same_entity: &dyn Fn(Entity, Entity) -> bool,
    ) -> Option<FieldDifference> {
        let reflect = known.reflect.as_ref()?;
        let (a, b) = (reflect.reflect(left.0.entity(left.1)), reflect.reflect(right.0.entity(right.1)));
        let (Some(a), Some(b)) = (a, b) else { return presence(a.is_some(), b.is_some()) };
        let mut comparison = FieldComparison {
            same_entity,
            handles: !self.is_loose(),
            right_may_hold_more: self.comparison == Comparison::Arenas,
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
        same_entity: &dyn Fn(Entity, Entity) -> bool,
    ) -> Vec<Difference> {
        let mut differences = Vec::new();
        for (place, (&a, &b)) in group.left.iter().zip(&group.right).enumerate() {
            for (name, field) in self.components(left, a, right, b, same_entity) {
                let entity = self.describe(group, place, a);
                let (kind, FieldDifference { path, left, right }) = (DifferenceKind::Component, field);
                differences.push(Difference { tick, kind, name, entity: Some(entity), field: path, left, right });
            }
        }
        let in_another_order =
            self.is_loose() && !differences.is_empty() && self.is_reordered(left, right, group, same_entity);
        if in_another_order { Vec::new() } else { differences }
    }

    /// Returns whether every entity on the left has an equal one on the right, in any order.
    fn is_reordered(
        &mut self,
        left: &GameCopy,
        right: &GameCopy,
        group: &Pairs,
        same_entity: &dyn Fn(Entity, Entity) -> bool,
    ) -> bool {
        let mut free = group.right.clone();
        group.left.iter().all(|&a| {
            let equal = free.iter().position(|&b| self.components(left, a, right, b, same_entity).is_empty());
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
        same_entity: &dyn Fn(Entity, Entity) -> bool,
    ) -> Vec<(String, FieldDifference)> {
        let types = types_of(&left.world, left.world.entity(a).archetype().components());
        let shared = types.into_iter().filter(|id| right.world.entity(b).contains_type_id(*id));
        let known_types = self.known_types;
        let mut differences = Vec::new();
        for known in shared.filter_map(|id| known_types.get(id)) {
            if self.is_wanted(known)
                && let Some(field) = self.field(known, (&left.world, a), (&right.world, b), same_entity)
            {
                differences.push((known.path.clone().unwrap_or_default(), field));
            }
        }
        differences
    }
}

fn presence(left: bool, right: bool) -> Option<FieldDifference> {
    let word = |there: bool| if there { "there" } else { "not there" }.to_owned();
    (left != right).then(|| FieldDifference { path: String::new(), left: word(left), right: word(right) })
}
