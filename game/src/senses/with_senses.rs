//! A game whose agents are told more than the game tells them.

use bevy::prelude::*;
use playbot_lab::prelude::*;
use playbot_lab::{benchmark::Benchmark, game::BenchmarkTools};

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

/// No measurements: speed is measured beside the game without these senses.
struct Unmeasured;

impl BenchmarkTools for Unmeasured {
    fn benchmarks(&self) -> Option<Vec<Benchmark>> {
        Some(Vec::new())
    }
}

impl<G: Game, S: Senses<G>> Game for WithSenses<G, S> {
    fn name(&self) -> &'static str {
        S::NAME
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

#[cfg(test)]
mod tests {
    use crate::{
        antmaze::{AntMazeWithMap, AntMazeWithRays, AntMazeWithWaves},
        maze2d::{Maze2d, Maze2dWithMap, Maze2dWithRays, Maze2dWithWaves},
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

    #[test]
    fn tools_are_those_of_the_inner_game_without_what_is_written_for_it_by_name() {
        let (game, with_rays) = (Maze2d::default(), Maze2dWithRays::default());
        let (inner, outer) = (game.tools(), with_rays.tools());
        let mode = "random+size=7x7";
        assert!(game.check_mode(mode).is_ok() && with_rays.check_mode(mode).is_ok());
        assert_eq!(game.fingerprint(mode, 3), with_rays.fingerprint(mode, 3));
        assert_eq!(inner.bots.demonstrator(), outer.bots.demonstrator());
        assert_eq!(inner.levels.floor_plan(mode, 3), outer.levels.floor_plan(mode, 3));
        assert!(inner.training.experiment().is_some() && outer.training.experiment().is_none());
        assert!(inner.benchmarks.benchmarks().is_some_and(|all| !all.is_empty()));
        assert!(outer.benchmarks.benchmarks().is_some_and(|all| all.is_empty()));
    }
}
