//! The start of an episode.

use crate::{
    foreign::{
        levels::{LevelFromFile, level_ahead},
        observe::forget_state,
        runtime::{Foreign, ForeignCell, LevelSeed, OwnRestartKind, Restart, active_agent, with_foreign},
    },
    level_files::LevelDesigns,
};
use bevy::prelude::*;
use bevy_playbot::{
    engine::{NextEpisode, Renewal},
    episode::{Episode, StartEpisode},
};

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
    with_foreign(world, agent, |world, foreign| {
        let (seed, file) = level_ahead(&foreign.game, world.get_resource::<LevelDesigns>(), level)?;
        world.insert_resource(seed);
        world.insert_resource(file);
        restart(world, foreign)?;
        if let Some(system) = &mut foreign.level {
            system.demand(world)?;
        }
        foreign.frames = 0;
        foreign.rewards.iter_mut().for_each(|part| part.last = None);
        Ok(())
    });
}

fn restart(world: &mut World, foreign: &mut Foreign) -> Result<(), String> {
    if let Some(system) = &mut foreign.restart {
        set_clock_back(world);
        return system.demand(world);
    }
    match foreign.game.description.restart.clone() {
        Restart::Own(own) => {
            set_clock_back(world);
            match own.0 {
                OwnRestartKind::State(enter) => enter(world),
                OwnRestartKind::System(_) => Ok(()),
            }
        }
        Restart::Startup => {
            start_again(world, foreign);
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
    set_clock_back(world);
    Ok(())
}

/// Stores the level for the systems of the game's start.
pub(super) fn announce(
    event: On<NextEpisode>,
    cell: Res<ForeignCell>,
    designs: Option<Res<LevelDesigns>>,
    mut seed: ResMut<LevelSeed>,
    mut file: ResMut<LevelFromFile>,
) {
    // A level that does not exist is reported when its episode begins.
    if let Ok(ahead) = level_ahead(&cell.lock().game, designs.as_deref(), event.level) {
        (*seed, *file) = ahead;
    }
}

/// Despawns the game's entities, and runs the schedules of a program's start again.
fn start_again(world: &mut World, foreign: &Foreign) {
    let Some(baseline) = &foreign.baseline else { return };
    for entity in baseline.spawned(world) {
        // Some are despawned with their parents.
        if let Ok(entity) = world.get_entity_mut(entity) {
            entity.despawn();
        }
    }
    world.flush();
    set_clock_back(world);
    for &label in &foreign.startup {
        // Some schedules have no system.
        let _ = world.try_run_schedule(label);
    }
}

/// Resets the clock to the start of a program: this frame has no length, and the next one is the first that has. Fixed
/// steps are reset as well, for any remainder of the last episode.
fn set_clock_back(world: &mut World) {
    if let Some(mut clock) = world.get_resource_mut::<Time<Virtual>>() {
        let mut fresh = Time::<Virtual>::from_max_delta(clock.max_delta());
        fresh.set_relative_speed_f64(clock.relative_speed_f64());
        *clock = fresh;
    }
    if let Some(mut clock) = world.get_resource_mut::<Time<Fixed>>() {
        *clock = Time::<Fixed>::from_duration(clock.timestep());
    }
    if let Some(mut clock) = world.get_resource_mut::<Time>() {
        *clock = Time::default();
    }
}

/// Sets the clock of the first tick after loading, for any number of frames. The game entered the level in the frame
/// before, and that counts as the first with a length. The clock keeps its speed.
pub(super) fn leave_loading_out(world: &mut World) {
    let Some(clock) = world.get_resource::<Time<Virtual>>() else { return };
    let (frame, mut fresh) = (clock.delta(), Time::new_with(*clock.context()));
    fresh.advance_by(frame);
    fresh.advance_by(frame);
    set_clock_back(world);
    if let Some(mut clock) = world.get_resource_mut::<Time<Fixed>>() {
        let step = clock.timestep();
        clock.accumulate_overstep(frame);
        while clock.overstep() >= step {
            clock.discard_overstep(step);
            clock.advance_by(step);
        }
    }
    if let Some(mut clock) = world.get_resource_mut::<Time<Virtual>>() {
        *clock = fresh;
    }
    if let Some(mut clock) = world.get_resource_mut::<Time>() {
        *clock = fresh.as_generic();
    }
}

/// Checks whether the level is ready. Each restart gets one frame to settle: commands, states and transforms.
pub(super) fn check(world: &mut World) {
    let Some(agent) = active_agent(world) else { return };
    if !world.get::<Episode>(agent).is_some_and(Episode::is_loading) {
        return;
    }
    let is_ready = with_foreign(world, agent, |world, foreign| {
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
                return Err(format!(
                    "it was not ready after {} frames: the system `{name}` of `.ready` has not said so; let it return true \
                     once the level can be played, or wait longer with `.ready_within`",
                    description.patience
                ));
            }
            return Ok(false);
        }
        if foreign.ready.is_some() {
            leave_loading_out(world);
        }
        if let Some(system) = &mut foreign.loaded {
            system.demand(world)?;
        }
        // A reward by growth starts from the value before the first tick.
        for part in foreign.rewards.iter_mut().filter(|part| part.is_delta) {
            part.last = part.system.run(world)?;
        }
        Ok(true)
    });
    match is_ready {
        Some(true) => {
            if let Some(mut episode) = world.get_mut::<Episode>(agent) {
                episode.ready();
            }
        }
        Some(false) => {}
        // The fault has stopped the agent; its level was never played.
        None => {
            if let Some(mut episode) = world.get_mut::<Episode>(agent) {
                episode.abandon();
            }
        }
    }
}
