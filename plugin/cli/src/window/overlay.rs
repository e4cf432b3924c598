//! The overlay of a window: names of actions and of the decider, the progress of the lesson, and notes of detectors.

use crate::window::{session::Deciders, teaching::Teaching};
use bevy::prelude::*;
use bevy_playbot::{
    agent::Control,
    engine::TickSchedules,
    episode::EpisodeResult,
    overlay::{OverlayNames, OverlayNote, OverlayPosition, PlaybotOverlay},
};
use playbot_harness::{
    detector::{Detector, DetectorTick, EpisodeWatcher, LevelAhead, WorldTick, WorldWatcher},
    foreign::PlayerGuess,
    prelude::*,
};
use playbot_test::detectors::Detectors;
use std::sync::Arc;

/// Adds the overlay, and the default detectors of `test`. Those that need the agent's position on a plan, or a proof,
/// stay silent: both ask the game's own tools, which a window cannot keep.
pub(super) fn build(app: &mut App, game: &dyn Game, agent: Entity) {
    let names = OverlayNames { actions: game.tools().input.action_names(), ..default() };
    app.world_mut().entity_mut(agent).insert(names);
    let detectors = Detectors::defaults(game).ticks;
    let worlds = detectors.iter().filter_map(|detector| Some((detector.name(), detector.watch_world()?))).collect();
    // Its key is one of the window's own, which the game may not see.
    app.add_plugins(PlaybotOverlay { key: None, ..default() })
        .init_resource::<LastEnd>()
        .add_observer(note_end)
        .add_systems(Last, (name_decider, find_player));
    app.world_mut().insert_non_send(Watching { detectors, worlds, episode: None });
    let judge = TickSchedules::of(app).judge;
    app.add_systems(judge, watch.after(PlaybotSystems::Reset).ambiguous_with_all());
}

/// Names what decides, as the title does, and shows how far the lesson is.
fn name_decider(
    deciders: Res<Deciders>,
    teaching: Option<Res<Teaching>>,
    recorder: Option<Res<Recorder>>,
    mut agents: Query<(&Control, &mut OverlayNames)>,
) {
    let Ok((control, mut names)) = agents.get_mut(deciders.agent) else { return };
    let decider = Some(deciders.decider_name(*control));
    let recording = recorder.map(|recorder| format!("recording, {} on disk", recorder.episodes()));
    let lines: Vec<_> = recording.into_iter().chain(teaching.and_then(|teaching| teaching.words())).collect();
    let line = (!lines.is_empty()).then(|| lines.join("\n"));
    if names.decider != decider || names.line != line {
        (names.decider, names.line) = (decider, line);
    }
}

/// Finds the entity that the trail follows, in games whose agent is an entity beside it.
fn find_player(world: &mut World, mut guess: Local<PlayerGuess>) {
    let agent = world.resource::<Deciders>().agent;
    let is_known = |entity| world.get::<GlobalTransform>(entity).is_some();
    if is_known(agent) || world.get::<OverlayPosition>(agent).is_some_and(|position| is_known(position.0)) {
        return;
    }
    if let Some(player) = guess.entity(world) {
        world.entity_mut(agent).insert(OverlayPosition(player));
    }
}

/// The end of an episode in this tick.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
struct LastEnd(Option<EpisodeResult>);

fn note_end(event: On<EpisodeEnded>, deciders: Res<Deciders>, mut last: ResMut<LastEnd>) {
    if event.entity == deciders.agent {
        last.0 = Some(event.result);
    }
}

/// A watch, and the name of its detector.
type Named<T> = (&'static str, Box<T>);

/// The detectors at work.
struct Watching {
    detectors: Vec<Arc<dyn Detector>>,
    worlds: Vec<Named<dyn WorldWatcher>>,
    /// Level and watches of the running episode; `None` between two.
    episode: Option<(u64, Vec<Named<dyn EpisodeWatcher>>)>,
}

/// Shows the findings of a tick as notes. A detector that has found something is silent for the rest of the episode, or of
/// the session if it looks at the whole World.
fn watch(world: &mut World) {
    let Some(mut watching) = world.remove_non_send::<Watching>() else { return };
    let result = world.resource_mut::<LastEnd>().0.take();
    for (detector, message) in watching.look(world, result) {
        world.trigger(OverlayNote(format!("{detector}: {message}")));
    }
    world.insert_non_send(watching);
}

impl Watching {
    fn look(&mut self, world: &World, result: Option<EpisodeResult>) -> Vec<(&'static str, String)> {
        let mut found = Vec::new();
        let agent = world.resource::<Deciders>().agent;
        let Some(episode) = world.get::<Episode>(agent) else { return found };
        if result.is_none() && !(episode.is_running() && episode.tick > 0) {
            return found;
        }
        let (level, ticks) = result.map_or((episode.level, episode.tick), |result| (result.level, result.ticks));
        // A level that was left has no end.
        if self.episode.as_ref().is_some_and(|(of, _)| *of != level) || (ticks == 1 && result.is_none()) {
            self.episode = None;
        }
        let (_, watches) = self.episode.get_or_insert_with(|| {
            let ahead = LevelAhead { level, plan: None };
            let watch = |detector: &Arc<dyn Detector>| Some((detector.name(), detector.watch(&ahead)?));
            (level, self.detectors.iter().filter_map(watch).collect())
        });
        let Some(seen) = DetectorTick::of_agent(world, agent, ticks.saturating_sub(1)) else { return found };
        let is_success = result.map_or(seen.is_success, |result| result.success);
        let moment = DetectorTick { level, is_success, ..seen };
        watches.retain_mut(|(detector, watch)| {
            let message = watch.tick(&moment).or_else(|| result.and_then(|result| watch.end(&moment, &result)));
            let is_silent = message.is_none();
            found.extend(message.map(|message| (*detector, message)));
            is_silent
        });
        let moment = WorldTick { world, errors: &[] };
        self.worlds.retain_mut(|(detector, watch)| {
            let message = watch.tick(&moment);
            let is_silent = message.is_none();
            found.extend(message.map(|message| (*detector, message)));
            is_silent
        });
        if result.is_some() {
            self.episode = None;
        }
        found
    }
}
