//! System sets of the plugin, and the schedule of sensors.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! /// Hits are known after the physics, and still count in this tick.
//! fn pay_for_hits(mut rewards: Query<&mut Reward>) {
//!     rewards.iter_mut().for_each(|mut reward| reward.add(-1.0));
//! }
//!
//! let mut app = headless_app();
//! app.add_systems(FixedPostUpdate, pay_for_hits.before(PlaybotSystems::Judge));
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human)).id();
//! app.tick().expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Episode>(agent).expect("every agent has one").total_reward, -1.0);
//! ```

use bevy::{
    ecs::{
        entity::EntityHashSet,
        schedule::{
            FlattenedDependencies, NodeId, ScheduleBuildError, ScheduleBuildPass, ScheduleGraph, ScheduleLabel,
            Schedules, SystemKey, SystemSetKey, SystemWithAccess, graph::DiGraph,
        },
    },
    platform::{collections::HashMap, hash::FixedHasher},
    prelude::*,
    transform::{
        components::TransformTreeChanged,
        systems::{StaticTransformOptimizations, mark_dirty_trees},
    },
};
use std::{cmp::Reverse, collections::BinaryHeap};

/// Parts of a tick, in this order, in the schedules that
/// [`TickSchedules`](crate::placement::TickSchedules) names: by default `FixedPreUpdate` and
/// `FixedPostUpdate`.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlaybotSystems {
    /// `FixedPreUpdate`: agents without a level get one.
    Begin,
    /// `FixedPreUpdate`: a game whose levels take several frames marks those that are ready:
    /// [`Episode::ready`](crate::episode::Episode::ready).
    Load,
    /// `FixedPreUpdate`: [`ObserveSchedule`] fills the observations.
    Observe,
    /// `FixedPreUpdate`: the source of the agent's [`Control`](crate::agent::Control) writes the
    /// action.
    Decide,
    /// `FixedPreUpdate`: actions are checked and handed to the game's input.
    Act,
    /// `FixedPostUpdate`: reward and length are counted.
    Judge,
    /// `FixedPostUpdate`: the tick is recorded, for demonstrations and for the learner.
    Record,
    /// `FixedPostUpdate`: ended episodes are announced.
    Reset,
}

/// The game's sensors. Runs in [`PlaybotSystems::Observe`], and once more after a tick that
/// truncated an episode, since the learner needs the value of the last state.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObserveSchedule;

/// Runs the sensors: the systems of the game, and then those of sets of things.
pub fn run_observe_schedule(world: &mut World) {
    world.run_schedule(ObserveSchedule);
    crate::entities::look(world);
}

// Fixed order for systems whose order the game leaves open.

/// Gives the systems of each schedule one order: the game's constraints, and otherwise the order in
/// which they were added. Call it before the schedules run, with single-threaded executors.
///
/// Bevy's order of other systems depends on the rest of the schedule. A game with ambiguous systems would run
/// differently headless and in a window, where more plugins add systems.
pub fn put_in_order(world: &mut World) {
    for (_, schedule) in world.resource_mut::<Schedules>().iter_mut() {
        schedule.add_build_pass(InOrderOfAddition);
    }
}

/// Leaves the order open, as in a game that runs by itself: for tests that look for ambiguous
/// systems.
pub fn leave_open(world: &mut World) {
    for (_, schedule) in world.resource_mut::<Schedules>().iter_mut() {
        schedule.remove_build_pass::<InOrderOfAddition>();
    }
}

/// Bevy adds its synchronisation points in a pass before this one, so they stay where they are
/// needed.
#[derive(Debug)]
struct InOrderOfAddition;

impl ScheduleBuildPass for InOrderOfAddition {
    type EdgeOptions = ();

    fn add_dependency(&mut self, _: NodeId, _: NodeId, _: Option<&()>) {}

    fn collapse_set(
        &mut self,
        _: SystemSetKey,
        _: &indexmap::IndexSet<SystemKey, FixedHasher>,
        _: &DiGraph<NodeId>,
    ) -> impl Iterator<Item = (NodeId, NodeId)> {
        std::iter::empty()
    }

    fn build(
        &mut self,
        _: &mut World,
        _: &mut ScheduleGraph,
        mut dependencies: FlattenedDependencies<'_>,
    ) -> Result<(), ScheduleBuildError> {
        for pair in order(&dependencies).windows(2) {
            dependencies.add_edge(pair[0], pair[1]);
        }
        Ok(())
    }
}

/// Sorts the systems: each after those that it depends on, otherwise the earlier one first (Kahn's
/// algorithm). Keys count up as systems are added.
fn order(dependencies: &DiGraph<SystemKey>) -> Vec<SystemKey> {
    let mut waits_for: HashMap<SystemKey, usize> = dependencies.nodes().map(|system| (system, 0)).collect();
    for (_, later) in dependencies.all_edges() {
        *waits_for.entry(later).or_default() += 1;
    }
    let mut free: BinaryHeap<_> = dependencies.nodes().filter(|system| waits_for[system] == 0).map(Reverse).collect();
    let mut order = Vec::new();
    while let Some(Reverse(system)) = free.pop() {
        order.push(system);
        for later in dependencies.neighbors(system) {
            let waits = waits_for.entry(later).or_default();
            *waits -= 1;
            if *waits == 0 {
                free.push(Reverse(later));
            }
        }
    }
    order
}

// Bevy's systems that take the threads of a pool whatever executor runs them.

/// Puts a system that runs on the calling thread into the place of each of Bevy's `mark_dirty_trees`, of which a game
/// with UI and physics has several. Call it before the schedules run.
///
/// Bevy's own starts two tasks in a pool that all Worlds of a program share, however few entities have moved, and so
/// Worlds that run side by side wait for each other several times in each tick.
pub(crate) fn mark_trees_on_one_thread(world: &mut World) {
    let bevys = IntoSystem::system_type_id(&mark_dirty_trees);
    world.resource_scope::<Schedules, _>(|world, mut schedules| {
        for (_, schedule) in schedules.iter_mut() {
            let systems = &mut schedule.graph_mut().systems;
            let found = systems.iter().filter(|(_, system, _)| system.system_type() == bevys);
            let found: Vec<SystemKey> = found.map(|(key, ..)| key).collect();
            for place in found {
                let Some(place) = systems.get_mut(place) else { continue };
                let mut mark = IntoSystem::into_system(mark_changed_trees);
                mark.initialize(world);
                *place = SystemWithAccess::new(Box::new(mark));
            }
        }
    });
}

/// Marks the trees that Bevy's system marks: all entities whose place or parent has changed, and everything above them.
fn mark_changed_trees(
    optimizations: Res<StaticTransformOptimizations>,
    changed: Query<Entity, Or<(Changed<Transform>, Changed<ChildOf>, Added<GlobalTransform>)>>,
    mut orphans: RemovedComponents<ChildOf>,
    parents: Query<&ChildOf>,
    mut trees: Query<&mut TransformTreeChanged>,
    mut seen: Local<EntityHashSet>,
) {
    if !optimizations.is_enabled() {
        return;
    }
    seen.clear();
    for start in changed.iter().chain(orphans.read()) {
        let mut next = Some(start);
        while let Some(entity) = next.filter(|&entity| seen.insert(entity)) {
            if let Ok(mut tree) = trees.get_mut(entity) {
                tree.set_changed();
            }
            next = parents.get(entity).ok().map(ChildOf::parent);
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::ecs::schedule::SingleThreadedExecutor;

    use super::*;

    #[derive(Resource, Default)]
    struct Ran(Vec<&'static str>);

    fn note(name: &'static str) -> impl FnMut(ResMut<Ran>) {
        move |mut ran| ran.0.push(name)
    }

    fn ran(game: impl Fn(&mut App)) -> Vec<&'static str> {
        let mut app = App::new();
        app.init_resource::<Ran>();
        game(&mut app);
        put_in_order(app.world_mut());
        app.edit_schedule(Update, |schedule| {
            schedule.set_executor(SingleThreadedExecutor::new());
        });
        app.update();
        std::mem::take(&mut app.world_mut().resource_mut::<Ran>().0)
    }

    #[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
    enum Set {
        Early,
        Late,
    }

    fn game(app: &mut App) {
        app.add_systems(Update, (note("move"), note("look").in_set(Set::Late), note("spawn").in_set(Set::Early)));
        app.add_systems(Update, note("score"));
    }

    #[test]
    fn systems_run_in_the_order_of_their_addition_whatever_else_is_there() {
        assert_eq!(ran(game), ["move", "look", "spawn", "score"]);
        let with_others = ran(|app| {
            app.add_systems(Update, note("other").in_set(Set::Late));
            game(app);
            app.add_systems(Update, (note("more"), note("last").after(Set::Late)).chain());
        });
        assert_eq!(with_others, ["other", "move", "look", "spawn", "score", "more", "last"]);
    }

    #[test]
    fn what_is_in_order_stays_so() {
        let ordered = ran(|app| {
            game(app);
            app.configure_sets(Update, Set::Early.before(Set::Late));
        });
        assert_eq!(ordered, ["move", "spawn", "look", "score"]);
    }

    #[test]
    fn commands_are_applied_where_the_order_asks_for_it() {
        #[derive(Resource)]
        struct Made;
        let seen = ran(|app| {
            app.add_systems(
                Update,
                (|mut commands: Commands| commands.insert_resource(Made), note("made").run_if(resource_exists::<Made>))
                    .chain(),
            );
        });
        assert_eq!(seen, ["made"]);
    }

    /// A tree of three, and an entity beside it.
    fn family(world: &mut World) -> [Entity; 4] {
        let root = world.spawn(Transform::default()).id();
        let child = world.spawn((Transform::default(), ChildOf(root))).id();
        let leaf = world.spawn((Transform::default(), ChildOf(child))).id();
        [root, child, leaf, world.spawn(Transform::default()).id()]
    }

    /// Moves some of the entities in each frame, takes one out of its tree, and returns where all of them are drawn and
    /// which were marked.
    fn moved(alone: bool) -> Vec<Vec<(Vec3, bool)>> {
        bevy::tasks::ComputeTaskPool::get_or_init(Default::default);
        let mut app = App::new();
        app.add_plugins(TransformPlugin);
        let family = family(app.world_mut());
        if alone {
            mark_trees_on_one_thread(app.world_mut());
            assert_eq!(bevys_left(&app), 0);
        }
        let mut frames = Vec::new();
        for (frame, moved) in [vec![], vec![2], vec![0], vec![1, 3], vec![]].into_iter().enumerate() {
            let before = app.world_mut().change_tick();
            if frame == 4 {
                app.world_mut().entity_mut(family[2]).remove::<ChildOf>();
            }
            for at in moved {
                app.world_mut().get_mut::<Transform>(family[at]).expect("a place").translation.x += 1.0;
            }
            app.update();
            let world = app.world_mut();
            let now = world.change_tick();
            frames.push(Vec::from(family.map(|entity| {
                let entity = world.entity(entity);
                let marked = entity.get_ref::<TransformTreeChanged>().expect("a mark").last_changed();
                let place = entity.get::<GlobalTransform>().expect("a place").translation();
                (place, marked.is_newer_than(before, now))
            })));
        }
        frames
    }

    /// Returns how many of Bevy's systems are left in a schedule.
    fn bevys_left(app: &App) -> usize {
        let bevys = IntoSystem::system_type_id(&mark_dirty_trees);
        let schedule = app.world().resource::<Schedules>().get(PostUpdate).expect("it is there");
        schedule.graph().systems.iter().filter(|(_, system, _)| system.system_type() == bevys).count()
    }

    #[test]
    fn a_second_system_of_a_schedule_is_replaced_too() {
        let mut app = App::new();
        // As engines of physics add it.
        app.add_plugins(TransformPlugin).add_systems(PostUpdate, mark_dirty_trees.before(TransformSystems::Propagate));
        assert_eq!(bevys_left(&app), 2);
        mark_trees_on_one_thread(app.world_mut());
        assert_eq!(bevys_left(&app), 0);
    }

    #[test]
    fn trees_are_marked_on_one_thread_as_bevy_marks_them() {
        let ours = moved(true);
        assert_eq!(ours, moved(false));
        let marked = |frame: usize| ours[frame].iter().map(|(_, marked)| *marked).collect::<Vec<_>>();
        assert_eq!(marked(1), [true, true, true, false]);
        assert_eq!(marked(3), [true, true, false, true]);
        assert_eq!(ours[4].iter().map(|(place, _)| place.x).collect::<Vec<_>>(), [1.0, 2.0, 1.0, 1.0]);
    }
}
