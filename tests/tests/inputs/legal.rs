//! Tests of action masks of foreign games.

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use bevy::prelude::*;
use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_harness::{
    foreign::{ForeignGame, Restart},
    level_audit::PlainLevels,
    split::LevelSplit,
    worlds::build_world,
};
use playbot_learner::{DeviceKind, PpoConfig};
use playbot_tests::training::untrained;
use playbot_train::{Algorithm, Experiment, Trainer, experiment::file::parse_experiment};

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

/// Checks that each action of a bot, or of the controller that `equip` adds, is the one that is legal in its tick.
fn check(game: &ForeignGame, equip: impl Fn(&mut World, Entity)) {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
    equip(&mut world, agents[0]);
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
fn bots_and_demonstrators_without_noise_take_legal_actions_only() {
    for wanted in 0..3 {
        check(&masked(), |world, agent| {
            world.entity_mut(agent).insert(BlindBot::Constant(ActionValue::Discrete(wanted)));
        });
    }
    let game = masked().demonstrator("lazy", || 0_u32);
    check(&game, |world, agent| game.tools().bots.attach_demonstrator(world, agent, 0.0));
}

#[test]
fn the_noise_of_a_demonstrator_draws_legal_actions_only() {
    let game = masked().demonstrator("lazy", || 0_u32);
    check(&game, |world, agent| game.tools().bots.attach_demonstrator(world, agent, 1.0));
}

#[test]
fn a_policy_takes_legal_actions_only() {
    for draw in [ActionDraw::Sample, ActionDraw::Greedy] {
        check(&masked(), |world, agent| {
            let config = PpoConfig { hidden: vec![8], ..PpoConfig::default() };
            let policy = untrained(&masked(), &ObservationConfig::default(), config);
            ActivePolicy { policy, draw }.install(world, None);
            world.entity_mut(agent).insert(Control::Policy);
        });
    }
}

/// Returns a game whose first two actions take turns in being illegal. It counts ticks with a legal action, and ticks
/// with an illegal one.
fn counting(counted: &Arc<[AtomicU64; 2]>) -> ForeignGame {
    let counts = counted.clone();
    let game = move |app: &mut App| {
        let counted = counts.clone();
        app.insert_resource(Turn(0)).add_systems(Startup, |mut turn: ResMut<Turn>| turn.0 = 0).add_systems(
            Update,
            move |keys: Res<ButtonInput<KeyCode>>, mut turn: ResMut<Turn>| {
                let illegal = if turn.0.is_multiple_of(2) { KeyCode::KeyB } else { KeyCode::KeyA };
                // Frames in which a level loads hold no key.
                if keys.get_pressed().next().is_some() {
                    counted[usize::from(keys.pressed(illegal))].fetch_add(1, Ordering::Relaxed);
                    turn.0 += 1;
                }
            },
        );
    };
    ForeignGame::new("turns", 1, game)
        .keys([vec![KeyCode::KeyA], vec![KeyCode::KeyB], vec![KeyCode::KeyC]])
        .legal(|turn: Res<Turn>| [turn.0.is_multiple_of(2), !turn.0.is_multiple_of(2), true])
        .observe(["turn"], |turn: Res<Turn>| [turn.0 as f32])
        .reward(|keys: Res<ButtonInput<KeyCode>>| f32::from(u8::from(keys.pressed(KeyCode::KeyA))))
        .time_limit(20)
        .restart(Restart::Startup)
}

#[test]
fn an_audit_that_holds_actions_holds_legal_ones_only() {
    let counts: Arc<[AtomicU64; 2]> = Arc::default();
    let levels: LevelSplit = "default:0..3".parse().expect("levels");
    PlainLevels::of(&counting(&counts), &levels, 2, |_| {}).expect("no action is illegal");
    let [legal, illegal] = [0, 1].map(|at: usize| counts[at].load(Ordering::Relaxed));
    // Three actions are held on four levels for 20 ticks.
    assert!(legal > 200, "{legal}");
    assert_eq!(illegal, 0);
}

/// Returns the ticks of a training with a legal action, and those with an illegal one.
fn trained(algorithm: Algorithm) -> [u64; 2] {
    let counts: Arc<[AtomicU64; 2]> = Arc::default();
    let game = counting(&counts);
    let text = r#"(
        game: "turns", train: "default:0..7", test: "default:8..15", steps: 4096, arenas: 2, worlds: 2,
        ppo: (num_steps: 64, minibatches: 2, hidden: [8], lr: 0.003),
        sac: (num_steps: 8, batch: 32, buffer: 1024, learning_starts: 200, hidden: [8], updates_per_step: 0.1),
    )"#;
    let experiment = Experiment { algorithm, ..parse_experiment(text, Path::new("x.ron")).expect("sound") };
    let mut trainer = Trainer::new(&game, &experiment, None, DeviceKind::Flex, 2).expect("it fits");
    while !trainer.is_done() {
        trainer.update().expect("no action is illegal");
    }
    [0, 1].map(|at: usize| counts[at].load(Ordering::Relaxed))
}

#[test]
fn trainings_take_legal_actions_only() {
    for algorithm in [Algorithm::Ppo, Algorithm::Sac] {
        let [legal, illegal] = trained(algorithm);
        assert!(legal > 4000, "{algorithm:?}: {legal}");
        assert_eq!(illegal, 0, "{algorithm:?}");
    }
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
