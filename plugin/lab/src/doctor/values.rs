//! Reflected values: their text, their equality, and the entities that they name.

use bevy::{
    prelude::Entity,
    reflect::{PartialReflect, ReflectRef},
};

/// Most characters of a value in a report.
const LONGEST: usize = 96;

/// Returns a value as text, cut if it is long.
pub(super) fn show(value: &dyn PartialReflect) -> String {
    let text = format!("{value:?}");
    if text.chars().count() <= LONGEST {
        return text;
    }
    text.chars().take(LONGEST).chain("…".chars()).collect()
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
