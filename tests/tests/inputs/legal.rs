//! Tests of action masks of foreign games.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{foreign::ForeignGame, worlds::build_world};

/// The number of ticks that the game has run.
#[derive(Resource)]
struct Turn(u32);

/// A game with three actions, of which the first one is never legal, and the others take turns.
fn turns() -> ForeignGame {
    let game = |app: &mut App| {
        app.insert_resource(Turn(0)).add_systems(Update, |mut turn: ResMut<Turn>| turn.0 += 1);
    };
    ForeignGame::new("turns", 1, game)
        .keys([vec![KeyCode::KeyA], vec![KeyCode::KeyB], vec![KeyCode::KeyC]])
        .observe(["turn"], |turn: Res<Turn>| [turn.0 as f32])
}

/// Checks that each action of a bot is the one that is legal in its tick.
fn check(game: &ForeignGame, equip: impl Fn(&mut World, Entity)) {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    equip(&mut world, agents[0]);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
    for _ in 0..20 {
        world.tick().expect("one action is legal");
        // The turn that the agent has seen is the one before the game's system has run.
        let turn = world.resource::<Turn>().0 - 1;
        let action = world.get::<Action>(agents[0]).and_then(Action::discrete);
        assert_eq!(action, Some(1 + turn % 2), "turn {turn}");
    }
}

fn masked() -> ForeignGame {
    turns().legal(|turn: Res<Turn>| [false, turn.0.is_multiple_of(2), !turn.0.is_multiple_of(2)])
}

#[test]
fn random_bots_take_legal_actions_only() {
    for bot in [BlindBot::Uniform, BlindBot::Chaos] {
        check(&masked(), |world, agent| {
            world.entity_mut(agent).insert(bot.clone());
        });
    }
}

#[test]
fn the_noise_of_a_demonstrator_draws_legal_actions_only() {
    let game = masked().demonstrator("lazy", || 0_u32);
    check(&game, |world, agent| game.tools().bots.attach_demonstrator(world, agent, 1.0));
}

#[test]
fn a_mask_that_forbids_everything_is_a_fault_with_agent_and_tick() {
    let game = turns().legal(|| vec![false; 3]);
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(0)));
    let text = world.tick().expect_err("none is legal").to_string();
    for part in ["agent 0", "tick 0", "forbid every action"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}

#[test]
fn a_mask_of_another_length_is_a_fault_with_its_length() {
    let game = turns().legal(|| [true, true]);
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(0)));
    let text = world.tick().expect_err("one is missing").to_string();
    assert!(text.contains("2 entries") && text.contains("give each action one"), "{text}");
}
