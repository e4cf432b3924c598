//! Copies of components and resources of any type: by a function of the game, reflection, `Clone`, or their bytes.
//!
//! A game's types are often private to it, so the plugin sees no more of them than Bevy does: a layout, a function that
//! drops a value, the function that clones an entity's component, and what is registered for reflection. Bytes alone are
//! a copy of small numbers only: see [`is_plain`]. Each block of unsafe code in this file moves or copies a value of a
//! type that Bevy knows by its [`ComponentId`].
#![expect(unsafe_code, reason = "types that are private to a game are copied through pointers, as Bevy does")]

#[cfg(any(feature = "bevy_rapier2d", feature = "bevy_rapier3d"))]
use super::forget;
use bevy::{
    ecs::{
        change_detection::{MaybeLocation, Tick},
        component::{ComponentCloneBehavior, ComponentId, ComponentInfo, Mutable},
        entity::{EntityCloner, EntityHashMap, EntityMapper},
        reflect::ReflectComponent,
    },
    prelude::*,
    ptr::{OwningPtr, Ptr},
    reflect::ReflectFromPtr,
};
use std::{
    alloc::{Layout, dealloc},
    any::{Any, TypeId},
    collections::BTreeMap,
    mem::{ManuallyDrop, MaybeUninit},
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    ptr::{self, NonNull},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
#[cfg(any(feature = "bevy_rapier2d", feature = "bevy_rapier3d"))]
use std::{collections::HashMap, mem};

/// Entities of a saved state, and those that take their place.
pub(super) type EntityMap = EntityHashMap<Entity>;

/// Makes the parts of a version of rapier. Its contexts name the entities of their bodies in maps of their own, and in the
/// user data of bodies and colliders.
#[cfg(any(feature = "bevy_rapier2d", feature = "bevy_rapier3d"))]
macro_rules! rapier_parts {
    ($engine:ident) => {{
        use $engine::plugin::context::{
            RapierContextColliders as Colliders, RapierContextJoints as Joints, RapierContextSimulation as Simulation,
            RapierRigidBodySet as Bodies,
        };
        use $engine::rapier::prelude::PhysicsPipeline;
        [
            Part::new(Colliders::clone, |now: &mut Colliders, saved: &Colliders, map: &mut EntityMap| {
                *now = saved.clone();
                let all: Vec<_> = now.colliders.iter().map(|(handle, collider)| (handle, collider.user_data)).collect();
                for (handle, data) in all {
                    // Asking for a collider marks it as changed.
                    if let Some(data) = other_data(data, map)
                        && let Some(collider) = now.colliders.get_mut(handle)
                    {
                        collider.user_data = data;
                    }
                }
                put_others(now, Colliders::entity2collider, map);
            }),
            Part::new(Bodies::clone, |now: &mut Bodies, saved: &Bodies, map: &mut EntityMap| {
                *now = saved.clone();
                let all: Vec<_> = now.bodies.iter().map(|(handle, body)| (handle, body.user_data)).collect();
                for (handle, data) in all {
                    if let Some(data) = other_data(data, map)
                        && let Some(body) = now.bodies.get_mut(handle)
                    {
                        body.user_data = data;
                    }
                }
                put_others(now, Bodies::entity2body, map);
            }),
            Part::new(Joints::clone, |now: &mut Joints, saved: &Joints, map: &mut EntityMap| {
                *now = saved.clone();
                put_others(now, Joints::entity2impulse_joint, map);
                put_others(now, Joints::entity2multibody_joint, map);
            }),
            // The pipeline is memory to work in, which fits the sets of before. The rest is empty between two frames.
            Part::new(
                |now: &Simulation| {
                    let phases = (now.broad_phase.clone(), now.narrow_phase.clone());
                    (now.islands.clone(), phases, now.ccd_solver.clone(), now.integration_parameters)
                },
                |now: &mut Simulation, saved, _: &mut EntityMap| {
                    (now.islands, (now.broad_phase, now.narrow_phase), now.ccd_solver, now.integration_parameters) =
                        saved.clone();
                    now.pipeline = PhysicsPipeline::new();
                },
            ),
        ]
    }};
}

/// Returns the user data of a body that belongs to another entity now.
#[cfg(any(feature = "bevy_rapier2d", feature = "bevy_rapier3d"))]
fn other_data(data: u128, map: &mut EntityMap) -> Option<u128> {
    let entity = Entity::try_from_bits(u64::try_from(data).ok()?)?;
    let other = map.get_mapped(entity);
    (other != entity).then(|| other.to_bits().into())
}

/// Puts other entities into a private map of a value that shows it read-only.
#[cfg(any(feature = "bevy_rapier2d", feature = "bevy_rapier3d"))]
fn put_others<T, V>(owner: &mut T, show: impl FnOnce(&T) -> &HashMap<Entity, V>, map: &mut EntityMap) {
    let offset = ptr::from_ref(show(owner)).addr().wrapping_sub(ptr::from_ref(owner).addr());
    if offset.saturating_add(size_of::<HashMap<Entity, V>>()) > size_of::<T>() {
        return;
    }
    // SAFETY: the map lies within the value, at this offset, and the value is borrowed mutably.
    let entities = unsafe { &mut *ptr::from_mut(owner).byte_add(offset).cast::<HashMap<Entity, V>>() };
    *entities = mem::take(entities).into_iter().map(|(entity, value)| (map.get_mapped(entity), value)).collect();
}

/// Drops the messages of physics engines, which they keep out of Bevy's registry.
#[cfg_attr(not(any(feature = "bevy_rapier2d", feature = "bevy_rapier3d")), expect(unused_variables))]
pub(super) fn forget_engines(world: &mut World) {
    #[cfg(any(feature = "bevy_rapier2d", feature = "bevy_rapier3d"))]
    macro_rules! forget_all {
        ($engine:ident) => {{
            use $engine::prelude::{CollisionEvent, ContactForceEvent, MassModifiedEvent};
            forget::<CollisionEvent>(world);
            forget::<ContactForceEvent>(world);
            forget::<MassModifiedEvent>(world);
        }};
    }
    #[cfg(feature = "bevy_rapier2d")]
    forget_all!(bevy_rapier2d);
    #[cfg(feature = "bevy_rapier3d")]
    forget_all!(bevy_rapier3d);
}

/// The state of a part.
type AnyState = Box<dyn Any + Send + Sync>;

/// How a game saves and loads one type of component or resource, in place of the plugin.
#[derive(Clone)]
pub(crate) struct Part {
    type_id: TypeId,
    save: Arc<dyn Fn(&World, Entity) -> Option<AnyState> + Send + Sync>,
    load: Arc<dyn Fn(&mut World, Entity, &dyn Any, &mut EntityMap) + Send + Sync>,
}

impl Part {
    /// Creates the part of a type. `load` also gets the entities that take the place of others.
    pub(super) fn new<T: Component<Mutability = Mutable>, State: Any + Send + Sync>(
        save: impl Fn(&T) -> State + Send + Sync + 'static,
        load: impl Fn(&mut T, &State, &mut EntityMap) + Send + Sync + 'static,
    ) -> Self {
        Self {
            type_id: TypeId::of::<T>(),
            save: Arc::new(move |world, entity| {
                world.get::<T>(entity).map(|value| -> AnyState { Box::new(save(value)) })
            }),
            load: Arc::new(move |world, entity, state, map| {
                if let (Some(mut value), Some(state)) = (world.get_mut::<T>(entity), state.downcast_ref()) {
                    load(&mut value, state, map);
                }
            }),
        }
    }

    /// Returns the parts of physics engines that this build knows.
    fn of_engines() -> Vec<Self> {
        let engines: &[[Self; 4]] = &[
            #[cfg(feature = "bevy_rapier2d")]
            rapier_parts!(bevy_rapier2d),
            #[cfg(feature = "bevy_rapier3d")]
            rapier_parts!(bevy_rapier3d),
        ];
        engines.concat()
    }
}

/// What a type is to a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    /// State of the plugin, or made anew in each frame. It is left alone.
    Skipped,
    /// A type of Bevy's. It is left alone if it cannot be copied.
    Bevy,
    /// A type of the game or of one of its libraries.
    Game,
    /// Messages of the game.
    Messages,
}

/// How values of one type are copied.
pub(super) struct Way {
    pub(super) id: ComponentId,
    pub(super) type_id: TypeId,
    /// Its whole path.
    pub(super) name: String,
    pub(super) owner: Owner,
    /// Whether its values differ between two starts of a level, because they are numbers of an engine.
    pub(super) is_engines: bool,
    layout: Layout,
    part: Option<Part>,
    reflect: Option<(ReflectFromPtr, Option<ReflectComponent>)>,
    has_clone: bool,
    is_plain: bool,
    /// Whether a resource of this type existed when this was found out.
    is_resource: bool,
}

/// The ways of a World.
pub(super) struct Ways {
    parts: Vec<Part>,
    /// Made for the first clone.
    cloner: Option<SharedCloner>,
    /// Returns what the type of a name is. It also gets whether there is such a resource.
    owner: fn(&str, bool) -> Owner,
    by_id: Vec<Option<Arc<Way>>>,
}

impl Ways {
    /// Creates the ways of a game with these parts.
    pub(super) fn new(parts: &[Part]) -> Self {
        let parts = [parts, &Part::of_engines()[..]].concat();
        Self { parts, cloner: None, owner, by_id: Vec::new() }
    }

    /// Returns the way of a type; `None` for one that is left alone.
    pub(super) fn of(&mut self, world: &World, id: ComponentId) -> Option<Arc<Way>> {
        if self.by_id.len() <= id.index() {
            self.by_id.resize(id.index() + 1, None);
        }
        let way = &mut self.by_id[id.index()];
        // Another World may name a resource before there is one here.
        let is_resource = world.resource_entities().get(id).is_some();
        if way.as_ref().is_none_or(|way| is_resource && !way.is_resource) {
            *way = Way::of(world, id, &self.parts, self.owner).map(Arc::new);
        }
        way.clone().filter(|way| way.owner != Owner::Skipped)
    }

    /// Returns the way of a type that this World knows.
    pub(super) fn of_type(&mut self, world: &World, of: TypeId) -> Option<Arc<Way>> {
        let id = world.components().get_valid_id(of)?;
        self.of(world, id)
    }

    /// Copies the value of an entity; `None` if it has none, or if its type cannot be copied.
    pub(super) fn copy(&mut self, way: &Way, world: &World, entity: Entity) -> Option<Value> {
        way.copy(world, entity, &mut self.cloner)
    }
}

/// A copy of a value.
pub(super) enum Value {
    Part(AnyState),
    Reflected(Box<dyn Reflect>),
    Cloned(Cloned),
    Bytes(Box<[Block]>),
}

/// Bytes of a value, as well aligned as all types but very few.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct Block([MaybeUninit<u8>; 16]);

/// Returns the bytes of a value.
///
/// # Safety
///
/// The pointer is valid for reads of `size` bytes.
unsafe fn blocks(from: *const u8, size: usize) -> Box<[Block]> {
    let mut blocks = vec![Block([MaybeUninit::uninit(); 16]); size.div_ceil(size_of::<Block>())].into_boxed_slice();
    // SAFETY: the blocks have room for the bytes, and are not read as anything but bytes that may be uninitialised.
    unsafe { ptr::copy_nonoverlapping(from, blocks.as_mut_ptr().cast::<u8>(), size) };
    blocks
}

/// Returns whether the bytes of a value are a copy of it, although its type has no `Clone`.
///
/// A value that needs no drop may still be the only one of its kind, like a mutable reference or a box that is never
/// dropped. Only pointers are aligned like pointers, so a type of smaller alignment has none. Hooks could free what a
/// number stands for. What remains are packed structs with such a reference, and numbers that unsafe code trusts to be
/// the only ones.
fn is_plain(info: &ComponentInfo) -> bool {
    let (mut hooks, is_small) = (info.hooks().clone(), info.layout().align() < align_of::<*const ()>());
    let has_none = hooks.try_on_add(|_, _| {}).is_some()
        && hooks.try_on_insert(|_, _| {}).is_some()
        && hooks.try_on_discard(|_, _| {}).is_some()
        && hooks.try_on_remove(|_, _| {}).is_some()
        && hooks.try_on_despawn(|_, _| {}).is_some();
    info.drop().is_none() && info.is_send_and_sync() && is_small && has_none
}

impl Way {
    /// Returns the way for a type; `None` for one without a Rust type, and for one that is not registered.
    fn of(world: &World, id: ComponentId, parts: &[Part], owner: fn(&str, bool) -> Owner) -> Option<Self> {
        let info = world.components().get_info(id)?;
        let type_id = info.type_id()?;
        let name = info.name().to_string();
        let registry = world.get_resource::<AppTypeRegistry>().map(|registry| registry.read());
        let registration = registry.as_ref().and_then(|registry| registry.get(type_id));
        let from_ptr = registration.and_then(|of| of.data::<ReflectFromPtr>().cloned());
        let from_ptr = from_ptr.filter(|from_ptr| from_ptr.type_id() == type_id);
        let component = registration.and_then(|of| of.data::<ReflectComponent>().cloned());
        let is_rapiers = name.starts_with("bevy_rapier2d::") || name.starts_with("bevy_rapier3d::");
        let ends = ["Handle", "ContextSimulation", "ContextColliders", "ContextJoints", "RigidBodySet"];
        let is_resource = world.resource_entities().get(id).is_some();
        let owner = owner(&name, is_resource);
        Some(Self {
            id,
            type_id,
            owner,
            is_engines: is_rapiers && ends.iter().any(|end| name.ends_with(end)),
            layout: info.layout(),
            part: parts.iter().find(|part| part.type_id == type_id).cloned(),
            reflect: from_ptr.map(|from_ptr| (from_ptr, component)),
            // Bevy clones some of its own types together with others. A relationship is two components.
            has_clone: matches!(info.clone_behavior(), ComponentCloneBehavior::Custom(_))
                && owner == Owner::Game
                && info.relationship_accessor().is_none(),
            is_plain: is_plain(info),
            is_resource,
            name,
        })
    }

    /// Copies the value of an entity; `None` if it has none, or if its type cannot be copied.
    fn copy(&self, world: &World, entity: Entity, cloner: &mut Option<SharedCloner>) -> Option<Value> {
        if let Some(part) = &self.part {
            return (part.save)(world, entity).map(Value::Part);
        }
        let value = world.get_by_id(entity, self.id)?;
        if let Some((from_ptr, _)) = &self.reflect {
            // SAFETY: the registration is that of the component's type.
            let reflected = unsafe { from_ptr.as_reflect(value) };
            if let Ok(copy) = reflected.reflect_clone() {
                return Some(Value::Reflected(copy));
            }
        }
        if self.has_clone {
            let cloner = cloner.get_or_insert_with(SharedCloner::new);
            // SAFETY: the value is one of this component, and stays where it is meanwhile.
            if let Some(cloned) = unsafe { cloner.copy(world, self, value) } {
                return Some(Value::Cloned(cloned));
            }
        }
        // SAFETY: the World holds a value of this layout there.
        self.is_plain.then(|| Value::Bytes(unsafe { blocks(value.as_ptr(), self.layout.size()) }))
    }

    /// Writes a copy over the value of an entity that has one, as if it was changed at this tick.
    pub(super) fn write(&self, world: &mut World, entity: Entity, value: &Value, map: &mut EntityMap, changed: Tick) {
        if let (Value::Part(state), Some(part)) = (value, &self.part) {
            (part.load)(world, entity, &**state, map);
        }
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        // SAFETY: Bevy's hooks of immutable components are for relations between entities. The whole state is written, so
        // both sides of a relation are.
        let Ok(mut slot) = (unsafe { entity.get_mut_assume_mutable_by_id(self.id) }) else { return };
        let place = slot.bypass_change_detection();
        match value {
            Value::Part(_) => {}
            Value::Reflected(copy) => {
                if let (Some((from_ptr, _)), Some(copy)) = (&self.reflect, self.mapped(&**copy, map)) {
                    // SAFETY: the registration is that of the component's type.
                    let reflected = unsafe { from_ptr.as_reflect_mut(place.reborrow()) };
                    // Both have the same type.
                    let _ = reflected.set(copy);
                }
            }
            // SAFETY: the place holds a value of this component, which the store drops.
            Value::Cloned(cloned) => unsafe { cloned.swap_into(place.as_ptr(), self.layout.size(), map) },
            // SAFETY: the value has this layout, and the old one needs no drop.
            Value::Bytes(bytes) => unsafe {
                ptr::copy_nonoverlapping(bytes.as_ptr().cast::<u8>(), place.as_ptr(), self.layout.size());
            },
        }
        slot.set_last_changed(changed);
    }

    /// Returns a value for an entity that has none yet; `None` for a part, which needs one to write into.
    pub(super) fn make(&self, value: &Value, map: &mut EntityMap) -> Option<Made> {
        if self.layout.align() > align_of::<Block>() {
            return None;
        }
        let bytes = match value {
            Value::Part(_) => return None,
            Value::Reflected(copy) => {
                let copy = self.mapped(&**copy, map)?;
                // A game's own reflection may return a copy of any type.
                let any: &dyn Any = &*copy;
                if any.type_id() != self.type_id {
                    return None;
                }
                let (copy, size) = (Box::into_raw(copy).cast::<u8>(), self.layout.size());
                // SAFETY: the box holds a value of this type. It is moved out, and only its memory is freed.
                unsafe {
                    let bytes = blocks(copy, size);
                    if size > 0 {
                        dealloc(copy, self.layout);
                    }
                    bytes
                }
            }
            // SAFETY: the clone is moved out, and the store never drops it.
            Value::Cloned(cloned) => unsafe { cloned.take(self.layout.size(), map)? },
            Value::Bytes(bytes) => bytes.clone(),
        };
        Some(Made { id: self.id, bytes })
    }

    /// Returns a copy of a copy, with other entities in their places.
    fn mapped(&self, copy: &dyn Reflect, map: &mut EntityMap) -> Option<Box<dyn Reflect>> {
        let mut copy = copy.reflect_clone().ok()?;
        if let Some((_, Some(component))) = &self.reflect {
            component.map_entities(&mut *copy, map);
        }
        Some(copy)
    }
}

/// A value that its entity does not have yet. It is lost, and not dropped, if it is not inserted.
pub(super) struct Made {
    id: ComponentId,
    bytes: Box<[Block]>,
}

impl Made {
    fn ptr(&mut self) -> OwningPtr<'_> {
        // SAFETY: the bytes are a value of the component, which the pointer owns from here on.
        unsafe { OwningPtr::new(NonNull::from(&mut *self.bytes).cast::<u8>()) }
    }

    /// Inserts the values into an entity of the World, with all hooks and observers.
    pub(super) fn insert(mut all: Vec<Self>, world: &mut World, entity: Entity) {
        all.sort_by_key(|made| made.id);
        let ids: Vec<ComponentId> = all.iter().map(|made| made.id).collect();
        if let (Ok(mut entity), false) = (world.get_entity_mut(entity), ids.is_empty()) {
            // SAFETY: each value is one of its component, in the World that it was made for.
            unsafe { entity.insert_by_ids(&ids, all.iter_mut().map(Self::ptr)) };
        }
    }

    /// Inserts the value as a resource.
    pub(super) fn insert_resource(mut self, world: &mut World) {
        let id = self.id;
        // SAFETY: the value is one of this resource, in the World that it was made for.
        unsafe { world.insert_resource_by_id(id, self.ptr(), MaybeLocation::caller()) };
    }
}

// Types that have `Clone`, but no reflection.

/// A World of its own in which Bevy's cloner of entities clones single values. It has no hooks and no observers.
///
/// Each type has one entity to which a value of the game moves while it is cloned. Its bits are left behind there, so
/// the World is never dropped, which keeps a little memory for each World of the game. Clones are dropped with
/// [`Cloned`].
struct Cloner {
    world: ManuallyDrop<World>,
    /// Id of each type here, and the entity for values of the game.
    types: BTreeMap<TypeId, (ComponentId, Entity)>,
}

/// A [`Cloner`] that its clones keep.
#[derive(Clone)]
struct SharedCloner(Arc<Mutex<Cloner>>);

/// A value in the World of a [`Cloner`].
pub(super) struct Cloned {
    cloner: SharedCloner,
    entity: Entity,
    id: ComponentId,
}

/// Gives the cloner of entities its target first, and then other entities in place of those of the value.
struct TargetFirst<'a> {
    target: Option<Entity>,
    map: &'a mut EntityMap,
}

impl EntityMapper for TargetFirst<'_> {
    fn get_mapped(&mut self, source: Entity) -> Entity {
        self.target.take().unwrap_or_else(|| self.map.get_mapped(source))
    }

    fn set_mapped(&mut self, source: Entity, target: Entity) {
        self.map.set_mapped(source, target);
    }
}

impl SharedCloner {
    fn new() -> Self {
        Self(Arc::new(Mutex::new(Cloner { world: ManuallyDrop::new(World::new()), types: BTreeMap::new() })))
    }

    fn lock(&self) -> MutexGuard<'_, Cloner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Clones a value of a World.
    ///
    /// # Safety
    ///
    /// The pointer is to a value of the component in this World, which stays there, and which nothing else uses meanwhile.
    unsafe fn copy(&self, world: &World, way: &Way, value: Ptr) -> Option<Cloned> {
        let mut cloner = self.lock();
        let is_known = cloner.types.contains_key(&way.type_id);
        if !is_known {
            let descriptor = world.components().get_descriptor(way.id)?.into_owned();
            let id = cloner.world.register_component_with_descriptor(descriptor);
            let mut source = cloner.world.spawn_empty();
            // SAFETY: the value has this type. Its bits are never dropped here.
            unsafe { source.insert_by_id(id, OwningPtr::new(NonNull::new(value.as_ptr())?)) };
            let source = source.id();
            cloner.types.insert(way.type_id, (id, source));
        }
        // SAFETY: the value has this type.
        let (id, entity) = unsafe { cloner.clone_guest(way.type_id, value.as_ptr())? };
        drop(cloner);
        Some(Cloned { cloner: self.clone(), entity, id })
    }
}

impl Cloner {
    /// Clones the value at this place into a new entity. Meanwhile the value itself is here, and moves back then: a
    /// `Clone` that changes its source, for instance behind a lock, changes the only one that there is.
    ///
    /// # Safety
    ///
    /// The place holds a value of this type, which nothing else uses.
    unsafe fn clone_guest(&mut self, of: TypeId, value: *mut u8) -> Option<(ComponentId, Entity)> {
        let (id, guest) = *self.types.get(&of)?;
        let size = self.world.components().get_info(id)?.layout().size();
        let place = self.place(guest, id)?;
        // SAFETY: both places have the layout of the type, and the bits that were here need no drop.
        unsafe { ptr::copy_nonoverlapping(value, place, size) };
        let cloned = catch_unwind(AssertUnwindSafe(|| self.clone_entity(guest, id, &mut EntityMap::default())));
        // The new entity may have moved this one.
        let place = self.place(guest, id)?;
        // SAFETY: as above. The bits that are left here are not used as a value.
        unsafe { ptr::copy_nonoverlapping(place, value, size) };
        Some((id, cloned.unwrap_or_else(|panic| resume_unwind(panic))?))
    }

    /// Clones the value of an entity into a new one.
    fn clone_entity(&mut self, source: Entity, id: ComponentId, map: &mut EntityMap) -> Option<Entity> {
        let target = self.world.spawn_empty().id();
        let mut mapper = TargetFirst { target: Some(target), map };
        EntityCloner::build_opt_out(&mut self.world).finish().clone_entity_mapped(&mut self.world, source, &mut mapper);
        if self.world.get_by_id(target, id).is_none() {
            self.world.despawn(target);
            return None;
        }
        Some(target)
    }

    /// Returns the place of a value.
    fn place(&mut self, entity: Entity, id: ComponentId) -> Option<*mut u8> {
        let mut entity = self.world.get_entity_mut(entity).ok()?;
        // SAFETY: there are no hooks here.
        let mut slot = unsafe { entity.get_mut_assume_mutable_by_id(id) }.ok()?;
        Some(slot.bypass_change_detection().as_ptr())
    }

    fn despawn(&mut self, entity: Entity) {
        self.world.despawn(entity);
        self.world.clear_trackers();
    }
}

impl Cloned {
    /// Clones the value once more, and returns the new one with its place.
    fn again(&self, cloner: &mut Cloner, map: &mut EntityMap) -> Option<(Entity, *mut u8)> {
        let entity = cloner.clone_entity(self.entity, self.id, map)?;
        let place = cloner.place(entity, self.id)?;
        Some((entity, place))
    }

    /// Writes a clone over a value, which is dropped.
    ///
    /// # Safety
    ///
    /// The place holds a value of this type and size.
    unsafe fn swap_into(&self, value: *mut u8, size: usize, map: &mut EntityMap) {
        let mut cloner = self.cloner.lock();
        if let Some((entity, place)) = self.again(&mut cloner, map) {
            // SAFETY: both places hold a value of this type, in two Worlds.
            unsafe { ptr::swap_nonoverlapping(place, value, size) };
            cloner.despawn(entity);
        }
    }

    /// Moves a clone out of the cloner's World, where its bits stay and are never dropped.
    ///
    /// # Safety
    ///
    /// Values of this type have this size.
    unsafe fn take(&self, size: usize, map: &mut EntityMap) -> Option<Box<[Block]>> {
        let mut cloner = self.cloner.lock();
        let (_, place) = self.again(&mut cloner, map)?;
        // SAFETY: the place holds a value of this size.
        Some(unsafe { blocks(place, size) })
    }
}

impl Drop for Cloned {
    fn drop(&mut self) {
        self.cloner.lock().despawn(self.entity);
    }
}

// Whose types they are.

/// Crates of Bevy, without the `bevy_` of their names.
const BEVY: &str = "a11y animation anti_alias app asset audio camera clipboard color core_pipeline dev_tools diagnostic ecs \
                    feathers gilrs gizmos gizmos_render gltf image input input_focus internal light log material math mesh \
                    pbr picking platform post_process ptr reflect render scene shader sprite sprite_render state tasks text \
                    time transform ui ui_render ui_widgets utils window winit world_serialization";

/// Beginnings of types that belong to the plugin, or that frames make anew.
const SKIPPED: [&str; 7] = [
    "bevy_playbot::",
    "playbot::",
    "playbot_harness::",
    "bevy_render::",
    "bevy_camera::visibility::Visible",
    "bevy_text::pipeline::",
    "bevy_ui::ui_node::Computed",
];

/// Resources of input managers, which they fill in each frame from the keys.
const INPUTS: [&str; 2] = ["leafwing_input_manager::", "bevy_enhanced_input::"];

fn is_of_bevy(name: &str) -> bool {
    let package = name.strip_prefix("bevy_").and_then(|rest| rest.split("::").next());
    package.is_some_and(|package| BEVY.split(' ').any(|other| other == package))
}

/// Returns the type of the messages in a queue, by Bevy's name of it; `None` for any other type.
pub(crate) fn queued(name: &str) -> Option<&str> {
    name.strip_prefix("bevy_ecs::message::messages::Messages<")?.strip_suffix('>')
}

/// Returns what the type of this name is.
fn owner(name: &str, is_resource: bool) -> Owner {
    let begins = |beginnings: &[&str]| beginnings.iter().any(|beginning| name.starts_with(beginning));
    // The parameter of a generic type decides for these three.
    if let Some(message) = queued(name) {
        let is_of_game = !is_of_bevy(message) && !SKIPPED.iter().any(|beginning| message.starts_with(beginning));
        return if is_of_game { Owner::Messages } else { Owner::Skipped };
    }
    if let Some(clock) = name.strip_prefix("bevy_time::time::Time<") {
        return if is_of_bevy(clock) || clock.starts_with("()") { Owner::Skipped } else { Owner::Game };
    }
    match is_resource {
        true if name.starts_with("bevy_state::") => Owner::Game,
        true if is_of_bevy(name) || begins(&INPUTS) || begins(&SKIPPED) => Owner::Skipped,
        false if begins(&SKIPPED) => Owner::Skipped,
        false if is_of_bevy(name) => Owner::Bevy,
        _ => Owner::Game,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::ecs::{lifecycle::HookContext, world::DeferredWorld};
    use bevy_playbot::engine::panics;

    #[test]
    fn types_belong_to_bevy_to_the_game_or_to_the_plugin() {
        let resource = |name| owner(name, true);
        let component = |name| owner(name, false);
        assert_eq!(component("bevy_transform::components::transform::Transform"), Owner::Bevy);
        assert_eq!(component("bevy_rapier2d::plugin::context::RapierRigidBodySet"), Owner::Game);
        assert_eq!(component("leafwing_input_manager::action_state::ActionState<game::Move>"), Owner::Game);
        assert_eq!(resource("leafwing_input_manager::user_input::updating::CentralInputStore"), Owner::Skipped);
        assert_eq!(resource("playbot_harness::foreign::runtime::LevelSeed"), Owner::Skipped);
        assert_eq!(resource("bevy_asset::server::AssetServer"), Owner::Skipped);
        assert_eq!(resource("game::Score"), Owner::Game);
    }

    #[test]
    fn the_parameter_of_messages_states_and_clocks_decides() {
        let resource = |name| owner(name, true);
        assert_eq!(resource("bevy_ecs::message::messages::Messages<game::Hit>"), Owner::Messages);
        assert_eq!(resource("bevy_ecs::message::messages::Messages<bevy_input::keyboard::Key>"), Owner::Skipped);
        assert_eq!(resource("bevy_state::state::resources::State<game::Screen>"), Owner::Game);
        assert_eq!(resource("bevy_time::time::Time<game::Slow>"), Owner::Game);
        assert_eq!(resource("bevy_time::time::Time"), Owner::Skipped);
        assert_eq!(resource("bevy_time::time::Time<bevy_time::virt::Virtual>"), Owner::Skipped);
    }

    /// Has `Clone` alone, and counts its values.
    #[derive(Component, Clone)]
    struct Held(Arc<()>);

    #[derive(Component, Clone)]
    struct Aims(#[entities] Entity, Vec<u8>);

    /// Neither `Clone` nor reflection.
    #[derive(Component)]
    struct Legs {
        steps: u32,
    }

    /// Returns the ways of a game whose types are those of these tests.
    fn ways() -> Ways {
        Ways { owner: |_, _| Owner::Game, ..Ways::new(&[]) }
    }

    /// Returns the way of the only component of an entity.
    fn way(ways: &mut Ways, world: &World, entity: Entity) -> Arc<Way> {
        let id = world.entity(entity).archetype().components()[0];
        ways.of(world, id).expect("a type of the game")
    }

    #[test]
    fn clones_are_dropped_once() {
        let (mut world, mut ways, mut map) = (World::new(), ways(), EntityMap::default());
        let count = Arc::new(());
        let first = world.spawn(Held(count.clone())).id();
        let second = world.spawn(Held(Arc::new(()))).id();
        let third = world.spawn_empty().id();
        let way = way(&mut ways, &world, first);
        let value = ways.copy(&way, &world, first).expect("it has `Clone`");
        assert_eq!(Arc::strong_count(&count), 3);
        for _ in 0..3 {
            way.write(&mut world, second, &value, &mut map, Tick::new(1));
            assert_eq!(Arc::strong_count(&count), 4);
        }
        let made = way.make(&value, &mut map).expect("a clone");
        Made::insert(vec![made], &mut world, third);
        assert!(Arc::ptr_eq(&world.get::<Held>(third).expect("it was inserted").0, &count));
        assert_eq!(Arc::strong_count(&count), 5);
        drop(value);
        assert_eq!(Arc::strong_count(&count), 4);
        for (entity, left) in [(first, 3), (second, 2), (third, 1)] {
            world.despawn(entity);
            assert_eq!(Arc::strong_count(&count), left);
        }
    }

    #[test]
    fn clones_name_the_entities_that_take_the_place_of_others() {
        let (mut world, mut ways) = (World::new(), ways());
        let (old, new) = (world.spawn_empty().id(), world.spawn_empty().id());
        let aiming = world.spawn(Aims(old, vec![1, 2])).id();
        let way = way(&mut ways, &world, aiming);
        let value = ways.copy(&way, &world, aiming).expect("it has `Clone`");
        let aims = |world: &World| world.get::<Aims>(aiming).map(|aims| (aims.0, aims.1.clone()));
        world.entity_mut(aiming).insert(Aims(new, Vec::new()));
        way.write(&mut world, aiming, &value, &mut EntityMap::default(), Tick::new(1));
        assert_eq!(aims(&world), Some((old, vec![1, 2])));
        way.write(&mut world, aiming, &value, &mut EntityMap::from_iter([(old, new)]), Tick::new(1));
        assert_eq!(aims(&world), Some((new, vec![1, 2])));
    }

    /// Its `Clone` lets the value itself grow, behind a lock.
    #[derive(Component)]
    struct Growing(Mutex<Vec<u8>>);

    impl Clone for Growing {
        fn clone(&self) -> Self {
            let mut grown = self.0.lock().expect("nothing panics");
            grown.extend([0; 100]);
            Self(Mutex::new(grown.clone()))
        }
    }

    #[test]
    fn a_clone_that_changes_its_source_changes_the_value_itself() {
        let (mut world, mut ways, mut map) = (World::new(), ways(), EntityMap::default());
        let entity = world.spawn(Growing(Mutex::new(vec![7]))).id();
        let way = way(&mut ways, &world, entity);
        let len = |world: &World| world.get::<Growing>(entity).map(|all| all.0.lock().expect("nothing panics").len());
        let values = [101, 201, 301].map(|grown| {
            let value = ways.copy(&way, &world, entity).expect("it has `Clone`");
            assert_eq!(len(&world), Some(grown));
            value
        });
        way.write(&mut world, entity, &values[0], &mut map, Tick::new(1));
        // Cloned once more.
        assert_eq!(len(&world), Some(201));
    }

    /// Its `Clone` panics.
    #[derive(Component)]
    struct Fragile(Arc<()>);

    impl Clone for Fragile {
        fn clone(&self) -> Self {
            panic!("{} of it break", Arc::strong_count(&self.0))
        }
    }

    #[test]
    fn a_value_whose_clone_panics_stays_where_it_is() {
        let (mut world, mut ways) = (World::new(), ways());
        let count = Arc::new(());
        let entity = world.spawn(Fragile(count.clone())).id();
        let way = way(&mut ways, &world, entity);
        let copied = panics::hear(|| ways.copy(&way, &world, entity).is_some());
        assert!(copied.is_err_and(|words| words.contains("2 of it break")));
        world.despawn(entity);
        drop((world, ways));
        assert_eq!(Arc::strong_count(&count), 1);
    }

    #[test]
    fn a_world_for_clones_is_made_for_the_first_one() {
        let (mut world, mut ways) = (World::new(), ways());
        let (number, held) = (world.spawn(Legs { steps: 7 }).id(), world.spawn(Held(Arc::new(()))).id());
        let (of_number, of_held) = (way(&mut ways, &world, number), way(&mut ways, &world, held));
        assert!(ways.copy(&of_number, &world, number).is_some() && ways.cloner.is_none());
        assert!(ways.copy(&of_held, &world, held).is_some() && ways.cloner.is_some());
    }

    /// May be the only one of its kind, although it needs no drop.
    #[derive(Component)]
    struct Borrows(&'static mut u32);

    #[derive(Component)]
    struct Kept(ManuallyDrop<Box<u32>>);

    /// A number that a hook gives back.
    #[derive(Component)]
    #[component(on_remove = give_back)]
    struct Ticket(u32);

    fn give_back(_: DeferredWorld, _: HookContext) {}

    #[test]
    fn bytes_that_may_be_more_than_numbers_are_not_copied() {
        let (mut world, mut ways) = (World::new(), ways());
        let borrows = world.spawn(Borrows(Box::leak(Box::new(1)))).id();
        let kept = world.spawn(Kept(ManuallyDrop::new(Box::new(2)))).id();
        let ticket = world.spawn(Ticket(3)).id();
        for entity in [borrows, kept, ticket] {
            let way = way(&mut ways, &world, entity);
            assert!(ways.copy(&way, &world, entity).is_none(), "{}", way.name);
        }
        let sum = |world: &World| -> Option<u32> {
            let (borrowed, kept) = (world.get::<Borrows>(borrows)?, world.get::<Kept>(kept)?);
            Some(*borrowed.0 + **kept.0 + world.get::<Ticket>(ticket)?.0)
        };
        assert_eq!(sum(&world), Some(6));
    }

    #[derive(Resource, Clone)]
    struct Late;

    #[test]
    fn a_type_that_was_no_resource_at_first_may_become_one() {
        let (mut world, mut ways) = (World::new(), ways());
        let id = world.register_component::<Late>();
        assert!(!ways.of(&world, id).expect("a type of the game").is_resource);
        world.insert_resource(Late);
        assert!(ways.of(&world, id).expect("a type of the game").is_resource);
        world.remove_resource::<Late>();
        assert!(ways.of(&world, id).expect("a type of the game").is_resource);
    }

    #[test]
    fn numbers_are_copied_without_clone() {
        let (mut world, mut ways, mut map) = (World::new(), ways(), EntityMap::default());
        let (first, other) = (world.spawn(Legs { steps: 7 }).id(), world.spawn_empty().id());
        let way = way(&mut ways, &world, first);
        let value = ways.copy(&way, &world, first).expect("it needs no drop");
        world.entity_mut(first).insert(Legs { steps: 9 });
        Made::insert(way.make(&value, &mut map).into_iter().collect(), &mut world, other);
        assert_eq!(world.get::<Legs>(other).map(|legs| legs.steps), Some(7));
        way.write(&mut world, first, &value, &mut map, Tick::new(1));
        assert_eq!(world.get::<Legs>(first).map(|legs| legs.steps), Some(7));
    }
}
