//! The start of an episode.

use crate::{
    foreign::{
        agents::begin_agents_along,
        clocks::{ClockSettings, leave_loading_out, stand_still},
        levels::{EditorLevel, LevelFromFile, editor_level_ahead, level_ahead},
        observe::forget_state,
        runtime::{AgentParts, Foreign, ForeignCell, LevelSeed, OwnRestartKind, Restart, active_agents, with_foreign},
        snapshot::{note_frame, note_start, queued, ticks},
    },
    level_files::LevelDesigns,
    randomise,
};
use bevy::{ecs::change_detection::Tick, prelude::*};
use bevy_playbot::{
    agent::{Agent, Control},
    engine::{NextEpisode, Renewal, UnloadedAssets},
    episode::{Episode, StartEpisode},
};
use std::collections::BTreeSet;

/// Restarts the game as soon as the schedule allows it.
pub(super) fn start(event: On<StartEpisode>, mut episodes: Query<&mut Episode>, mut commands: Commands) {
    let StartEpisode { entity, level } = *event;
    if let Ok(mut episode) = episodes.get_mut(entity) {
        episode.wait();
    }
    commands.queue(move |world: &mut World| begin(world, entity, level));
}

fn begin(world: &mut World, agent: Entity, level: u64) {
    forget_state(world, agent);
    let agents = active_agents(world);
    if agents.first().is_some_and(|&first| first != agent) {
        return;
    }
    // All agents play the level of the first one, and one restart begins it for them.
    for other in agents {
        if let Some(mut episode) = world.get_mut::<Episode>(other) {
            episode.level = level;
        }
    }
    begin_agents_along(world, level);
    randomise::own_values(world);
    with_foreign(world, agent, |world, foreign| {
        let designs = world.get_resource::<LevelDesigns>();
        let (seed, file) = level_ahead(&foreign.game, designs, level)?;
        if let Some(drawn) = editor_level_ahead(&foreign.game, designs, level) {
            world.insert_resource(drawn);
        }
        world.insert_resource(seed);
        world.insert_resource(file);
        restart(world, foreign)?;
        if let Some(system) = &mut foreign.level {
            system.demand(world)?;
        }
        randomise::set_values(world, level, &active_agents(world))?;
        foreign.frames = 0;
        foreign.rewards().for_each(|part| part.last = None);
        Ok(())
    });
}

fn restart(world: &mut World, foreign: &mut Foreign) -> Result<(), String> {
    // Before the first episode the clocks are as the start of the program has left them. A game's own restart goes on
    // from there; `Restart::Startup` goes back to the time before it.
    let begun = *foreign.begun.get_or_insert_with(|| ClockSettings::of(world).running());
    let before = world.increment_change_tick();
    if let Some(system) = &mut foreign.restart {
        begun.start(world);
        system.demand(world)?;
        forget_messages(world, foreign, before);
        return Ok(());
    }
    match foreign.game.description.restart.clone() {
        Restart::Own(own) => {
            begun.start(world);
            if let OwnRestartKind::State(enter) = own.0 {
                enter(world)?;
            }
            forget_messages(world, foreign, before);
            Ok(())
        }
        Restart::Startup => {
            start_again(world, foreign, before);
            Ok(())
        }
        Restart::Rebuild => demand_a_new_world(world, foreign),
    }
}

/// Checks that the World is new. Its first frames have started the game already.
fn demand_a_new_world(world: &mut World, foreign: &mut Foreign) -> Result<(), String> {
    let others = "`Restart::Startup`, `Restart::state` or `Restart::system`";
    if !world.contains_resource::<Renewal>() {
        return Err(format!(
            "`Restart::Rebuild` rebuilds the World, which is impossible in a window: play it without a window, or let it \
             restart with {others}"
        ));
    }
    if std::mem::replace(&mut foreign.has_begun, true) {
        return Err(format!(
            "`Restart::Rebuild` needs a new World for each episode, and this one has had its episode: run it with \
             `tick_world`, or let the game restart with {others}"
        ));
    }
    if let Some(begun) = foreign.begun {
        begun.start(world);
    }
    Ok(())
}

/// Stores the level for the systems of the game's start: that of the first agent.
pub(super) fn announce(
    event: On<NextEpisode>,
    agents: Query<(Entity, &Agent, &Control)>,
    cell: Res<ForeignCell>,
    designs: Option<Res<LevelDesigns>>,
    mut seed: ResMut<LevelSeed>,
    mut file: ResMut<LevelFromFile>,
    mut editor: Option<ResMut<EditorLevel>>,
) {
    let active = agents.iter().filter(|(_, _, control)| control.is_active());
    let first = active.min_by_key(|(_, agent, _)| agent.index);
    if first.is_some_and(|(first, _, _)| first != event.entity) {
        return;
    }
    // A level that does not exist is reported when its episode begins.
    let foreign = cell.lock();
    if let Ok(ahead) = level_ahead(&foreign.game, designs.as_deref(), event.level) {
        (*seed, *file) = ahead;
    }
    if let Some(played) = &mut editor
        && let Some(drawn) = editor_level_ahead(&foreign.game, designs.as_deref(), event.level)
    {
        **played = drawn;
    }
}

/// Despawns the game's entities, and runs the schedules of a program's start again.
fn start_again(world: &mut World, foreign: &Foreign, before: Tick) {
    let Some(baseline) = &foreign.baseline else { return };
    for entity in baseline.spawned(world) {
        // Some are despawned with their parents.
        if let Ok(entity) = world.get_entity_mut(entity) {
            entity.despawn();
        }
    }
    world.flush();
    forget_messages(world, foreign, before);
    if let Some(clocks) = foreign.clocks {
        clocks.start(world);
    }
    for &label in &foreign.startup {
        // Some schedules have no system.
        let _ = world.try_run_schedule(label);
    }
}

/// Drops the messages of the last episode, and those that its end has written while the game was taken down.
///
/// Only types that the game names are dropped. Others may carry work that is still to be done: loaded files for Bevy,
/// or removed bodies for a physics engine. The restart has begun at the change tick `before`.
fn forget_messages(world: &mut World, foreign: &Foreign, before: Tick) {
    foreign.game.description.forgotten.iter().for_each(|(_, forget)| forget(world));
    LeftMessages::note(world, foreign, before);
}

/// Types of messages that an episode leaves to the next one, in a World that has this resource.
///
/// Only Bevy's name of a queue and the tick of its last message are known. How many messages wait, and which systems have
/// read them, is hidden behind the type.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone)]
pub(crate) struct LeftMessages {
    /// Types that were written while an episode was taken down, so that no system has read them.
    pub unread: BTreeSet<String>,
    /// Types that were written in the last frames of an episode. Some systems may have read them.
    pub recent: BTreeSet<String>,
    /// The change ticks at which the last two frames began.
    frames: [Option<Tick>; 2],
    /// Whether an episode has begun. What the start of the program writes belongs to the first one.
    has_begun: bool,
}

impl LeftMessages {
    /// Adds the types of another World.
    pub fn add(&mut self, other: &Self) {
        self.unread.extend(other.unread.iter().cloned());
        self.recent.extend(other.recent.iter().cloned());
    }

    /// Keeps the types for which `keep` is true.
    pub fn retain(&mut self, keep: impl Fn(&str) -> bool) {
        self.unread.retain(|message| keep(message));
        self.recent.retain(|message| keep(message));
    }

    /// Notes that a frame begins.
    fn note_frame(world: &mut World) {
        if world.contains_resource::<Self>() {
            let now = world.increment_change_tick();
            let mut left = world.resource_mut::<Self>();
            left.frames = [left.frames[1], Some(now)];
        }
    }

    /// Notes the types that wait, but for forgotten ones.
    fn note(world: &mut World, foreign: &Foreign, before: Tick) {
        let Some(left) = world.get_resource::<Self>() else { return };
        let now = world.read_change_tick();
        let (mut unread, mut recent) = (Vec::new(), Vec::new());
        for (id, entity) in world.resource_entities().iter().filter(|_| left.has_begun) {
            let Some(info) = world.components().get_info(id) else { continue };
            let name = info.name().to_string();
            let Some(message) = queued(&name) else { continue };
            let is_forgotten =
                foreign.game.description.forgotten.iter().any(|(queue, _)| info.type_id() == Some(*queue));
            let Some(ticks) = ticks(world, entity, id).filter(|_| !is_forgotten) else { continue };
            if ticks.changed.is_newer_than(before, now) {
                unread.push(message.to_owned());
            } else if left.frames[0].is_some_and(|frame| ticks.changed.is_newer_than(frame, now)) {
                recent.push(message.to_owned());
            }
        }
        let mut left = world.resource_mut::<Self>();
        left.has_begun = true;
        left.unread.extend(unread);
        left.recent.extend(recent);
    }
}

/// Checks whether the level is ready. Each restart gets one frame to settle: commands, states and transforms.
pub(super) fn check(world: &mut World) {
    note_frame(world);
    LeftMessages::note_frame(world);
    let mut agents = active_agents(world);
    agents.retain(|&agent| world.get::<Episode>(agent).is_some_and(Episode::is_loading));
    let Some(&first) = agents.first() else { return };
    let is_ready = with_foreign(world, first, |world, foreign| {
        foreign.frames += 1;
        if foreign.frames == 1 {
            return Ok(false);
        }
        if let Some(ready) = &mut foreign.ready
            && ready.run(world)? != Some(true)
        {
            let description = &foreign.game.description;
            if foreign.frames > description.patience {
                let name = description.ready.as_ref().map_or("", |system| system.name());
                return Err(not_ready(name, description.patience, &UnloadedAssets::of(world)));
            }
            // A splash screen that waits for the clock ends in the second half.
            if foreign.frames <= description.patience / 2 {
                stand_still(world);
            }
            return Ok(false);
        }
        if foreign.ready.is_some() {
            leave_loading_out(world);
        }
        if let Some(system) = &mut foreign.loaded {
            system.demand(world)?;
        }
        if let Some(baseline) = &foreign.baseline {
            note_start(world, baseline);
        }
        Ok(true)
    });
    if is_ready == Some(false) {
        return;
    }
    let is_sound = is_ready.is_some() && agents.iter().all(|&agent| read_first_values(world, agent).is_some());
    for agent in agents {
        let Some(mut episode) = world.get_mut::<Episode>(agent) else { continue };
        if is_sound {
            episode.ready();
        } else {
            // The fault has stopped an agent; the level was never played.
            episode.abandon();
        }
    }
}

/// Reads the values of an agent's rewards before the first tick.
fn read_first_values(world: &mut World, agent: Entity) -> Option<()> {
    with_foreign(world, agent, |world, foreign| {
        let parts = foreign.asked();
        // A reward by growth starts from the value before the first tick.
        for part in parts.rewards.iter_mut().filter(|part| part.is_delta) {
            part.last = part.system.run(world)?;
        }
        read_what_is_left(world, parts);
        Ok(())
    })
}

/// Returns the error of a level that was not ready in time, with the assets that it may be waiting for.
fn not_ready(system: &str, frames: u32, assets: &UnloadedAssets) -> String {
    let separator = if assets.is_empty() { "" } else { "; assets " };
    format!(
        "it was not ready after {frames} frames: the system `{system}` of `.ready` has not said so; let it return true once \
         the level can be played, or wait longer with `.ready_within`{separator}{assets}"
    )
}

/// Lets rewards and end read the messages, and the records of removed components, of the time before the first tick.
/// Otherwise the death of the last episode's player would end this one.
fn read_what_is_left(world: &mut World, parts: &mut AgentParts) {
    // If one of them cannot run, the first tick reports it.
    for part in parts.rewards.iter_mut().filter(|part| !part.is_delta) {
        let _ = part.system.run(world);
    }
    if let Some(end) = &mut parts.end {
        let _ = end.run(world);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_level_that_is_not_ready_names_the_assets_that_are_missing() {
        let text = not_ready("arrived", 20, &UnloadedAssets::default());
        assert!(text.ends_with("or wait longer with `.ready_within`"), "{text}");
        let assets = UnloadedAssets {
            loading: vec!["level.tiles".to_owned()],
            failed: vec!["hero.png".to_owned()],
            ..default()
        };
        let text = not_ready("arrived", 20, &assets);
        assert!(text.contains("after 20 frames: the system `arrived` of `.ready`"), "{text}");
        assert!(text.ends_with("; assets still loading: `level.tiles`; failed to load: `hero.png`"), "{text}");
    }
}
