//! The settings of a foreign game, and the plugin that adds it to an app.

#[cfg(feature = "ui")]
use crate::foreign::clicks;
use crate::{
    defect::DefectKind,
    detector::{Detector, LevelProof},
    eval::CHAOS,
    foreign::{
        ForeignGame, Restart, agents,
        agents::SharingAgents,
        clocks::ClockSettings,
        entities::SeenSet,
        input,
        input::Input,
        levels::{LevelFromFile, LevelParts, PlayedMode},
        observe, restart,
        runtime::{
            Baseline, Foreign, ForeignCell, LevelSeed, PlayedAgent, PositionAndHeight, ReaderFactory, Sensor,
            SystemFactory,
        },
        snapshot::{Part, SnapshotParts, add_whole},
    },
    reflected_path::ReflectedPath,
};
use bevy::{
    app::{MainScheduleOrder, PluginGroupBuilder},
    ecs::schedule::ScheduleLabel,
    prelude::*,
};
use bevy_playbot::{
    action::ActionValue,
    engine::{TasksEndWithFrames, TickSchedules, check_actions, is_tick, panics::note_actions},
    episode::EpisodeEnd,
    headless::{HeadlessPlugins, allow_whole_frames},
    observation::ObservationSpace,
    systems::PlaybotSystems,
    virtual_input::{InputRoute, VirtualInputPlugin},
};
use std::{any::TypeId, sync::Arc};

/// Names of bots and testers that every foreign game has, in tests and in scores of planted defects.
const NAMES_OF_ALL_GAMES: [&str; 6] = ["random", CHAOS, "hold", "explore", "explore-skills", "demonstrator"];

/// The settings of the builder.
#[derive(Clone)]
pub(super) struct Description {
    pub(super) name: &'static str,
    pub(super) version: u32,
    pub(super) plugin: Arc<dyn Fn(&mut App) + Send + Sync>,
    pub(super) hz: f64,
    pub(super) modes: &'static [&'static str],
    pub(super) levels: Option<u64>,
    /// Level files, plans and proofs.
    pub(super) level_parts: LevelParts,
    /// The input of all agents, as far as they have none of their own.
    pub(super) input: Input,
    pub(super) agents: SharingAgents,
    pub(super) act: Option<SystemFactory<()>>,
    /// The mask of the actions.
    pub(super) legal: Option<SystemFactory<Vec<bool>>>,
    /// Functions that prepare an agent when it is spawned.
    pub(super) agent: Vec<Arc<dyn Fn(&mut EntityWorldMut) + Send + Sync>>,
    /// Names of the values that `observe` returns.
    pub(super) names: Vec<String>,
    pub(super) observe: Option<SystemFactory<Vec<f32>>>,
    pub(super) paths: Vec<String>,
    /// Sets of things behind these values.
    pub(super) entities: Vec<SeenSet>,
    pub(super) has_camera: bool,
    /// Position of the agent on the plan of its level.
    pub(super) position: Option<SystemFactory<PositionAndHeight>>,
    /// The agent's state for explorers.
    pub(super) cell: Option<SystemFactory<Vec<i32>>>,
    /// The proof about the state of an episode.
    pub(super) proof: Option<ReaderFactory<LevelProof>>,
    /// How the state of an episode is saved and loaded.
    pub(super) snapshot: Option<SnapshotParts>,
    /// How single types are saved and loaded, if the plugin saves all state.
    pub(super) snapshot_parts: Vec<Part>,
    /// Reward systems; the flag says whether the growth of the value is paid.
    pub(super) rewards: Vec<(SystemFactory<f32>, bool)>,
    pub(super) end: Option<SystemFactory<Option<EpisodeEnd>>>,
    /// The reason of an end without the goal.
    pub(super) end_cause: Option<SystemFactory<Option<&'static str>>>,
    /// Ticks after which an episode is truncated.
    pub(super) limit: Option<u32>,
    pub(super) restart: Restart,
    /// Functions that drop all messages of one type each, with the type of its queue.
    pub(super) forgotten: Vec<(TypeId, Arc<dyn Fn(&mut World) + Send + Sync>)>,
    /// Whether each frame ends when the game's tasks have run.
    pub(super) waits_for_tasks: bool,
    pub(super) ready: Option<SystemFactory<bool>>,
    /// Frames that a level may take to load.
    pub(super) patience: u32,
    pub(super) level: Option<SystemFactory<()>>,
    /// Prepares a level that can be played.
    pub(super) loaded: Option<SystemFactory<()>>,
    pub(super) demonstrator: Option<(&'static str, SystemFactory<ActionValue>)>,
    /// The reason for which the demonstrator cannot be asked in states that it has not led to, if there is one.
    pub(super) cannot_be_asked: Option<&'static str>,
    /// Scripted bots beside the demonstrator.
    pub(super) bots: Vec<(&'static str, SystemFactory<ActionValue>)>,
    pub(super) hash: Option<SystemFactory<u64>>,
    /// Changes Bevy's plugins in a window and without.
    pub(super) default_plugins: Option<Arc<dyn Fn(PluginGroupBuilder) -> PluginGroupBuilder + Send + Sync>>,
    pub(super) headless_plugins: Option<Arc<dyn Fn(HeadlessPlugins) -> PluginGroupBuilder + Send + Sync>>,
    /// Factories of the game's own detectors.
    pub(super) detectors: Vec<Arc<dyn Fn() -> Box<dyn Detector> + Send + Sync>>,
    /// Defects that can be planted into it.
    pub(super) defects: Vec<DefectKind>,
}

impl Description {
    /// Returns Bevy's plugins with the game's own settings.
    pub(super) fn changed_plugins(&self, plugins: PluginGroupBuilder) -> PluginGroupBuilder {
        match &self.default_plugins {
            Some(change) => change(plugins),
            None => plugins,
        }
    }

    /// Adds the game's own plugin, which may read a level that an editor has drawn.
    pub(super) fn add_to(&self, game: &ForeignGame, app: &mut App) {
        if let Some(first) = game.editor_level("", 0) {
            app.insert_resource(first.clone());
        }
        (self.plugin)(app);
    }

    /// Returns the input of the agent at this place.
    pub(super) fn input_of(&self, place: usize) -> Input {
        self.agents.input_of(place % self.agents.count(), &self.input)
    }

    /// Returns the input of the agent that is played where one agent is played.
    pub(super) fn first_input(&self) -> Input {
        self.input_of(self.agents.place_after(0))
    }

    /// Returns whether the agent's state is read for explorers, detectors, proofs or snapshots.
    pub(super) fn has_state(&self) -> bool {
        self.position.is_some() || self.cell.is_some() || self.proof.is_some() || self.snapshot.is_some()
    }

    pub(super) fn sensor(&self) -> Sensor {
        match &self.observe {
            Some(system) => Sensor::System(system.make()),
            None if self.paths.is_empty() => Sensor::Nothing,
            None => Sensor::Paths(self.paths.iter().map(|path| ReflectedPath::new(path)).collect()),
        }
    }

    /// Returns the name of the system that observes, for messages.
    pub(super) fn sensor_name(&self) -> &'static str {
        self.observe.as_ref().map_or("of the paths", SystemFactory::name)
    }

    /// Returns why the names of bots cannot tell them apart.
    pub(super) fn problem_of_bots(&self) -> Option<String> {
        let is_demonstrator = |bot: &str| self.demonstrator.as_ref().is_some_and(|(name, _)| *name == bot);
        self.bots.iter().enumerate().find_map(|(place, (bot, _))| {
            let same = if is_demonstrator(bot) {
                "its demonstrator is"
            } else if self.bots[..place].iter().any(|(earlier, _)| earlier == bot) {
                "another `.bot` is"
            } else if NAMES_OF_ALL_GAMES.contains(bot) {
                "a tester of every game is"
            } else {
                return None;
            };
            Some(format!("`.bot` of the game `{}` is named `{bot}`, as {same}: give it another name", self.name))
        })
    }

    pub(super) fn observation(&self) -> ObservationSpace {
        let names = if self.observe.is_some() { &self.names } else { &self.paths };
        let of_sets = self.entities.iter().flat_map(|(slots, _)| slots.names());
        ObservationSpace { names: names.iter().cloned().chain(of_sets).collect() }
    }
}

/// Returns the reason why a game without vector observations cannot be observed. `has_feature` says whether this crate
/// is built with cameras.
pub(super) fn nothing_seen(name: &str, has_camera: bool, has_feature: bool) -> Option<String> {
    match (has_camera, has_feature) {
        (true, true) => None,
        (true, false) => Some(format!(
            "the game `{name}` is seen through its camera alone, which needs the feature `camera` of \
             `playbot`: build with it, or add `.observe` or `.observe_paths`"
        )),
        (false, _) => {
            Some(format!("nothing of the game `{name}` is seen: add `.observe`, `.observe_paths` or `.camera`"))
        }
    }
}

/// Runs before everything that the game does when the program starts.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct BeforeGame;

/// The game, with the systems between it and its agent.
pub(super) struct ForeignPlugin {
    pub(super) game: ForeignGame,
    pub(super) mode: String,
}

impl Plugin for ForeignPlugin {
    fn build(&self, app: &mut App) {
        let description = &self.game.description;
        app.insert_resource(PlayedMode(self.mode.clone()));
        if description.waits_for_tasks {
            app.insert_resource(TasksEndWithFrames);
        }
        description.add_to(&self.game, app);
        if !app.is_plugin_added::<VirtualInputPlugin>() {
            app.add_plugins(VirtualInputPlugin { route: InputRoute::Messages });
        }
        app.init_resource::<LevelSeed>()
            .init_resource::<PlayedAgent>()
            .init_resource::<LevelFromFile>()
            .add_observer(restart::start)
            .add_observer(restart::announce)
            .add_observer(agents::end_agents_along)
            .init_schedule(BeforeGame)
            .add_systems(BeforeGame, note_baseline);
        let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
        app.add_systems(
            decide,
            (
                restart::check.in_set(PlaybotSystems::Load),
                // Each agent has one controller, so the order of the controllers does not matter.
                input::decide.in_set(PlaybotSystems::Decide).ambiguous_with(PlaybotSystems::Decide),
                // No other system presses the inputs of the game's own system.
                input::act
                    .in_set(PlaybotSystems::Act)
                    .after(check_actions)
                    .after(note_actions)
                    .ambiguous_with(PlaybotSystems::Act),
            ),
        )
        .add_systems(judge, observe::read_outcome.before(PlaybotSystems::Judge).run_if(is_tick));
        observe::add_observation(app);
        if description.legal.is_some() {
            input::add_mask(app);
        }
        input::add_rest(app, &description.input);
        #[cfg(feature = "ui")]
        clicks::add_clicks(app, &description.input);
        if description.has_state() {
            observe::add_state(app);
        }
        // A World for a single episode has no use for snapshots.
        if matches!(description.snapshot, Some(SnapshotParts::Whole))
            && !matches!(description.restart, Restart::Rebuild)
        {
            add_whole(app, &description.snapshot_parts);
        }
    }

    fn finish(&self, app: &mut App) {
        let mut order = app.world_mut().resource_mut::<MainScheduleOrder>();
        let startup = order.startup_labels.clone();
        order.startup_labels.insert(0, BeforeGame.intern());
        // The game may have brought a clock of its own.
        allow_whole_frames(app.world_mut());
        app.insert_resource(ForeignCell::new(Foreign::new(&self.game, startup)));
    }
}

/// Marks all current entities as not the game's, and notes the clocks.
fn note_baseline(world: &mut World) {
    let (baseline, clocks) = (Baseline::of(world), ClockSettings::of(world));
    if let Some(cell) = world.get_resource::<ForeignCell>().cloned() {
        let mut foreign = cell.lock();
        (foreign.baseline, foreign.clocks) = (Some(Arc::new(baseline)), Some(clocks));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{eval::blind_bots, game::Game};

    /// A game with actions, and no observation yet.
    fn deaf() -> ForeignGame {
        ForeignGame::new("mole", 1, |_: &mut App| {}).keys([vec![], vec![KeyCode::Space]])
    }

    #[test]
    fn a_camera_stays_said_and_names_the_feature_that_it_needs() {
        let problem = deaf().camera().problem();
        assert!(deaf().camera().tools().pictures.has_camera());
        assert_eq!(problem.is_none(), cfg!(feature = "camera"), "{problem:?}");
        let missing = nothing_seen("mole", true, false).expect("cannot look");
        assert!(missing.contains("`mole`") && missing.contains("the feature `camera` of `playbot`"), "{missing}");
        assert!(nothing_seen("mole", false, true).is_some_and(|text| text.contains("`.camera`")));
        assert_eq!(nothing_seen("mole", true, true), None);
    }

    #[test]
    fn a_name_that_another_bot_has_is_a_problem() {
        let game = deaf().observe(["x"], || [0.0]).bot("idler", || 0);
        let shown = game.clone().demonstrator("digger", || 1);
        assert_eq!(shown.problem(), None);
        let problem = |name| shown.clone().bot(name, || 0).problem().expect("the name is taken");
        let words = "`.bot` of the game `mole` is named `idler`, as another `.bot` is: give it another name";
        assert_eq!(problem("idler"), words);
        assert!(problem("digger").contains("named `digger`, as its demonstrator is"), "{}", problem("digger"));
        assert_eq!(
            game.demonstrator("idler", || 1).problem(),
            Some(words.replace("another `.bot`", "its demonstrator"))
        );
        for name in blind_bots(&deaf()).into_iter().map(|(name, _)| name).chain(NAMES_OF_ALL_GAMES) {
            assert!(problem(name).contains("as a tester of every game is"), "{}", problem(name));
        }
    }

    #[test]
    fn a_game_that_tells_numbers_needs_no_camera_feature() {
        let both = deaf().observe(["x"], || [0.0]).camera();
        assert_eq!(both.problem(), None);
    }
}
