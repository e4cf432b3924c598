//! Resources and components that are carried over into a rebuilt World. Each type states it at its definition.
//!
//! `#[reflect(Component, CarryComponent)]` is for components of agents, `#[reflect(Resource, CarryResource)]` for
//! resources.

use bevy::{
    prelude::*,
    reflect::{FromType, TypeRegistration},
};
use std::any::TypeId;

type MoveResource = fn(&mut World, &mut World);

type MoveComponent = fn(&mut World, &mut World, Entity);

/// Type data of a resource that is carried over.
#[derive(Clone)]
pub(crate) struct ReflectCarryResource(MoveResource);

impl<R: Resource> FromType<R> for ReflectCarryResource {
    fn from_type() -> Self {
        Self(move_resource::<R>)
    }
}

/// Type data of a component that is carried over with its agent.
#[derive(Clone)]
pub(crate) struct ReflectCarryComponent(MoveComponent);

impl<C: Component> FromType<C> for ReflectCarryComponent {
    fn from_type() -> Self {
        Self(move_component::<C>)
    }
}

/// Types that are carried over from one World to the next, in this order.
#[derive(Clone, Default)]
pub(crate) struct CarryOver {
    resources: Vec<(TypeId, MoveResource)>,
    components: Vec<(TypeId, MoveComponent)>,
}

impl CarryOver {
    /// Returns the types that state it at their definition, by name: the registry itself has no order.
    pub(crate) fn registered(world: &World) -> Self {
        let Some(registry) = world.get_resource::<AppTypeRegistry>() else { return Self::default() };
        let registry = registry.read();
        let mut types: Vec<_> = registry
            .iter()
            .filter(|it| it.contains::<ReflectCarryResource>() || it.contains::<ReflectCarryComponent>())
            .collect();
        types.sort_by_key(|it| name(it));
        let mut all = Self::default();
        for it in types {
            all.resources.extend(it.data::<ReflectCarryResource>().map(|carry| (it.type_id(), carry.0)));
            all.components.extend(it.data::<ReflectCarryComponent>().map(|carry| (it.type_id(), carry.0)));
        }
        all
    }

    pub(crate) fn add_resource<R: Resource>(&mut self) {
        add(&mut self.resources, TypeId::of::<R>(), move_resource::<R>);
    }

    pub(crate) fn add_component<C: Component>(&mut self) {
        add(&mut self.components, TypeId::of::<C>(), move_component::<C>);
    }

    /// Adds the missing types.
    pub(crate) fn extend(&mut self, more: &Self) {
        more.resources.iter().for_each(|&(id, carry)| add(&mut self.resources, id, carry));
        more.components.iter().for_each(|&(id, carry)| add(&mut self.components, id, carry));
    }

    /// Moves everything. The agents are the same entities in both Worlds.
    pub(crate) fn carry(&self, old: &mut World, new: &mut World, agents: impl IntoIterator<Item = Entity>) {
        self.resources.iter().for_each(|(_, carry)| carry(old, new));
        for agent in agents {
            self.components.iter().for_each(|(_, carry)| carry(old, new, agent));
        }
    }
}

fn add<T>(all: &mut Vec<(TypeId, T)>, id: TypeId, carry: T) {
    if all.iter().all(|(known, _)| *known != id) {
        all.push((id, carry));
    }
}

fn name(it: &TypeRegistration) -> (&'static str, &'static str) {
    let paths = it.type_info().type_path_table();
    (paths.short_path(), paths.path())
}

/// Moves a resource. A resource that was removed is absent afterwards, too.
fn move_resource<R: Resource>(old: &mut World, new: &mut World) {
    match old.remove_resource::<R>() {
        Some(resource) => new.insert_resource(resource),
        None => drop(new.remove_resource::<R>()),
    }
}

fn move_component<C: Component>(old: &mut World, new: &mut World, agent: Entity) {
    let carried = old.get_entity_mut(agent).ok().and_then(|mut agent| agent.take::<C>());
    let Ok(mut agent) = new.get_entity_mut(agent) else { return };
    match carried {
        Some(component) => agent.insert(component),
        None => agent.remove::<C>(),
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::headless::headless_app;

    /// Types that a new World has of its own.
    const FRESH: &[&str] = &[
        // Part of the game's construction.
        "Agent",
        "AgentLimit",
        "AwaitedLoads",
        "CameraSensor",
        "EnhancedAction",
        "GameIdentity",
        "IdleAction",
        "ImageSensor",
        "KeyBindings",
        "LeafwingActions",
        "LevelFiles",
        "NoRenderer",
        "NoScreen",
        "Overlay",
        "OverlayNames",
        "OverlayPosition",
        "PlaysAlong",
        "PressesForPeople",
        "RasterSensor",
        "ReadbackDelay",
        "Renderer",
        "RenderSensorViews",
        "SensorCamera",
        "ShowsWindows",
        "Stage",
        "Takeover",
        "TasksEndWithFrames",
        "Teaching",
        "TickSchedules",
        "TileBorder",
        "TileLayer",
        "Trail",
        "VirtualDevices",
        "VirtualGamepad",
        "VirtualInput",
        // Begins with the episode, and is filled in every tick.
        "Atlas",
        "BorrowedTargets",
        "Broken",
        "ClickAreas",
        "DirectInput",
        "DrawnStamp",
        "Episode",
        "ExtractedStamp",
        "Frame",
        "FrameGate",
        "HeldAction",
        "MissingImages",
        "MissingSet",
        "Observation",
        "PaintedVelocity",
        "PersonsCursor",
        "PictureStack",
        "PolicyBatch",
        "Readback",
        "Reward",
        "SensorViews",
        "Stamp",
        "TappedKeys",
        "Tick",
        // Stand-ins for Bevy's own, which its plugins would insert.
        "GlobalVolume",
        "TonemappingLuts",
        // Inserted with each sensor.
        "HasEntitySensors",
        // Carried over by the code that inserts them.
        "Renewal",
        "SharedBatch",
    ];

    /// A new type must state whether it is carried over: a forgotten one would be lost after an episode, without a
    /// message.
    #[test]
    fn each_type_is_known_to_go_over_or_to_begin_anew() {
        let app = headless_app();
        let registry = app.world().resource::<AppTypeRegistry>().read();
        let mut undecided = Vec::new();
        for it in registry.iter() {
            let (short, path) = name(it);
            let is_kept = it.contains::<ReflectComponent>() || it.contains::<ReflectResource>();
            if !path.starts_with("bevy_playbot::") || !is_kept {
                continue;
            }
            let carried = it.contains::<ReflectCarryResource>() || it.contains::<ReflectCarryComponent>();
            let short = short.split('<').next().unwrap_or_default();
            if carried == FRESH.contains(&short) {
                undecided.push(path);
            }
        }
        assert!(undecided.is_empty(), "say `CarryComponent` or `CarryResource`, or add to FRESH: {undecided:?}");
    }

    #[test]
    fn what_goes_over_is_ordered_by_name() {
        let carried = CarryOver::registered(headless_app().world());
        let registry = headless_app().world().resource::<AppTypeRegistry>().clone();
        let registry = registry.read();
        let names = |ids: Vec<TypeId>| -> Vec<_> {
            ids.into_iter().filter_map(|id| registry.get(id)).map(|it| name(it).0).collect()
        };
        assert_eq!(
            names(carried.resources.iter().map(|(id, _)| *id).collect()),
            [
                "ActivePolicy",
                "AgentOrder",
                "Faults",
                "OverdueAssets",
                "PanicReports",
                "PlaybotSeed",
                "Recorder",
                "SkillPrior"
            ]
        );
        assert_eq!(
            names(carried.components.iter().map(|(id, _)| *id).collect()),
            [
                "Action",
                "ActiveSkill",
                "AgentMemory",
                "AgentStreams",
                "BlankEpisodes",
                "BlindBot",
                "Control",
                "Decision",
                "DecisionPeriod",
                "EntitySensor",
                "EpisodeCount",
                "EpisodeSeeds",
                "EpisodeTrace",
                "LegalActions",
                "LevelQueue",
                "NoTimeLimit",
                "OwnPolicy",
                "RandomisedValues",
                "Recording",
                "RedrawsIllegal",
                "Replay",
                "SkillMemory",
                "StateHash",
                "VectorSensor",
            ]
        );
    }
}
