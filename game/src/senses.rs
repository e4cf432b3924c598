//! Maze games with more observations: the same games, whose agents see goal, walls, a map, or their position in finer
//! detail.
//!
//! In the originals an agent observes its own state only. That is enough on one map, which can be learned by heart. In
//! an unknown maze it leaves nothing but wandering about. [`WithRays`] agents observe the direction of the goal and the
//! distances of walls. They still have to look into dead ends, where a policy without memory stays. [`WithMap`] agents
//! also observe the cells around them. [`WithPositionalEncoding`] agents get no new information: positional encoding
//! only separates positions better, which helps on large maps.

use bevy::prelude::*;
use bevy_playbot::prelude::{Observation, ObservationSpace};
use playbot_harness::{benchmark::Benchmark, game::BenchmarkTools, prelude::*};

/// Observations beside those of the game, the same in every game that has them.
pub trait AddedObservations: Copy + Send + Sync + 'static {
    /// Names of the numbers that are added, in their order.
    fn names(self) -> Vec<String>;
}

/// A game's way to fill them.
pub trait Senses<G>: AddedObservations {
    /// Name of the game with these senses, in files too.
    const NAME: &'static str;
    /// Other names of it on the command line.
    const ALIASES: &'static [&'static str];

    /// Adds systems that add them for every agent that plays and reads a vector, once the game has filled that.
    fn build(self, app: &mut App);
}

/// A game with senses: the inner one in everything but its name and what its agents observe.
#[derive(Clone, Copy, Debug, Default)]
pub struct WithObservations<G, S>(pub G, pub S);

/// No measurements: speed is measured beside the game without these senses.
struct Unmeasured;

impl BenchmarkTools for Unmeasured {
    fn benchmarks(&self) -> Option<Vec<Benchmark>> {
        Some(Vec::new())
    }
}

impl<G: Game, S: Senses<G>> Game for WithObservations<G, S> {
    fn name(&self) -> &'static str {
        S::NAME
    }

    fn aliases(&self) -> &'static [&'static str] {
        S::ALIASES
    }

    fn version(&self) -> u32 {
        self.0.version()
    }

    fn modes(&self) -> &'static [&'static str] {
        self.0.modes()
    }

    fn tick_hz(&self) -> f64 {
        self.0.tick_hz()
    }

    fn actions(&self) -> ActionSpace {
        self.0.actions()
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

    fn tools(&self) -> GameTools<'_> {
        // Traces and experiments of the inner game are written for it by name.
        let GameTools { trace, training, .. } = GameTools::default();
        GameTools { trace, training, benchmarks: &Unmeasured, ..self.0.tools() }
    }
}

// Map of the cells around an agent, as an observation.

/// Cells of the map to each side: in a maze of 9 × 9 cells all free ones, from all but the outermost of them.
pub const REACH: i32 = 5;

/// Adds the observations of [`WithRays`], and the walls among the 11 × 11 cells around the agent.
#[derive(Clone, Copy, Debug, Default)]
pub struct WithMap;

impl AddedObservations for WithMap {
    fn names(self) -> Vec<String> {
        let cells = around().map(|[east, north]| format!("cell {east:+} east {north:+} north"));
        WithRays.names().into_iter().chain(cells).collect()
    }
}

/// Returns the offsets of the map's cells to the east and to the north of the agent's own. Rows go from north to south,
/// each from west to east, as on a map.
fn around() -> impl Iterator<Item = [i32; 2]> {
    (-REACH..=REACH).rev().flat_map(|north| (-REACH..=REACH).map(move |east| [east, north]))
}

/// Adds the map to an observation: 1 for walls and for the outside, 0 for free cells. `is_wall` is called with each
/// offset to the east and to the north.
pub fn push_map(observation: &mut Observation, is_wall: impl Fn([i32; 2]) -> bool) {
    observation.vector.extend(around().map(|cell| f32::from(u8::from(is_wall(cell)))));
}

// Positional encoding: the agent's position in finer detail than two numbers give.

/// Wavelengths, in cells of the maze, which are 1 m wide in Maze2D and 4 m in AntMaze.
pub const LENGTHS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];

/// Adds sine and cosine of the position along x and y, as [positional encoding](Observation::positional_encoding) of
/// [`LENGTHS`].
/// They carry no more information than x and y.
#[derive(Clone, Copy, Debug, Default)]
pub struct WithPositionalEncoding;

impl AddedObservations for WithPositionalEncoding {
    fn names(self) -> Vec<String> {
        ["x", "y"].into_iter().flat_map(|axis| ObservationSpace::positional_encoding_names(axis, LENGTHS)).collect()
    }
}

/// Adds the positional encoding to an observation, in the order of the names. `position` is in cells, along x and y.
pub fn push_positional_encoding(observation: &mut Observation, position: [f64; 2]) {
    observation.vector.extend(position.into_iter().flat_map(|along| Observation::positional_encoding(along, LENGTHS)));
}

// Direction of the goal, and distances of the walls around, as observations.

/// Adds the direction of the goal and the distances of the walls around.
#[derive(Clone, Copy, Debug, Default)]
pub struct WithRays;

impl AddedObservations for WithRays {
    fn names(self) -> Vec<String> {
        let goal = ["goal x", "goal y"].map(str::to_owned);
        let walls = DIRECTIONS.map(|(direction, _)| format!("wall {direction}"));
        goal.into_iter().chain(walls).collect()
    }
}

/// The eight directions of rays, with the components of a step of 1 m to the east and to the north. The first is east,
/// then on by eighths of a turn to the left. North is up in the game's own picture.
pub const DIRECTIONS: [(&str, [f64; 2]); 8] = {
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

/// Adds the goal and the rays to an observation, in the order of the names. First comes the offset of the goal along x
/// and y, then the distance of the nearest wall along each of [`DIRECTIONS`], all in metres. `wall` is called with each
/// direction, east and north.
pub fn push_rays(observation: &mut Observation, to_goal: [f32; 2], wall: impl Fn([f64; 2]) -> f32) {
    observation.vector.extend(to_goal);
    observation.vector.extend(DIRECTIONS.map(|(_, direction)| wall(direction)));
}

#[cfg(test)]
mod tests {
    use playbot_harness::game::Game;

    use super::*;
    use crate::{
        antmaze::{AntMazeWithMap, AntMazeWithPositionalEncoding, AntMazeWithRays},
        maze2d::{Maze2d, Maze2dWithMap, Maze2dWithPositionalEncoding, Maze2dWithRays},
    };

    #[test]
    fn names_are_distinguished_and_go_on_from_those_of_the_game_without_them() {
        let games: [(&dyn Game, [&str; 3], usize); 6] = [
            (&AntMazeWithRays::default(), ["ankle 4 velocity", "goal x", "wall east"], 39),
            (&Maze2dWithRays::default(), ["vy", "goal x", "wall east"], 14),
            (&AntMazeWithMap::default(), ["ankle 4 velocity", "goal x", "wall east"], 160),
            (&Maze2dWithMap::default(), ["vy", "goal x", "wall east"], 135),
            (&AntMazeWithPositionalEncoding::default(), ["ankle 4 velocity", "x sine of 8", "x sine of 4"], 45),
            (&Maze2dWithPositionalEncoding::default(), ["vy", "x sine of 8", "x sine of 4"], 20),
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

    #[test]
    fn tools_are_those_of_the_inner_game_without_what_is_written_for_it_by_name() {
        let (game, with_rays) = (Maze2d::default(), Maze2dWithRays::default());
        let (inner, outer) = (game.tools(), with_rays.tools());
        let mode = "random+size=7x7";
        assert!(game.check_mode(mode).is_ok() && with_rays.check_mode(mode).is_ok());
        assert_eq!(game.layout(mode, 3), with_rays.layout(mode, 3));
        assert_eq!(inner.bots.demonstrator(), outer.bots.demonstrator());
        assert_eq!(inner.levels.floor_plan(mode, 3), outer.levels.floor_plan(mode, 3));
        assert!(inner.training.experiment().is_some() && outer.training.experiment().is_none());
        assert!(inner.benchmarks.benchmarks().is_some_and(|all| !all.is_empty()));
        assert!(outer.benchmarks.benchmarks().is_some_and(|all| all.is_empty()));
    }

    #[test]
    fn a_map_is_read_from_the_north_west_on() {
        let mut observation = Observation::default();
        push_map(&mut observation, |[east, north]| (east, north) == (-5, 5) || (east, north) == (1, 0));
        let walls: Vec<usize> = (0..121).filter(|&at| observation.vector[at] > 0.5).collect();
        assert_eq!((observation.vector.len(), walls.as_slice()), (121, &[0, 61][..]));
        assert_eq!((&*WithMap.names()[10], &*WithMap.names()[71]), ("cell -5 east +5 north", "cell +1 east +0 north"));
    }

    #[test]
    fn ways_go_round_by_eighths_of_a_turn() {
        for (index, (name, [east, north])) in DIRECTIONS.into_iter().enumerate() {
            let angle = std::f64::consts::FRAC_PI_4 * index as f64;
            assert!((east - libm::cos(angle)).abs() < 1e-12 && (north - libm::sin(angle)).abs() < 1e-12, "{name}");
        }
    }
}
