//! The pairs of corresponding entities in two copies.

use std::any::TypeId;

use bevy::prelude::Entity;

use super::{
    arenas::{owners, share_of},
    census::{GroupKey, Groups},
    compare::{Comparer, Found},
    game_copy::GameCopy,
    report::{Comparison, Difference, DifferenceKind},
};

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
        if self.comparison == Comparison::Arenas {
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

    fn of_counts(&self, key: &GroupKey, left: usize, right: usize, tick: u32) -> Option<Difference> {
        let ignored = |id: &TypeId| {
            let path = self.known_types.get(*id).and_then(|known| known.path.as_deref()).unwrap_or_default();
            self.ignored.iter().any(|part| path.contains(part.as_str()))
        };
        (!key.types.iter().any(ignored)).then(|| Difference {
            tick,
            kind: DifferenceKind::Entities,
            name: self.describe_kind(key),
            entity: None,
            field: String::new(),
            left: left.to_string(),
            right: right.to_string(),
        })
    }

    /// Returns the kind, such as `"Paddle" [Velocity, Collider]`.
    fn describe_kind(&self, key: &GroupKey) -> String {
        let types = key.types.iter().filter_map(|id| self.known_types.get(*id)?.short_name());
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
    pub(super) fn describe(&self, group: &Pairs, place: usize, entity: Entity) -> String {
        let kind = self.describe_kind(&group.key);
        match group.left.len() {
            1 => kind,
            count => format!("{kind}, number {} of {count} in the order of spawning (entity {entity})", place + 1),
        }
    }
}
