//! Names of keys and buttons in text, taken from Bevy's own types.

use bevy::{
    prelude::*,
    reflect::{
        FromReflect, TypeInfo, Typed,
        enums::{DynamicEnum, DynamicVariant, VariantInfo},
    },
};

/// Returns the names of an enum's unit variants.
pub(super) fn unit_names<T: Typed>() -> Vec<&'static str> {
    match T::type_info() {
        TypeInfo::Enum(info) => info
            .iter()
            .filter(|variant| matches!(variant, VariantInfo::Unit(_)))
            .map(|variant| variant.name())
            .collect(),
        _ => Vec::new(),
    }
}

/// Returns the unit variant of this name, if there is one.
pub(super) fn unit_variant<T: Typed + FromReflect>(name: &str) -> Option<T> {
    unit_names::<T>().contains(&name).then(|| T::from_reflect(&DynamicEnum::new(name, DynamicVariant::Unit)))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_named_key_is_found_by_its_name() {
        let names = unit_names::<KeyCode>();
        assert!(names.len() > 150 && names.contains(&"ArrowLeft"), "{}", names.len());
        for name in names {
            let key: KeyCode = unit_variant(name).expect("a key");
            assert_eq!(format!("{key:?}"), name);
        }
        assert_eq!(unit_variant::<KeyCode>("Unidentified"), None);
        assert_eq!(unit_variant::<MouseButton>("Left"), Some(MouseButton::Left));
    }
}
