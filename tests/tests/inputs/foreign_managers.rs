//! Tests of foreign games whose agents drive the actions of an input manager, to which no key is bound.

use bevy::prelude::*;
use bevy_playbot::virtual_input::{
    InputRoute,
    enhanced_input::{EnhancedAction, EnhancedActionPlugin},
    leafwing::{LeafwingActions, LeafwingActionsPlugin},
};
use playbot::prelude::*;
use playbot_harness::{
    foreign::{ForeignGame, Restart},
    worlds::build_world,
};

/// The walker.
#[derive(Component)]
struct Hero;

/// Adds the shared rules of both games: they are won at 3, and time is up after 9 ticks.
fn adapted(game: ForeignGame, restart: Restart) -> ForeignGame {
    game.actions(ActionSpace::Discrete(2), || {})
        .observe(["x"], |hero: Single<&Transform, With<Hero>>| [hero.translation.x])
        .end(|hero: Single<&Transform, With<Hero>>| (hero.translation.x >= 3.0).then_some(EpisodeEnd::WON))
        .time_limit(9)
        .restart(restart)
}

/// Returns the lengths of two episodes with this action.
fn lengths(game: &ForeignGame, action: u32) -> Vec<u32> {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    let bot = BlindBot::Constant(ActionValue::Discrete(action));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list([1, 2])));
    let (mut lengths, mut ticks) = (Vec::new(), 0);
    while lengths.len() < 2 {
        world.tick().expect("sound");
        ticks += 1;
        if world.get::<EpisodeCount>(agents[0]).expect("an agent").finished > lengths.len() as u64 {
            lengths.push(std::mem::take(&mut ticks));
        }
    }
    lengths
}

/// Checks both restarts: with the same agent, and with one that is spawned again.
fn check(game: impl Fn(Restart) -> ForeignGame) {
    for restart in [Restart::Startup, Restart::Rebuild] {
        let game = game(restart);
        assert_eq!(game.problem(), None);
        assert_eq!(lengths(&game, 1), [3, 3], "a step in each tick");
        assert_eq!(lengths(&game, 0), [9, 9], "it stays where it is");
    }
}

mod leafwing {
    use leafwing_input_manager::{Actionlike, action_state::ActionState, plugin::InputManagerPlugin};

    use super::*;

    #[derive(Actionlike, Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
    enum Move {
        Forward,
    }

    /// The game, as its author wrote it.
    fn game(app: &mut App) {
        app.add_plugins(InputManagerPlugin::<Move>::default())
            .add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Hero, Transform::default(), ActionState::<Move>::default()));
            })
            .add_systems(Update, |hero: Single<(&ActionState<Move>, &mut Transform), With<Hero>>| {
                let (state, mut place) = hero.into_inner();
                place.translation.x += f32::from(u8::from(state.pressed(&Move::Forward)));
            });
    }

    #[test]
    fn actions_of_leafwing_input_manager_are_driven_by_the_agents_component() {
        check(|restart| {
            let game = ForeignGame::new("forward", 1, |app: &mut App| {
                app.add_plugins((game, LeafwingActionsPlugin::<Move>::new(InputRoute::Messages)));
            });
            let game = game.agent(|agent| {
                agent.insert(LeafwingActions::default().press(Move::Forward, [1]));
            });
            adapted(game, restart)
        });
    }
}

mod enhanced {
    use bevy_enhanced_input::prelude::{Action, EnhancedInputPlugin, InputAction, InputContextAppExt, actions};

    use super::*;

    #[derive(InputAction)]
    #[action_output(bool)]
    struct Forward;

    /// The game, as its author wrote it.
    fn game(app: &mut App) {
        app.add_plugins(EnhancedInputPlugin)
            .add_input_context::<Hero>()
            .add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Hero, Transform::default(), actions!(Hero[Action::<Forward>::new()])));
            })
            .add_systems(Update, |forward: Single<&Action<Forward>>, mut hero: Single<&mut Transform, With<Hero>>| {
                hero.translation.x += f32::from(u8::from(***forward));
            });
    }

    #[test]
    fn actions_of_bevy_enhanced_input_are_driven_by_the_agents_component() {
        check(|restart| {
            let game = ForeignGame::new("forward", 1, |app: &mut App| {
                app.add_plugins((game, EnhancedActionPlugin::<Forward>::new(InputRoute::Messages)));
            });
            let game = game.agent(|agent| {
                agent.insert(EnhancedAction::<Forward>::per_action([false, true]));
            });
            adapted(game, restart)
        });
    }
}
