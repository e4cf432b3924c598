//! The description of a foreign game, as a [`Game`].

use std::sync::Arc;

use bevy::{app::PluginGroupBuilder, prelude::*};

use super::{
    demonstrator::ForeignBot, factory::SystemFactory, input::Input, install::ForeignPlugin, paths::ObservedPath,
    place::ForeignPlace, restart_kind::Restart, runtime::Sensor,
};
use crate::{
    defect::DefectKind,
    detector::Detector,
    floor_plan::FloorPlan,
    game::{BotTools, Game, GameTools, HostTools, InputTools, LevelTools, PictureTools, StateTools, TestTools},
};
use bevy_playbot::{
    action::{ActionSpace, ActionValue},
    agent::Agent,
    agent::has_no_actions,
    episode::EpisodeEnd,
    headless_plugins::HeadlessPlugins,
    key_bindings::KeyBindings,
    observation::{ObservationSpace, VectorSensor},
    placement::TickPlacement,
    renewal::Renewal,
};

/// A game without this plugin, with the actions, observations and rewards of its agent: see the
/// [module](crate::foreign).
///
/// Its player and its resources are global, so each World has one arena with one agent. An experiment with more arenas
/// gets more Worlds. Its mode is called `default`.
#[derive(Clone)]
pub struct ForeignGame {
    pub(super) description: Arc<Description>,
}

/// The settings of the builder.
#[derive(Clone)]
pub(super) struct Description {
    pub(super) name: &'static str,
    pub(super) version: u32,
    pub(super) plugin: Arc<dyn Fn(&mut App) + Send + Sync>,
    pub(super) hz: f64,
    pub(super) levels: Option<u64>,
    pub(super) input: Input,
    pub(super) act: Option<SystemFactory<()>>,
    /// Functions that prepare an agent when it is spawned.
    pub(super) agent: Vec<Arc<dyn Fn(&mut EntityWorldMut) + Send + Sync>>,
    /// Names of the values that `observe` returns.
    pub(super) names: Vec<String>,
    pub(super) observe: Option<SystemFactory<Vec<f32>>>,
    pub(super) paths: Vec<String>,
    pub(super) has_camera: bool,
    /// Position of the agent on the plan of its level.
    pub(super) place: Option<SystemFactory<Vec2>>,
    /// The plan of a level.
    pub(super) plan: Option<Arc<dyn Fn(u64) -> FloorPlan + Send + Sync>>,
    /// Reward systems; the flag says whether the growth of the value is paid.
    pub(super) rewards: Vec<(SystemFactory<f32>, bool)>,
    pub(super) end: Option<SystemFactory<Option<EpisodeEnd>>>,
    /// Ticks after which an episode is truncated.
    pub(super) limit: Option<u32>,
    pub(super) restart: Restart,
    pub(super) ready: Option<SystemFactory<bool>>,
    /// Frames that a level may take to load.
    pub(super) patience: u32,
    pub(super) level: Option<SystemFactory<()>>,
    pub(super) demonstrator: Option<(&'static str, SystemFactory<ActionValue>)>,
    pub(super) hash: Option<SystemFactory<u64>>,
    pub(super) plugins: Option<Arc<dyn Fn(HeadlessPlugins) -> PluginGroupBuilder + Send + Sync>>,
    /// Factories of the game's own detectors.
    pub(super) detectors: Vec<Arc<dyn Fn() -> Box<dyn Detector> + Send + Sync>>,
    /// Defects that can be planted into it.
    pub(super) defects: Vec<DefectKind>,
}

impl Description {
    pub(super) fn sensor(&self) -> Sensor {
        match &self.observe {
            Some(system) => Sensor::System(system.make()),
            None if self.paths.is_empty() => Sensor::Nothing,
            None => Sensor::Paths(self.paths.iter().map(|path| ObservedPath::new(path)).collect()),
        }
    }

    /// Returns the name of the system that observes, for messages.
    pub(super) fn sensor_name(&self) -> &'static str {
        self.observe.as_ref().map_or("of the paths", SystemFactory::name)
    }

    fn observation(&self) -> ObservationSpace {
        let names = if self.observe.is_some() { &self.names } else { &self.paths };
        ObservationSpace { names: names.clone() }
    }
}

impl ForeignGame {
    /// Returns the number of levels, if the game declares it.
    pub fn level_count(&self) -> Option<u64> {
        self.description.levels
    }

    /// Returns the level that is played for this number.
    pub(super) fn level_of(&self, level: u64) -> u64 {
        self.level_count().map_or(level, |levels| level % levels.max(1))
    }
}

/// Returns the reason why a game without vector observations cannot be observed. `has_feature` says whether this crate
/// is built with cameras.
fn nothing_seen(name: &str, has_camera: bool, has_feature: bool) -> Option<String> {
    match (has_camera, has_feature) {
        (true, true) => None,
        (true, false) => Some(format!(
            "the game `{name}` is seen through its camera alone, which needs the feature `camera` of `playbot_lab` (that of \
             `playbot_cli` switches it on): build with it, or add `.observe` or `.observe_paths`"
        )),
        (false, _) => {
            Some(format!("nothing of the game `{name}` is seen: add `.observe`, `.observe_paths` or `.camera`"))
        }
    }
}

impl Game for ForeignGame {
    fn name(&self) -> &'static str {
        self.description.name
    }

    fn version(&self) -> u32 {
        self.description.version
    }

    fn modes(&self) -> &'static [&'static str] {
        &["default"]
    }

    fn tick_hz(&self) -> f64 {
        self.description.hz
    }

    fn built_anew(&self) -> Option<Arc<dyn Game>> {
        matches!(self.description.restart, Restart::Rebuild).then(|| Arc::new(self.clone()) as Arc<dyn Game>)
    }

    fn actions(&self) -> ActionSpace {
        self.description.input.space()
    }

    fn observation(&self) -> ObservationSpace {
        self.description.observation()
    }

    fn build(&self, app: &mut App, _mode: &str) {
        app.add_plugins(ForeignPlugin(self.clone()));
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let sensor = VectorSensor::new(self.description.observation().names);
        let mut agent = world.spawn((Agent::new(index, self.actions()), sensor));
        if let Some(input) = self.description.input.pressed() {
            agent.insert(input);
        }
        self.description.agent.iter().for_each(|equip| equip(&mut agent));
        agent.id()
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools {
            host: self,
            levels: self,
            state: self,
            pictures: self,
            input: self,
            bots: self,
            tests: self,
            ..GameTools::default()
        }
    }
}

impl HostTools for ForeignGame {
    fn placement(&self) -> TickPlacement {
        TickPlacement::Frame
    }

    fn headless_plugins(&self, plugins: HeadlessPlugins) -> PluginGroupBuilder {
        match &self.description.plugins {
            Some(change) => change(plugins),
            None => plugins.build(),
        }
    }

    fn arenas_per_world(&self) -> Option<u32> {
        Some(1)
    }

    fn unplayable(&self) -> Option<String> {
        let Description { name, input, observe, paths, has_camera, names, .. } = &*self.description;
        if let Some(problem) = input.problem() {
            return Some(format!("the game `{name}` {problem}"));
        }
        if has_no_actions(&input.space()) {
            return Some(format!(
                "the game `{name}` has no actions: say what an agent can do, for instance with `.keys`"
            ));
        }
        if observe.is_none() && paths.is_empty() {
            let unseen = nothing_seen(name, *has_camera, cfg!(feature = "camera"));
            if unseen.is_some() {
                return unseen;
            }
        }
        if observe.is_some() && names.is_empty() {
            return Some(format!("`.observe` of the game `{name}` names no values"));
        }
        let is_sound = self.description.hz.is_finite() && self.description.hz > 0.0;
        (!is_sound).then(|| format!("`.hz` of the game `{name}` is {}, not a number of frames", self.description.hz))
    }
}

impl LevelTools for ForeignGame {
    fn floor_plan(&self, _mode: &str, level: u64) -> Option<FloorPlan> {
        self.description.plan.as_ref().map(|plan| plan(self.level_of(level)))
    }
}

impl StateTools for ForeignGame {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        world.get::<ForeignPlace>(agent).map(|place| place.0)
    }
}

impl PictureTools for ForeignGame {
    fn has_camera(&self) -> bool {
        self.description.has_camera
    }
}

impl InputTools for ForeignGame {
    fn action_names(&self) -> Vec<String> {
        self.description.input.names()
    }

    fn key_bindings(&self) -> Option<KeyBindings> {
        self.description.input.bindings()
    }
}

impl BotTools for ForeignGame {
    fn demonstrator(&self) -> Option<&'static str> {
        self.description.demonstrator.as_ref().map(|(name, _)| *name)
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, noise: f64) {
        Renewal::carry_component::<ForeignBot>(world);
        world.entity_mut(agent).insert(ForeignBot { noise });
    }
}

impl TestTools for ForeignGame {
    fn detectors(&self) -> Vec<Box<dyn Detector>> {
        self.description.detectors.iter().map(|make| make()).collect()
    }

    fn defects(&self) -> Vec<DefectKind> {
        self.description.defects.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!(missing.contains("`mole`") && missing.contains("the feature `camera` of `playbot_lab`"), "{missing}");
        assert!(nothing_seen("mole", false, true).is_some_and(|text| text.contains("`.camera`")));
        assert_eq!(nothing_seen("mole", true, true), None);
    }

    #[test]
    fn a_game_that_tells_numbers_needs_no_camera_feature() {
        let both = deaf().observe(["x"], || [0.0]).camera();
        assert_eq!(both.problem(), None);
    }
}
