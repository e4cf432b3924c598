//! Snapshots of a foreign game, with the keys that are held and the clocks.

use crate::{
    foreign::{
        ForeignGame,
        observe::{KeptState, kept_state, put_state},
        runtime::{ForeignCell, ReaderFactory},
    },
    game::{Snapshot, SnapshotTools},
};
use bevy::{
    ecs::system::ReadOnlySystem,
    input::{
        keyboard::{Key, KeyboardInput},
        mouse::MouseButtonInput,
    },
    prelude::*,
    window::WindowEvent,
};
use bevy_playbot::{
    action::Action,
    agent::{AgentOrder, Control},
    bot::HeldAction,
    engine::panics,
    episode::Episode,
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
    streams::AgentStreams,
    virtual_input::VirtualDevices,
};
use std::sync::Arc;

/// The function that puts a saved state into a World. Returns false if the state is of another type.
pub(super) type Load = Arc<dyn Fn(&mut World, &Snapshot) -> bool + Send + Sync>;

/// The two halves of a snapshot.
#[derive(Clone)]
pub(super) struct SnapshotParts {
    pub(super) save: ReaderFactory<Snapshot>,
    load: Load,
}

impl ForeignGame {
    /// Declares how the state of a running episode is saved, and put back: explorers then return to a known state at
    /// once, instead of restarting the game and playing the path again.
    ///
    /// `save` is a system that only reads, and returns all state of the game that decides how an episode goes on, by
    /// value and without ids of entities. While it is skipped, because an entity that it asks for does not exist, nothing
    /// is saved. `load` puts such a state into the World, where the same level was played before, perhaps to its end. It
    /// spawns and despawns entities if their number differs. Held keys and mouse buttons, the clocks and the last values
    /// of rewards are restored as well, and messages that the game [forgets](Self::forget_messages) at a restart are
    /// dropped. A game with other inputs saves nothing.
    ///
    /// Explorers compare snapshots with replays, and do without them if they differ.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::foreign::ForeignGame;
    ///
    /// #[derive(Component, Clone)]
    /// struct Hero {
    ///     speed: f32,
    /// }
    ///
    /// fn saved(game: ForeignGame) -> ForeignGame {
    ///     game.snapshot(
    ///         |hero: Single<(&Transform, &Hero)>| (*hero.0, hero.1.clone()),
    ///         |world: &mut World, (place, hero): &(Transform, Hero)| {
    ///             let mut heroes = world.query::<(&mut Transform, &mut Hero)>();
    ///             if let Ok((mut at, mut now)) = heroes.single_mut(world) {
    ///                 (*at, *now) = (*place, hero.clone());
    ///             }
    ///         },
    ///     )
    /// }
    /// ```
    pub fn snapshot<State, M>(
        self,
        save: impl IntoSystem<(), State, M, System: ReadOnlySystem> + Clone + Send + Sync + 'static,
        load: impl Fn(&mut World, &State) + Send + Sync + 'static,
    ) -> Self
    where
        State: Send + Sync + 'static,
        M: 'static,
    {
        let load: Load = Arc::new(move |world, snapshot| {
            let state = snapshot.get::<State>();
            state.into_iter().for_each(|state| load(world, state));
            state.is_some()
        });
        let save = ReaderFactory::converting(save, Snapshot::new::<State>);
        self.with(|description| description.snapshot = Some(SnapshotParts { save, load }))
    }
}

/// What the plugin keeps of an agent.
type KeptAgent = ((Control, Episode, AgentStreams, Action), (Observation, Reward, StateHash), HeldAction);

/// Returns what the plugin keeps of the other agents of a World. The caller knows the one that it plays.
fn others(world: &World, agent: Entity) -> Vec<(Entity, KeptAgent)> {
    let all = world.get_resource::<AgentOrder>().map_or(&[][..], |order| order.entities());
    let kept = |other: Entity| -> Option<(Entity, KeptAgent)> {
        let entity = world.get_entity(other).ok()?;
        let (control, episode, streams) = (entity.get().copied()?, entity.get().cloned()?, entity.get().cloned()?);
        let (action, seen) = (entity.get().cloned()?, entity.get().cloned()?);
        let (reward, hash) = (entity.get().copied()?, entity.get().copied()?);
        let held = entity.get().cloned().unwrap_or_default();
        Some((other, ((control, episode, streams, action), (seen, reward, hash), held)))
    };
    all.iter().filter(|other| **other != agent).filter_map(|&other| kept(other)).collect()
}

/// The state of a game, and that of the plugin about it.
struct SavedGame {
    game: Snapshot,
    agent: Entity,
    /// Position and cell of the agent.
    state: KeptState,
    /// The other agents of the World.
    others: Vec<(Entity, KeptAgent)>,
    /// The last value of each part of the reward.
    rewards: Vec<Option<f32>>,
    /// The last decision, if decisions hold for several ticks.
    held: Vec<Option<u32>>,
    devices: Option<VirtualDevices>,
    keys: Option<ButtonInput<KeyCode>>,
    letters: Option<ButtonInput<Key>>,
    mouse: Option<ButtonInput<MouseButton>>,
    time: Option<Time>,
    virtual_time: Option<Time<Virtual>>,
    fixed_time: Option<Time<Fixed>>,
}

impl SnapshotTools for ForeignGame {
    fn save(&self, world: &World, agent: Entity) -> Option<Snapshot> {
        if !self.description.input.is_of_buttons() {
            return None;
        }
        let cell = world.get_resource::<ForeignCell>()?;
        let mut foreign = cell.lock();
        // An error of the system is not one of the game: it is played without snapshots.
        let game = foreign.save.as_mut()?.read(world).ok()??;
        Some(Snapshot::new(SavedGame {
            game,
            agent,
            state: kept_state(world, agent),
            others: others(world, agent),
            rewards: foreign.rewards().map(|part| part.last).collect(),
            held: foreign.held().map(|held| *held).collect(),
            devices: world.get_resource().cloned(),
            keys: world.get_resource().cloned(),
            letters: world.get_resource().cloned(),
            mouse: world.get_resource().cloned(),
            time: world.get_resource().copied(),
            virtual_time: world.get_resource().copied(),
            fixed_time: world.get_resource().copied(),
        }))
    }

    fn load(&self, world: &mut World, agent: Entity, snapshot: &Snapshot) -> bool {
        let (Some(saved), Some(parts)) = (snapshot.get::<SavedGame>(), &self.description.snapshot) else {
            return false;
        };
        let Some(cell) = world.get_resource::<ForeignCell>().cloned() else { return false };
        // Before its first episode the game has no level. Held keys are noted by the agent that holds them.
        if cell.lock().begun.is_none() || saved.agent != agent {
            return false;
        }
        // After a panic the level is started again.
        if !panics::hear(|| (parts.load)(world, &saved.game)).unwrap_or(false) {
            return false;
        }
        world.flush();
        for (part, last) in cell.lock().rewards().zip(&saved.rewards) {
            part.last = *last;
        }
        for (held, last) in cell.lock().held().zip(&saved.held) {
            *held = *last;
        }
        put_state(world, agent, &saved.state);
        for (other, kept) in &saved.others {
            if let Ok(mut other) = world.get_entity_mut(*other) {
                other.insert(kept.clone());
            }
        }
        put(world, saved.devices.clone());
        put(world, saved.keys.clone());
        put(world, saved.letters.clone());
        put(world, saved.mouse.clone());
        put(world, saved.time);
        put(world, saved.virtual_time);
        put(world, saved.fixed_time);
        // The end of an episode releases its keys by messages that no frame has read yet.
        forget::<KeyboardInput>(world);
        forget::<MouseButtonInput>(world);
        forget::<WindowEvent>(world);
        self.description.forgotten.iter().for_each(|forget| forget(world));
        true
    }
}

/// Drops all messages of a type.
fn forget<M: Message>(world: &mut World) {
    if let Some(mut messages) = world.get_resource_mut::<Messages<M>>() {
        messages.clear();
    }
}

/// Replaces a resource of the World by a saved one.
fn put<R: Resource>(world: &mut World, saved: Option<R>) {
    if let Some(saved) = saved {
        world.insert_resource(saved);
    }
}
