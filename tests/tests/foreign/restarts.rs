//! Tests that messages and removed components of an episode do not count in the next one.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{
    eval::{EvalPlan, Player, evaluate},
    foreign::{ForeignGame, Restart},
    worlds::build_world,
};
use playbot_tests::measuring::plan;

/// State of the game.
#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum Stage {
    #[default]
    Play,
}

#[derive(Component)]
struct Hero;

/// The hero is no longer there.
#[derive(Message)]
struct Died;

/// Deaths that the game has counted.
#[derive(Resource, Default)]
struct Deaths(usize);

/// A game in which nothing dies, except at a restart.
fn game(app: &mut App) {
    app.add_message::<Died>()
        .init_state::<Stage>()
        .init_resource::<Deaths>()
        .add_systems(OnEnter(Stage::Play), spawn)
        .add_observer(|_: On<Remove, Hero>, mut died: MessageWriter<Died>| {
            died.write(Died);
        })
        .add_systems(Update, |mut died: MessageReader<Died>, mut deaths: ResMut<Deaths>| {
            deaths.0 += died.read().count();
        });
}

fn spawn(mut commands: Commands) {
    commands.spawn((Hero, DespawnOnExit(Stage::Play), Transform::default()));
}

/// Returns the adapter, in which a death ends the episode, and a removed hero pays.
fn heroes(restart: Restart) -> ForeignGame {
    let game = |app: &mut App| {
        game(app);
        app.add_systems(Startup, spawn);
    };
    ForeignGame::new("heroes", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["deaths"], |deaths: Res<Deaths>| [deaths.0 as f32])
        .reward(|mut removed: RemovedComponents<Hero>| removed.read().count() as f32)
        .end(|mut died: MessageReader<Died>| (died.read().count() > 0).then_some(EpisodeEnd::LOST))
        .time_limit(4)
        .restart(restart)
}

fn restarts() -> [Restart; 2] {
    [Restart::Startup, Restart::state(Stage::Play)]
}

#[test]
fn deaths_at_a_restart_neither_end_the_next_episode_nor_pay_in_it() {
    for restart in restarts() {
        let plan = EvalPlan { arenas: 1, worlds: 1, threads: 1, ..plan("default:0..9") };
        let player = Player::Blind(BlindBot::Uniform);
        let results = evaluate(&heroes(restart), &player, &plan, |_| {}).expect("can be played");
        let seen: Vec<_> = results.iter().map(|result| (result.ticks, result.total_reward)).collect();
        assert_eq!(seen, [(4, 0.0); 10]);
    }
}

/// Plays three episodes, and returns the deaths that the game has counted.
fn counted(game: &ForeignGame) -> usize {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1, 2, 3])));
    while Control::of(&world, agents[0]).is_active() {
        world.tick().expect("sound");
    }
    world.resource::<Deaths>().0
}

#[test]
fn the_game_itself_reads_messages_of_a_restart_unless_it_forgets_them() {
    for restart in restarts() {
        assert!(counted(&heroes(restart.clone())) >= 3, "a hero for each restart");
        assert_eq!(counted(&heroes(restart).forget_messages::<Died>()), 0);
    }
}

#[test]
fn messages_of_the_start_are_not_forgotten() {
    let greeted = ForeignGame::new("greeted", 1, |app: &mut App| {
        app.add_message::<Died>()
            .init_resource::<Deaths>()
            .add_systems(Startup, |mut died: MessageWriter<Died>| {
                died.write(Died);
            })
            .add_systems(Update, |mut died: MessageReader<Died>, mut deaths: ResMut<Deaths>| {
                deaths.0 += died.read().count();
            });
    });
    let greeted = greeted
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["deaths"], |deaths: Res<Deaths>| [deaths.0 as f32])
        .time_limit(4)
        .forget_messages::<Died>();
    // One of the program's start, and one for each of three episodes.
    assert_eq!(counted(&greeted), 4);
}
