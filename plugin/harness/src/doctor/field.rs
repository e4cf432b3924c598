//! The first field in which two reflected values differ.

use bevy::{
    prelude::Entity,
    reflect::{PartialReflect, ReflectRef, enums::Enum, list::List, map::Map, set::Set},
};
use std::collections::BTreeSet;

/// The path of a difference, and both values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FieldDifference {
    /// From the component or resource, such as `.position[2].x`; empty if it has no parts.
    pub path: String,
    pub left: String,
    pub right: String,
    /// Path of the type of the values; empty if only one of them is there.
    pub value_type: String,
}

/// The correspondence of the entities of two Worlds.
pub(super) trait EntityMatch {
    /// Returns whether an entity of the left World corresponds to one of the right World.
    fn is_same(&self, left: Entity, right: Entity) -> bool;
    /// Returns both entities in words. Their ids may be equal although the entities differ.
    fn describe(&self, left: Entity, right: Entity) -> [String; 2];
}

impl FieldDifference {
    fn between(left: &dyn PartialReflect, right: &dyn PartialReflect) -> Option<Self> {
        Some(Self::in_words(left, show_apart(&format!("{left:?}"), &format!("{right:?}"))))
    }

    /// Describes two values of this one's type.
    fn in_words(value: &dyn PartialReflect, [left, right]: [String; 2]) -> Self {
        Self { path: String::new(), left, right, value_type: value.reflect_type_path().to_owned() }
    }

    fn of_lengths(left: usize, right: usize) -> Option<Self> {
        Some(Self {
            path: ".len()".to_owned(),
            left: left.to_string(),
            right: right.to_string(),
            value_type: String::new(),
        })
    }

    fn inside(mut self, part: impl std::fmt::Display) -> Self {
        self.path = format!("{part}{}", self.path);
        self
    }
}

/// The settings of a comparison of values.
pub(super) struct FieldComparison<'a> {
    pub entities: &'a dyn EntityMatch,
    /// True if handles of assets are compared. A second episode creates new ones.
    pub handles: bool,
    /// True if a list or map on the right may have more entries, as for agents that are not on the left.
    pub right_may_hold_more: bool,
    /// Collects types whose values cannot be compared.
    pub incomparable: &'a mut BTreeSet<String>,
}

impl FieldComparison<'_> {
    /// Returns the first field that differs, in the order of declaration.
    pub fn first(&mut self, left: &dyn PartialReflect, right: &dyn PartialReflect) -> Option<FieldDifference> {
        if let (Some(&left_entity), Some(&right_entity)) =
            (left.try_downcast_ref::<Entity>(), right.try_downcast_ref::<Entity>())
        {
            let is_same = self.entities.is_same(left_entity, right_entity);
            let described = || apart(self.entities.describe(left_entity, right_entity));
            return (!is_same).then(|| FieldDifference::in_words(left, described()));
        }
        if !self.handles && left.reflect_type_path().starts_with("bevy_asset::") {
            return None;
        }
        match (left.reflect_ref(), right.reflect_ref()) {
            (ReflectRef::Struct(a), ReflectRef::Struct(b)) => (0..a.field_len()).find_map(|at| {
                let found = self.first(a.field_at(at)?, b.field_at(at)?)?;
                Some(found.inside(format!(".{}", a.name_at(at).unwrap_or("?"))))
            }),
            (ReflectRef::TupleStruct(a), ReflectRef::TupleStruct(b)) => {
                (0..a.field_len()).find_map(|at| Some(self.first(a.field(at)?, b.field(at)?)?.inside(format!(".{at}"))))
            }
            (ReflectRef::Tuple(a), ReflectRef::Tuple(b)) => {
                (0..a.field_len()).find_map(|at| Some(self.first(a.field(at)?, b.field(at)?)?.inside(format!(".{at}"))))
            }
            (ReflectRef::Array(a), ReflectRef::Array(b)) => {
                (0..a.len()).find_map(|at| Some(self.first(a.get(at)?, b.get(at)?)?.inside(format!("[{at}]"))))
            }
            (ReflectRef::List(a), ReflectRef::List(b)) => self.lists(a, b),
            (ReflectRef::Map(a), ReflectRef::Map(b)) => self.maps(a, b),
            (ReflectRef::Set(a), ReflectRef::Set(b)) => self.sets(a, b),
            (ReflectRef::Enum(a), ReflectRef::Enum(b)) => self.enums(a, b),
            _ => match plain_equal(left, right) {
                Some(true) => None,
                Some(false) => FieldDifference::between(left, right),
                None => {
                    self.incomparable.insert(left.reflect_type_path().to_owned());
                    None
                }
            },
        }
    }

    fn lengths(&self, left: usize, right: usize) -> Option<FieldDifference> {
        let fits = left == right || (self.right_may_hold_more && left < right);
        if fits { None } else { FieldDifference::of_lengths(left, right) }
    }

    fn lists(&mut self, left: &dyn List, right: &dyn List) -> Option<FieldDifference> {
        let shared = left.len().min(right.len());
        let element =
            (0..shared).find_map(|at| Some(self.first(left.get(at)?, right.get(at)?)?.inside(format!("[{at}]"))));
        element.or_else(|| self.lengths(left.len(), right.len()))
    }

    /// The order of a map's entries is no part of its value, so the least key is named.
    fn maps(&mut self, left: &dyn Map, right: &dyn Map) -> Option<FieldDifference> {
        let mut found: Vec<_> = left
            .iter()
            .filter_map(|(key, value)| {
                let difference = match right.get(key) {
                    Some(other) => self.first(value, other)?,
                    None => FieldDifference {
                        path: String::new(),
                        left: show(value),
                        right: "nothing".to_owned(),
                        value_type: value.reflect_type_path().to_owned(),
                    },
                };
                Some(difference.inside(format!("[{}]", show(key))))
            })
            .collect();
        found.sort_by(|a, b| a.path.cmp(&b.path));
        found.into_iter().next().or_else(|| self.lengths(left.len(), right.len()))
    }

    fn sets(&mut self, left: &dyn Set, right: &dyn Set) -> Option<FieldDifference> {
        let missing = left.iter().filter(|value| !self.holds(right, *value)).map(show).min();
        let difference = missing.map(|value| FieldDifference {
            path: format!("[{value}]"),
            left: "in it".to_owned(),
            right: "not in it".to_owned(),
            value_type: String::new(),
        });
        difference.or_else(|| self.lengths(left.len(), right.len()))
    }

    /// Returns whether a set holds a value of the left World, or its partner if it is an entity.
    fn holds(&self, set: &dyn Set, value: &dyn PartialReflect) -> bool {
        let Some(&entity) = value.try_downcast_ref::<Entity>() else { return set.get(value).is_some() };
        let mut others = set.iter().filter_map(|other| other.try_downcast_ref::<Entity>());
        others.any(|other| self.entities.is_same(entity, *other))
    }

    fn enums(&mut self, left: &dyn Enum, right: &dyn Enum) -> Option<FieldDifference> {
        if left.variant_name() != right.variant_name() {
            return FieldDifference::between(left.as_partial_reflect(), right.as_partial_reflect());
        }
        (0..left.field_len()).find_map(|at| {
            let found = self.first(left.field_at(at)?, right.field_at(at)?)?;
            Some(match left.name_at(at) {
                Some(name) => found.inside(format!(".{name}")),
                None => found.inside(format!(".{at}")),
            })
        })
    }
}

// Reflected values.

/// Most characters of a value in a report.
const LONGEST: usize = 96;

/// Most characters that two long values are shown with before the first one that differs.
const BEFORE: usize = 32;

/// Returns a value as text, cut if it is long.
pub(super) fn show(value: &dyn PartialReflect) -> String {
    cut(&format!("{value:?}"), 0)
}

/// Returns the characters of a text from this one on, at most [`LONGEST`] of them.
fn cut(text: &str, from: usize) -> String {
    let (before, after) = (if from > 0 { "…" } else { "" }, text.chars().count() > from + LONGEST);
    let part: String = text.chars().skip(from).take(LONGEST).collect();
    format!("{before}{part}{}", if after { "…" } else { "" })
}

/// Returns two texts with the place where they differ.
fn show_apart(left: &str, right: &str) -> [String; 2] {
    let shared = left.chars().zip(right.chars()).take_while(|(a, b)| a == b).count();
    let from = if shared < LONGEST { 0 } else { shared - BEFORE };
    apart([cut(left, from), cut(right, from)])
}

/// Replaces the second of two equal texts: values may differ in a part that is not printed.
fn apart([left, right]: [String; 2]) -> [String; 2] {
    if left == right { [left, "another one that is printed the same".to_owned()] } else { [left, right] }
}

/// Returns whether two values without parts are equal to the bit; `None` if their type cannot say.
pub(super) fn plain_equal(left: &dyn PartialReflect, right: &dyn PartialReflect) -> Option<bool> {
    if let (Some(left), Some(right)) = (left.try_downcast_ref::<f32>(), right.try_downcast_ref::<f32>()) {
        return Some(left.to_bits() == right.to_bits() || (left.is_nan() && right.is_nan()));
    }
    if let (Some(left), Some(right)) = (left.try_downcast_ref::<f64>(), right.try_downcast_ref::<f64>()) {
        return Some(left.to_bits() == right.to_bits() || (left.is_nan() && right.is_nan()));
    }
    left.reflect_partial_eq(right).or_else(|| Some(left.reflect_hash()? == right.reflect_hash()?)).or_else(|| {
        let (left, right) = (format!("{left:?}"), format!("{right:?}"));
        // Text that reflection prints for a type without `Debug` says nothing about its value.
        (!left.starts_with("Reflect(")).then(|| left == right)
    })
}

/// Calls `hear` for every entity in a value, at any depth.
pub(super) fn each_entity(value: &dyn PartialReflect, hear: &mut dyn FnMut(Entity)) {
    if let Some(&entity) = value.try_downcast_ref::<Entity>() {
        return hear(entity);
    }
    match value.reflect_ref() {
        ReflectRef::Struct(parts) => parts.iter_fields().for_each(|(_, part)| each_entity(part, hear)),
        ReflectRef::TupleStruct(parts) => parts.iter_fields().for_each(|part| each_entity(part, hear)),
        ReflectRef::Tuple(parts) => parts.iter_fields().for_each(|part| each_entity(part, hear)),
        ReflectRef::List(parts) => parts.iter().for_each(|part| each_entity(part, hear)),
        ReflectRef::Array(parts) => parts.iter().for_each(|part| each_entity(part, hear)),
        ReflectRef::Set(parts) => parts.iter().for_each(|part| each_entity(part, hear)),
        ReflectRef::Enum(parts) => parts.iter_fields().for_each(|part| each_entity(part.value(), hear)),
        ReflectRef::Map(parts) => parts.iter().for_each(|(key, part)| {
            each_entity(key, hear);
            each_entity(part, hear);
        }),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{HashMap, HashSet};

    use bevy::prelude::*;

    use super::*;

    #[derive(Reflect, Clone)]
    struct Bag {
        weights: Vec<f32>,
        owner: Entity,
        prices: HashMap<String, u32>,
        kind: Kind,
    }

    #[derive(Reflect, Clone)]
    enum Kind {
        Empty,
        Full { of: u8 },
    }

    fn bag() -> Bag {
        let prices = HashMap::from([("ale".to_owned(), 3), ("bread".to_owned(), 2)]);
        let owner = World::new().spawn_empty().id();
        Bag { weights: vec![1.0, 2.0], owner, prices, kind: Kind::Full { of: 1 } }
    }

    /// Each entity corresponds to itself, except the placeholder, which has the same id on both sides.
    struct Crossed;

    impl EntityMatch for Crossed {
        fn is_same(&self, left: Entity, right: Entity) -> bool {
            left == right && left != Entity::PLACEHOLDER
        }
        fn describe(&self, left: Entity, right: Entity) -> [String; 2] {
            [left, right].map(|entity| format!("the entity {entity}"))
        }
    }

    fn first(left: &Bag, right: &Bag, right_may_hold_more: bool) -> Option<FieldDifference> {
        let mut incomparable = BTreeSet::new();
        let mut comparison =
            FieldComparison { entities: &Crossed, handles: true, right_may_hold_more, incomparable: &mut incomparable };
        comparison.first(left, right)
    }

    fn difference(change: impl FnOnce(&mut Bag)) -> FieldDifference {
        let mut other = bag();
        change(&mut other);
        first(&bag(), &other, false).expect("they differ")
    }

    #[test]
    fn equal_values_have_no_difference() {
        assert_eq!(first(&bag(), &bag(), false), None);
        let nan = |weight| Bag { weights: vec![weight], ..bag() };
        assert_eq!(first(&nan(f32::NAN), &nan(f32::NAN), false), None, "not a number on both sides");
    }

    #[test]
    fn the_path_leads_to_the_value() {
        let found = difference(|bag| bag.weights[1] = 2.5);
        assert_eq!((found.path.as_str(), found.left.as_str(), found.right.as_str()), (".weights[1]", "2.0", "2.5"));
        let found = difference(|bag| bag.kind = Kind::Full { of: 9 });
        assert_eq!((found.path.as_str(), found.left.as_str(), found.right.as_str()), (".kind.of", "1", "9"));
        assert_eq!(difference(|bag| bag.kind = Kind::Empty).path, ".kind");
        let found = difference(|bag| *bag.prices.get_mut("ale").expect("it is there") = 4);
        assert_eq!((found.path.as_str(), found.right.as_str()), (".prices[\"ale\"]", "4"));
    }

    #[test]
    fn different_entities_with_equal_ids_are_printed_differently() {
        let placed = Bag { owner: Entity::PLACEHOLDER, ..bag() };
        let found = first(&placed, &placed, false).expect("other entities");
        assert_eq!(found.path, ".owner");
        assert_eq!(found.left, format!("the entity {}", Entity::PLACEHOLDER));
        assert_eq!(found.right, "another one that is printed the same");
        assert!(found.value_type.ends_with("::Entity"), "{}", found.value_type);
    }

    #[test]
    fn sets_of_entities_hold_partners_whatever_their_ids_are() {
        /// Every entity corresponds to all others.
        struct Swapped;
        impl EntityMatch for Swapped {
            fn is_same(&self, left: Entity, right: Entity) -> bool {
                left != right
            }
            fn describe(&self, left: Entity, right: Entity) -> [String; 2] {
                [left.to_string(), right.to_string()]
            }
        }
        let mut comparison = FieldComparison {
            entities: &Swapped,
            handles: true,
            right_may_hold_more: false,
            incomparable: &mut BTreeSet::new(),
        };
        let [left, right] = [bag().owner, Entity::PLACEHOLDER].map(|entity| HashSet::from([entity]));
        assert_eq!(comparison.first(&left, &right), None);
        let found = comparison.first(&left, &left).expect("its partner is missing");
        assert_eq!((found.left.as_str(), found.right.as_str()), ("in it", "not in it"));
    }

    #[test]
    fn long_values_are_shown_where_they_differ() {
        let text = |end: &str| format!("{}{end}", "x".repeat(200));
        let [left, right] = show_apart(&text("1"), &text("2"));
        assert_eq!((left, right), (format!("…{}1", "x".repeat(32)), format!("…{}2", "x".repeat(32))));
        let [left, right] = show_apart("1", &text("2"));
        assert_eq!((left.as_str(), right), ("1", format!("{}…", "x".repeat(96))));
    }

    #[test]
    fn negative_zero_is_another_value() {
        let zero = |weight| Bag { weights: vec![weight], ..bag() };
        assert_eq!(first(&zero(0.0), &zero(-0.0), false).expect("other bits").path, ".weights[0]");
    }

    #[test]
    fn lists_may_grow_on_the_right_only_where_that_is_allowed() {
        let longer = Bag { weights: vec![1.0, 2.0, 3.0], ..bag() };
        assert_eq!(first(&bag(), &longer, false).expect("longer").path, ".weights.len()");
        assert_eq!(first(&bag(), &longer, true), None);
        assert_eq!(first(&longer, &bag(), true).expect("shorter").path, ".weights.len()");
    }
}
