//! Numbers of a World by their paths: read for observations, and set for levels that draw them.

use bevy::{
    ecs::component::ComponentId,
    prelude::*,
    reflect::{PartialReflect, ReflectRef, TypeRegistration, TypeRegistry},
};
use thiserror::Error;

/// A number in the World: `Marker.Component.field` or `Resource.field`.
pub(crate) struct ReflectedPath {
    path: String,
    found: Option<Found>,
}

/// The fault of a path whose component has gone.
const GONE: &str = "leads to a component that is not there";

/// The meaning of a path in this World.
struct Found {
    /// The component or `Name` by which the entity is found.
    marker: Option<Marker>,
    /// The component that is read.
    component: ComponentId,
    reflect: ReflectComponent,
    /// The rest of the path, such as `.translation.x`.
    field: String,
}

enum Marker {
    Component(ComponentId),
    Name(String),
}

/// The error of a path without a number.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("the path `{path}` of `.observe_paths` {why}")]
pub struct PathError {
    /// The path.
    pub path: String,
    /// The reason.
    pub why: String,
}

impl ReflectedPath {
    pub(crate) fn new(path: &str) -> Self {
        Self { path: path.to_owned(), found: None }
    }

    /// Returns the path as it is written.
    pub(crate) fn text(&self) -> &str {
        &self.path
    }

    /// Returns the current number.
    ///
    /// # Errors
    ///
    /// [`PathError`] if the path has no value, several, or one that is not a number.
    pub(crate) fn read(&mut self, world: &mut World) -> Result<f32, PathError> {
        let path = self.path.clone();
        self.look_up(world).map_err(|why| PathError { path, why })
    }

    fn look_up(&mut self, world: &mut World) -> Result<f32, String> {
        let (entity, found) = self.find(world)?;
        let value = found.reflect.reflect(world.entity(entity)).ok_or(GONE)?;
        let at = value.reflect_path(found.field.as_str()).map_err(|error| format!("leads nowhere: {error}"))?;
        number(at).ok_or_else(|| format!("leads to a {}, which is not a number", at.reflect_short_type_path()))
    }

    /// Changes the number, and returns it as it was and as it is. A whole number is rounded, and none leaves its range.
    ///
    /// # Errors
    ///
    /// In words: the path has no value, several, or one that is not a number. A truth value is none.
    pub(crate) fn change(&mut self, world: &mut World, new: impl FnOnce(f64) -> f64) -> Result<(f64, f64), String> {
        let (entity, found) = self.find(world)?;
        let mut entity = world.entity_mut(entity);
        let mut value = found.reflect.reflect_mut(&mut entity).ok_or(GONE)?;
        let at = value.reflect_path_mut(found.field.as_str()).map_err(|error| format!("leads nowhere: {error}"))?;
        let name = at.reflect_short_type_path().to_owned();
        change_number(at, new).ok_or_else(|| format!("leads to a {name}, which is not a number"))
    }

    /// Returns the entity and what is read of it.
    fn find(&mut self, world: &mut World) -> Result<(Entity, &Found), String> {
        let found = match self.found.take() {
            Some(found) => found,
            None => Found::new(&self.path, world)?,
        };
        let found = &*self.found.insert(found);
        Ok((found.entity(world)?, found))
    }
}

impl Found {
    fn new(path: &str, world: &mut World) -> Result<Self, String> {
        let mut parts = path.splitn(3, '.');
        let first = parts.next().unwrap_or_default();
        let second = parts.next().unwrap_or_default();
        let rest = parts.next().map_or_else(String::new, |rest| format!(".{rest}"));
        if let Some((component, reflect)) = reflected(world, second) {
            let marker = match component_of(world, first) {
                Some(component) => Marker::Component(component),
                None => Marker::Name(first.to_owned()),
            };
            return Ok(Self { marker: Some(marker), component, reflect, field: rest });
        }
        let (component, reflect) = reflected(world, first).ok_or_else(|| {
            format!(
                "names neither `{second}` nor `{first}` as a component or resource that derives `Reflect` with \
                 `#[reflect(Component)]` or `#[reflect(Resource)]`"
            )
        })?;
        Ok(Self { marker: None, component, reflect, field: path[first.len()..].to_owned() })
    }

    /// Returns the one entity of the path.
    fn entity(&self, world: &World) -> Result<Entity, String> {
        let is_meant = |entity: &EntityRef| match &self.marker {
            None => true,
            Some(Marker::Component(marker)) => entity.contains_id(*marker),
            Some(Marker::Name(name)) => entity.get::<Name>().is_some_and(|found| found.as_str() == name),
        };
        let archetypes = world.archetypes().iter().filter(|archetype| archetype.contains(self.component));
        let entities = archetypes.flat_map(|archetype| archetype.entities().iter().map(|entity| entity.id()));
        let mut meant = entities.filter(|&entity| is_meant(&world.entity(entity)));
        match (meant.next(), meant.count()) {
            (Some(entity), 0) => Ok(entity),
            (Some(_), more) => Err(format!("means {} entities, and must mean one", more + 1)),
            (None, _) => Err("means no entity: nothing has these components, or this `Name`, now".to_owned()),
        }
    }
}

/// Returns a component or resource that can be read by reflection, by its short name.
fn reflected(world: &mut World, name: &str) -> Option<(ComponentId, ReflectComponent)> {
    let registry = world.get_resource::<AppTypeRegistry>()?.clone();
    let registry = registry.read();
    let reflect = registered(&registry, name)?.data::<ReflectComponent>()?.clone();
    Some((reflect.register_component(world), reflect))
}

/// Returns a component by its short name: from the type registry, or by the name that Bevy keeps with its feature
/// `debug`.
pub(crate) fn component_of(world: &World, name: &str) -> Option<ComponentId> {
    let components = world.components();
    let by_type = |may_be_ours: bool| {
        let registry = world.get_resource::<AppTypeRegistry>()?.read();
        let known =
            registered(&registry, name).filter(|known| may_be_ours || !is_ours(known.type_info().type_path()))?;
        components.get_id(known.type_id())
    };
    let is_named = |full: &str| full.rsplit("::").next() == Some(name) && !is_ours(full);
    let by_name = || components.iter_registered().find(|info| is_named(&info.name())).map(|info| info.id());
    by_type(false).or_else(by_name).or_else(|| by_type(true))
}

/// Returns a type by its short name. The game's types win over the plugin's.
fn registered<'a>(registry: &'a TypeRegistry, name: &str) -> Option<&'a TypeRegistration> {
    registry.get_with_short_type_path(name).or_else(|| {
        let named = registry.iter().filter(|known| known.type_info().type_path_table().short_path() == name);
        let mut of_game = named.filter(|known| !is_ours(known.type_info().type_path()));
        let first = of_game.next()?;
        of_game.next().is_none().then_some(first)
    })
}

/// Returns whether a type belongs to the plugin.
pub(crate) fn is_ours(path: &str) -> bool {
    ["bevy_playbot::", "playbot::", "playbot_harness::", "playbot_mutation::", "playbot_test::", "playbot_train::"]
        .iter()
        .any(|of| path.starts_with(of))
}

/// Converts a number of any kind, or a truth value as 0 or 1.
fn number(value: &dyn PartialReflect) -> Option<f32> {
    if !matches!(value.reflect_ref(), ReflectRef::Opaque(_)) {
        return None;
    }
    macro_rules! one_of {
        ($($kind:ty),*) => {
            $(if let Some(value) = value.try_downcast_ref::<$kind>() {
                return Some(*value as f32);
            })*
        };
    }
    one_of!(f32, f64, i8, i16, i32, i64, isize, u8, u16, u32, u64, usize);
    value.try_downcast_ref::<bool>().map(|value| f32::from(u8::from(*value)))
}

/// Changes a number of any kind, and returns it as it was and as it is.
fn change_number(value: &mut dyn PartialReflect, new: impl FnOnce(f64) -> f64) -> Option<(f64, f64)> {
    macro_rules! one_of {
        ($($kind:ty),*; $round:expr) => {
            $(if let Some(value) = value.try_downcast_mut::<$kind>() {
                let before = *value as f64;
                // A cast stops at the ends of the type's range.
                *value = $round(new(before)) as $kind;
                return Some((before, *value as f64));
            })*
        };
    }
    one_of!(f32, f64; |number: f64| number);
    one_of!(i8, i16, i32, i64, isize, u8, u16, u32, u64, usize; f64::round);
    None
}
