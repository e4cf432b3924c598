//! The plugin that adds a foreign game to an app.

use bevy::{app::MainScheduleOrder, ecs::schedule::ScheduleLabel, prelude::*};

use super::{
    demonstrator,
    game::ForeignGame,
    input,
    kept::Baseline,
    outcome, place, ready, restart,
    runtime::{Foreign, ForeignCell, LevelSeed},
    sense,
};
use bevy_playbot::{
    action::check_actions,
    fault::Faults,
    panics::{self, note_actions},
    placement::{TickSchedules, is_tick},
    systems::PlaybotSystems,
    virtual_input::{InputRoute, VirtualInputPlugin},
};

/// Runs before everything that the game does when the program starts.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct BeforeGame;

/// The game, with the systems between it and its agent.
pub(super) struct ForeignPlugin(pub(super) ForeignGame);

impl Plugin for ForeignPlugin {
    fn build(&self, app: &mut App) {
        let description = &self.0.description;
        add_game(app, description.name, &*description.plugin);
        if !app.is_plugin_added::<VirtualInputPlugin>() {
            app.add_plugins(VirtualInputPlugin { route: InputRoute::Messages });
        }
        app.init_resource::<LevelSeed>()
            .add_observer(restart::start)
            .add_observer(restart::announce)
            .init_schedule(BeforeGame)
            .add_systems(BeforeGame, note_baseline);
        let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
        app.add_systems(
            decide,
            (
                ready::check.in_set(PlaybotSystems::Load),
                // Each agent has one controller, so the order of the controllers does not matter.
                demonstrator::decide.in_set(PlaybotSystems::Decide).ambiguous_with(PlaybotSystems::Decide),
                // No other system presses the inputs of the game's own system.
                input::act
                    .in_set(PlaybotSystems::Act)
                    .after(check_actions)
                    .after(note_actions)
                    .ambiguous_with(PlaybotSystems::Act),
            ),
        )
        .add_systems(judge, outcome::read_outcome.before(PlaybotSystems::Judge).run_if(is_tick));
        sense::build(app);
        if description.place.is_some() {
            place::build(app);
        }
    }

    fn finish(&self, app: &mut App) {
        let mut order = app.world_mut().resource_mut::<MainScheduleOrder>();
        let startup = order.startup_labels.clone();
        order.startup_labels.insert(0, BeforeGame.intern());
        app.insert_resource(ForeignCell::new(Foreign::new(&self.0, startup)));
    }
}

/// Adds the game. Its panic becomes a fault of the first tick, so that it is reported as the game's.
fn add_game(app: &mut App, name: &str, plugin: &dyn Fn(&mut App)) {
    let Err(words) = panics::hear(|| plugin(app)) else { return };
    let mut fault = format!("the game `{name}` panicked when it was added to the app: {words}");
    if words.contains("plugin was already added") {
        fault += ". Playbot adds Bevy's own plugins: leave `DefaultPlugins`, or this one of them, out of the function that \
                  is given to `ForeignGame::new`";
    }
    app.world_mut().resource_mut::<Faults>().report(fault);
}

/// Marks all current entities as not the game's.
fn note_baseline(world: &mut World) {
    let baseline = Baseline::of(world);
    if let Some(cell) = world.get_resource::<ForeignCell>().cloned() {
        cell.lock().baseline = Some(baseline);
    }
}
