//! Sets of things that the agent of a foreign game sees, such as enemies or coins.

use crate::foreign::{
    ForeignGame,
    runtime::{OwnedSystem, SystemFactory},
};
use bevy::prelude::*;
use bevy_playbot::entities::{EntitySlots, SeenThing};

/// The things of a set that a game's system returns: each with its distance, by which the nearest are kept, and its
/// numbers.
pub trait IntoThings: 'static {
    /// Returns the things in any order.
    fn into_things(self) -> Vec<SeenThing>;
}

impl<const N: usize> IntoThings for Vec<(f32, [f32; N])> {
    fn into_things(self) -> Vec<SeenThing> {
        self.into_iter().map(|(distance, numbers)| (distance, numbers.to_vec())).collect()
    }
}

impl IntoThings for Vec<SeenThing> {
    fn into_things(self) -> Vec<SeenThing> {
        self
    }
}

/// A set with the factory of its system.
pub(super) type SeenSet = (EntitySlots, SystemFactory<Vec<SeenThing>>);

impl ForeignGame {
    /// Adds a set of things to the observation, behind the values of [`observe`](Self::observe): up to `slots` of them, each
    /// with these numbers. The system returns all things, each with a distance. If there are more than slots, the nearest
    /// are kept. Policies read the set without regard to the order of its slots. Several calls add up.
    ///
    /// The system may run more than once in a tick, so it must change nothing. A thing with another number of numbers, or
    /// with one that is not finite, is a fault that names it.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// #[derive(Component)]
    /// struct Hero;
    ///
    /// #[derive(Component)]
    /// struct Coin;
    ///
    /// fn coins(
    ///     hero: Single<&Transform, With<Hero>>,
    ///     coins: Query<&Transform, With<Coin>>,
    /// ) -> Vec<(f32, [f32; 2])> {
    ///     let to = |coin: &Transform| (coin.translation - hero.translation).truncate() / 100.0;
    ///     coins.iter().map(to).map(|to| (to.length(), to.to_array())).collect()
    /// }
    ///
    /// let game = ForeignGame::new("walk", 1, |_: &mut App| {})
    ///     .keys([vec![], vec![KeyCode::Space]])
    ///     .observe(["x"], |hero: Single<&Transform, With<Hero>>| [hero.translation.x / 100.0])
    ///     .entities("coin", 2, ["dx", "dy"], coins);
    /// assert_eq!(game.problem(), None);
    /// assert_eq!(game.observation().names[..3], ["x", "coin[0].present", "coin[0].dx"]);
    /// assert_eq!(game.observation().sets()[0].to_string(), "coin: up to 2 with dx, dy");
    /// ```
    pub fn entities<Things: IntoThings, M: 'static>(
        self,
        name: &str,
        slots: usize,
        fields: impl IntoIterator<Item = impl Into<String>>,
        system: impl IntoSystem<(), Things, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        let slots = EntitySlots::new(name, slots, fields);
        self.with(|description| description.entities.push((slots, SystemFactory::new(system, Things::into_things))))
    }
}

/// Returns why policies could not read the sets of a game, if they could not.
pub(super) fn problem_of(sets: &[SeenSet]) -> Option<String> {
    let twice = |place: usize, name: &str| sets[..place].iter().any(|(earlier, _)| earlier.name() == name);
    sets.iter().enumerate().find_map(|(place, (slots, _))| match slots.problem() {
        None if twice(place, slots.name()) => Some(format!("two sets are called `{}`", slots.name())),
        problem => problem,
    })
}

/// Adds the values of all sets.
///
/// # Errors
///
/// The system that cannot run, or the thing that does not fit, in words.
pub(super) fn write_all(
    sets: &mut [(EntitySlots, OwnedSystem<Vec<SeenThing>>)],
    world: &mut World,
    values: &mut Vec<f32>,
) -> Result<(), String> {
    sets.iter_mut().try_for_each(|(slots, system)| slots.write(&mut system.demand(world)?, values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{prelude::*, worlds::build_world};

    #[derive(Resource)]
    struct Around(Vec<(f32, Vec<f32>)>);

    fn game(around: &[(f32, &[f32])]) -> ForeignGame {
        let around: Vec<(f32, Vec<f32>)> = around.iter().map(|(far, numbers)| (*far, numbers.to_vec())).collect();
        ForeignGame::new("meadow", 1, move |app: &mut App| _ = app.insert_resource(Around(around.clone())))
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.25])
            .entities("sheep", 2, ["dx", "wool"], |around: Res<Around>| around.0.clone())
            .time_limit(50)
    }

    /// Returns the observation after some ticks, or the fault.
    fn seen(game: &ForeignGame) -> Result<Vec<f32>, String> {
        let (mut world, agents) = build_world(game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1])));
        for _ in 0..8 {
            world.tick().map_err(|fault| fault.to_string())?;
        }
        Ok(world.get::<Observation>(agents[0]).expect("every agent has one").vector.clone())
    }

    #[test]
    fn the_nearest_things_stand_behind_the_values() {
        let flock: [(f32, &[f32]); 3] = [(3.0, &[3.0, 0.5]), (1.0, &[-1.0, 0.75]), (9.0, &[9.0, 0.0])];
        assert_eq!(seen(&game(&flock)), Ok(vec![0.25, 1.0, -1.0, 0.75, 1.0, 3.0, 0.5]));
        assert_eq!(seen(&game(&flock[..1])), Ok(vec![0.25, 1.0, 3.0, 0.5, 0.0, 0.0, 0.0]));
        assert_eq!(seen(&game(&[])), Ok(vec![0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let alone = ForeignGame::new("dark", 1, |_: &mut App| {}).keys([vec![], vec![KeyCode::Space]]).entities(
            "sheep",
            1,
            ["dx"],
            || vec![(1.0, [2.0])],
        );
        assert_eq!((alone.problem(), seen(&alone)), (None, Ok(vec![1.0, 2.0])));
    }

    #[test]
    fn faults_name_the_game_the_set_and_the_thing() {
        let fault = |around: &[(f32, &[f32])]| seen(&game(around)).expect_err("a fault");
        let text = fault(&[(1.0, &[1.0, 2.0]), (1.0, &[1.0])]);
        assert!(
            text.contains("the game `meadow`") && text.contains("thing 1 of the set `sheep` has 1 numbers"),
            "{text}"
        );
        let text = fault(&[(1.0, &[f32::INFINITY, 2.0])]);
        assert!(text.contains("`dx` of thing 0 of the set `sheep` is inf"), "{text}");
    }

    #[test]
    fn sets_that_cannot_be_read_are_a_problem_of_the_game() {
        let problem = |name: &str, slots| {
            game(&[]).entities(name, slots, ["dx"], || vec![(1.0, [2.0])]).problem().expect("a problem")
        };
        assert!(problem("sheep", 2).contains("the game `meadow`: two sets are called `sheep`"));
        assert!(problem("dog", 0).contains("the set `dog` has no slots"));
    }
}
