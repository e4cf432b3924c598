//! A game whose agents are told more than the game tells them.

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

/// What agents are told beside what a game tells them: the same in every game that has it.
pub trait Told: Copy + Send + Sync + 'static {
    /// Names of the numbers that are added, in their order.
    fn names(self) -> Vec<String>;
}

/// How a game tells it.
pub trait Senses<G>: Told {
    /// Name of the game with these senses.
    const NAME: &'static str;

    /// Adds systems that add them for every agent that plays and reads a vector, once the game has filled that.
    fn build(self, app: &mut App);
}

/// A game with senses: the inner one in everything but its name and what its agents observe.
#[derive(Clone, Copy, Debug, Default)]
pub struct WithSenses<G, S>(pub G, pub S);

/// Methods of the inner game that are this game's too.
macro_rules! as_without_senses {
    ($(fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)?;)*) => {
        $(fn $name(&self, $($argument: $type),*) $(-> $result)? {
            self.0.$name($($argument),*)
        })*
    };
}

impl<G: Game, S: Senses<G>> Game for WithSenses<G, S> {
    as_without_senses! {
        fn version() -> u32;
        fn modes() -> &'static [&'static str];
        fn check_mode(mode: &str) -> Result<(), ModeError>;
        fn family(mode: &str) -> String;
        fn last_level() -> Option<u64>;
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
        S::NAME
    }

    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: self.0.observation().names.into_iter().chain(self.1.names()).collect() }
    }

    fn build(&self, app: &mut App, mode: &str) {
        self.0.build(app, mode);
        self.1.build(app);
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
    use crate::{
        antmaze::{AntMazeWithMap, AntMazeWithRays, AntMazeWithWaves},
        maze2d::{Maze2dWithMap, Maze2dWithRays, Maze2dWithWaves},
    };
    use playbot_lab::game::Game;

    #[test]
    fn names_are_told_apart_and_go_on_from_those_of_the_game_that_tells_less() {
        let games: [(&dyn Game, [&str; 3], usize); 6] = [
            (&AntMazeWithRays::default(), ["ankle 4 velocity", "goal x", "wall east"], 39),
            (&Maze2dWithRays::default(), ["vy", "goal x", "wall east"], 14),
            (&AntMazeWithMap::default(), ["ankle 4 velocity", "goal x", "wall east"], 160),
            (&Maze2dWithMap::default(), ["vy", "goal x", "wall east"], 135),
            (&AntMazeWithWaves::default(), ["ankle 4 velocity", "x sine of 8", "x sine of 4"], 45),
            (&Maze2dWithWaves::default(), ["vy", "x sine of 8", "x sine of 4"], 20),
        ];
        for (game, [last, first, third], all) in games {
            let names = game.observation().names;
            let at = names.iter().position(|name| name == first).expect("a sense");
            assert_eq!([&*names[at - 1], &*names[at + 2]], [last, third], "{}", game.name());
            let mut different = names.clone();
            different.sort();
            different.dedup();
            assert_eq!((names.len(), different.len()), (all, all), "{}", game.name());
        }
    }
}
