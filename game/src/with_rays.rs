//! Maze games for agents that know where they are: the same games with the goal's direction and the distance of the walls
//! around added to what an agent is told.
//!
//! In the originals an agent knows its own state only. That will do on one map, which can be learned by heart; in a maze
//! that nobody has seen it leaves nothing but wandering about.

use bevy::{app::PluginGroupBuilder, prelude::*};
use bevy_playbot::{headless_plugins::HeadlessPlugins, vision::Picture};
use playbot_lab::prelude::*;
use playbot_lab::{
    benchmark::Benchmark,
    defect::DefectKind,
    detector::Detector,
    floor_plan::FloorPlan,
    inspect::{InspectError, LevelRequest, LevelView},
    level_files::{LevelDesign, LevelTextError},
    mode::ModeError,
    proof::LevelProof,
};

/// The eight ways that rays go, with what a step of 1 m leads to the east and to the north: east, then on by eighths of
/// a turn to the left. North is up in the game's own picture.
pub const WAYS: [(&str, [f64; 2]); 8] = {
    const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [
        ("east", [1.0, 0.0]),
        ("north-east", [DIAGONAL, DIAGONAL]),
        ("north", [0.0, 1.0]),
        ("north-west", [-DIAGONAL, DIAGONAL]),
        ("west", [-1.0, 0.0]),
        ("south-west", [-DIAGONAL, -DIAGONAL]),
        ("south", [0.0, -1.0]),
        ("south-east", [DIAGONAL, -DIAGONAL]),
    ]
};

/// Adds the goal and the rays to an observation, in the order of the names: the way to the goal along x and y, then the
/// distance of the nearest wall along each of [`WAYS`], all in metres. `wall` tells it for one way, east and north.
pub fn push_rays(observation: &mut Observation, to_goal: [f32; 2], wall: impl Fn([f64; 2]) -> f32) {
    observation.vector.extend(to_goal);
    observation.vector.extend(WAYS.map(|(_, way)| wall(way)));
}

/// A game in which agents can be told the way to the goal and the distance of the walls.
pub trait SenseRays: Game {
    /// Name of the game with rays.
    const NAME_WITH_RAYS: &'static str;

    /// Adds a system that calls [`push_rays`] for every agent that plays and reads a vector, once that has been filled.
    fn build_rays(&self, app: &mut App);
}

/// A game with rays: the inner one in everything but its name and what its agents observe.
#[derive(Clone, Copy, Debug, Default)]
pub struct WithRays<G>(pub G);

/// Methods of the inner game that are this game's too.
macro_rules! as_without_rays {
    ($(fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)?;)*) => {
        $(fn $name(&self, $($argument: $type),*) $(-> $result)? {
            self.0.$name($($argument),*)
        })*
    };
}

impl<G: SenseRays> Game for WithRays<G> {
    as_without_rays! {
        fn version() -> u32;
        fn modes() -> &'static [&'static str];
        fn check_mode(mode: &str) -> Result<(), ModeError>;
        fn family(mode: &str) -> String;
        fn fingerprint(mode: &str, level: u64) -> Option<u64>;
        fn parse_level(text: &str) -> Result<LevelDesign, LevelTextError>;
        fn tick_hz() -> f64;
        fn placement() -> TickPlacement;
        fn headless_plugins(usual: HeadlessPlugins) -> PluginGroupBuilder;
        fn arenas_per_world() -> Option<u32>;
        fn problem() -> Option<String>;
        fn actions() -> ActionSpace;
        fn action_names() -> Vec<String>;
        fn key_bindings() -> Option<KeyBindings>;
        fn picture() -> Option<Picture>;
        fn has_camera() -> bool;
        fn build_picture(app: &mut App);
        fn floor_plan(mode: &str, level: u64) -> Option<FloorPlan>;
        fn whereabouts(world: &World, agent: Entity) -> Option<Vec2>;
        fn end_cause(world: &World, agent: Entity) -> Option<&'static str>;
        fn explore_cell(world: &World, agent: Entity) -> Option<Vec<i32>>;
        fn prove(mode: &str, level: u64) -> LevelProof;
        fn prove_from(world: &World, agent: Entity) -> LevelProof;
        fn detectors() -> Vec<Box<dyn Detector>>;
        fn defects() -> Vec<DefectKind>;
        fn blind_bots() -> Vec<(&'static str, BlindBot)>;
        fn demonstrator() -> Option<&'static str>;
        fn attach_demonstrator(world: &mut World, agent: Entity, noise: f64);
        fn show_level(request: &LevelRequest) -> Result<LevelView, InspectError>;
        fn has_space_view() -> bool;
        fn build_space_view(app: &mut App);
    }

    fn name(&self) -> &'static str {
        G::NAME_WITH_RAYS
    }

    fn observation(&self) -> ObservationSpace {
        let goal = ["goal x", "goal y"].map(str::to_owned);
        let walls = WAYS.map(|(way, _)| format!("wall {way}"));
        ObservationSpace { names: self.0.observation().names.into_iter().chain(goal).chain(walls).collect() }
    }

    fn build(&self, app: &mut App, mode: &str) {
        self.0.build(app, mode);
        self.0.build_rays(app);
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let agent = self.0.spawn_agent(world, index);
        world.entity_mut(agent).insert(VectorSensor::new(self.observation().names));
        agent
    }

    fn benchmarks(&self) -> Vec<Benchmark> {
        // Measured beside the game that sees less.
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{antmaze::AntMazeWithRays, maze2d::Maze2dWithRays};

    #[test]
    fn ways_go_round_by_eighths_of_a_turn() {
        for (index, (name, [east, north])) in WAYS.into_iter().enumerate() {
            let angle = std::f64::consts::FRAC_PI_4 * index as f64;
            assert!((east - libm::cos(angle)).abs() < 1e-12 && (north - libm::sin(angle)).abs() < 1e-12, "{name}");
        }
    }

    #[test]
    fn names_are_told_apart_and_go_on_from_those_of_the_game_without_rays() {
        let games: [(&dyn Game, usize); 2] = [(&AntMazeWithRays::default(), 29), (&Maze2dWithRays::default(), 4)];
        for (game, own) in games {
            let names = game.observation().names;
            assert_eq!((names.len(), names[own].as_str(), names[own + 2].as_str()), (own + 10, "goal x", "wall east"));
            let mut different = names.clone();
            different.sort();
            different.dedup();
            assert_eq!(names.len(), different.len(), "{}", game.name());
        }
    }
}
