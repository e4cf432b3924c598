//! Tests of action masks of foreign games.

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use bevy::prelude::*;
use bevy_playbot::{
    action::Actions,
    demo::file::{DemoEpisode, DemoHeader, DemoReader, DemoWriter},
    vision::ObservationConfig,
};
use playbot::prelude::*;
use playbot_harness::{
    foreign::{ForeignGame, Restart},
    level_audit::PlainLevels,
    split::LevelSplit,
    worlds::build_world,
};
use playbot_learner::{Dataset, DeviceKind, Observations, PpoConfig, Rollout, SkillTrainer};
use playbot_tests::{recording::record, training::untrained};
use playbot_train::{
    Algorithm, Experiment, Trainer,
    demo::Demonstrations,
    experiment::file::parse_experiment,
    recordings::read_dataset,
    run_observer::{RunEvent, RunObserver},
};

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
    PlainLevels::of_until(&counting(&counts), &levels, 2, |_| {}, &|| false).expect("no action is illegal");
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
    for part in ["agent 0", "level ", "tick 0", "forbid every action"] {
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

/// A game of ten ticks, in which the first two actions take turns in being illegal.
fn short() -> ForeignGame {
    let game = |app: &mut App| {
        app.insert_resource(Turn(0))
            .add_systems(Startup, |mut turn: ResMut<Turn>| turn.0 = 0)
            .add_systems(Update, |mut turn: ResMut<Turn>| turn.0 += 1);
    };
    ForeignGame::new("turns", 1, game)
        .keys([vec![KeyCode::KeyA], vec![KeyCode::KeyB], vec![KeyCode::KeyC]])
        .legal(|turn: Res<Turn>| mask(turn.0 as f32))
        .observe(["turn"], |turn: Res<Turn>| [turn.0 as f32])
        .reward(|turn: Res<Turn>| f32::from(u8::from(turn.0 % 4 == 1)))
        .time_limit(10)
}

/// Returns the mask of a turn.
fn mask(turn: f32) -> [bool; 3] {
    let is_even = turn % 2.0 == 0.0;
    [is_even, !is_even, true]
}

/// Records four episodes of a random bot, with observations or without, and with this change of each.
fn recorded(folder: &Path, observation_names: Vec<String>, change: impl Fn(usize, &mut DemoEpisode)) {
    let whole = tempfile::tempdir().expect("a folder");
    let (mut world, agents) = build_world(&short(), "default", 5, 0, 1);
    world.entity_mut(agents[0]).insert(BlindBot::Uniform);
    let header = DemoHeader { observation_names, ..short().demo_header("default") };
    record(world, agents[0], header.clone(), &whole.path().join("whole.demo"), 0..4);
    let episodes = DemoReader::open(whole.path().join("whole.demo")).and_then(DemoReader::read_all).expect("whole");
    let mut writer = DemoWriter::create(folder.join("turns.demo"), header).expect("fresh");
    for (index, mut episode) in episodes.into_iter().enumerate() {
        change(index, &mut episode);
        writer.push(&episode).expect("writable");
    }
}

fn demonstrations(folder: &Path) -> Demonstrations {
    Demonstrations::read(&short(), &ObservationConfig::default(), folder, None).expect("readable")
}

/// Returns the rollouts of recordings with this change.
fn rollouts(change: impl Fn(usize, &mut DemoEpisode)) -> Vec<Rollout> {
    let folder = tempfile::tempdir().expect("a folder");
    recorded(folder.path(), Vec::new(), change);
    demonstrations(folder.path()).rollouts(&short(), 2, |_| {}).expect("they replay")
}

/// Returns the masks of these observations.
fn masks_of(turns: &Observations) -> Vec<bool> {
    let Observations::Vector(turns) = turns else { panic!("a turn is a number") };
    turns.iter().flat_map(|turn| mask(*turn)).collect()
}

#[test]
fn recordings_with_rewards_have_the_masks_of_their_ticks() {
    let rollouts = rollouts(|_, _| {});
    assert_eq!(rollouts.len(), 4);
    for rollout in &rollouts {
        // The outcome of the last of ten ticks is not recorded.
        assert_eq!((rollout.rows(), rollout.legal.len()), (9, 27));
        assert_eq!(rollout.legal, masks_of(&rollout.obs));
        assert_eq!(rollout.ends.next_legal, masks_of(&rollout.ends.next_obs));
    }
}

#[test]
fn a_recorded_action_counts_as_legal_in_its_tick() {
    let expected = rollouts(|_, _| {}).remove(0).legal;
    let illegal = expected[..3].iter().position(|is_legal| !is_legal).expect("one of the first two") as u32;
    let pressed = rollouts(|index, episode| {
        if let (0, Actions::Discrete(actions)) = (index, &mut episode.actions) {
            actions[0] = illegal;
        }
    });
    assert_eq!(pressed[0].legal[..3], [true; 3]);
    assert_eq!(pressed[0].legal[3..], expected[3..]);
}

fn dataset(folder: &Path) -> Dataset {
    demonstrations(folder).dataset(&short(), 2, |_| {}).expect("they replay")
}

#[test]
fn skills_are_learned_with_the_masks_of_recordings_with_observations_and_without() {
    let (bare, full) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    recorded(bare.path(), Vec::new(), |_, _| {});
    recorded(full.path(), short().observation().names, |_, _| {});
    let [bare, full] = [bare, full].map(|folder| dataset(folder.path()));
    assert!(bare.has_masks());
    assert_eq!((bare.unmasked(), &bare), (0, &full));
}

/// Counts episodes whose masks are not known.
#[derive(Default)]
struct Unmasked(Vec<(usize, usize)>);

impl RunObserver for Unmasked {
    fn observe(&mut self, event: RunEvent<'_>) {
        if let RunEvent::MasksUnknown { episodes, of } = event {
            self.0.push((episodes, of));
        }
    }
}

fn experiment(algorithm: Algorithm) -> Experiment {
    let text = r#"(
        game: "turns", train: "default:0..7", test: "default:8..15", demos: "unused", steps: 2048, arenas: 2, worlds: 2,
        skills: (window: 5, batch: 4, hidden: [8, 8], encoder_hidden: 8, gru_hidden: 8, latent: 2),
        sac: (num_steps: 8, batch: 32, buffer: 1024, learning_starts: 200, hidden: [8], updates_per_step: 0.1),
    )"#;
    Experiment { algorithm, ..parse_experiment(text, Path::new("x.ron")).expect("sound") }
}

#[test]
fn where_recorded_observations_do_not_replay_everything_is_legal_and_that_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let damage = |index: usize, episode: &mut DemoEpisode| episode.state_hashes[3] ^= u32::from(index == 2);
    recorded(folder.path(), short().observation().names, damage);
    let mut heard = Unmasked::default();
    let dataset = read_dataset(&short(), &experiment(Algorithm::BehaviourCloning), folder.path(), 2, &mut heard)
        .expect("observed");
    assert_eq!((dataset.has_masks(), dataset.unmasked()), (true, 1));
    assert_eq!(heard.0, [(1, 4)]);
}

#[test]
fn ticks_with_one_legal_action_teach_a_skill_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    recorded(folder.path(), Vec::new(), |_, episode| episode.actions = Actions::Discrete(vec![2; 10]));
    let likelihood = |game: &ForeignGame| {
        let dataset = demonstrations(folder.path()).dataset(game, 1, |_| {}).expect("keys change nothing");
        let config = experiment(Algorithm::BehaviourCloning).skills;
        let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("windows fit");
        trainer.train_batch().expect("finite").nll
    };
    let (one, two) = (likelihood(&short().legal(|| [false, false, true])), likelihood(&short()));
    assert!(one.abs() < 1e-5, "the only legal action is certain: {one}");
    assert!(two > 0.5, "one of two was taken in five ticks: {two}");
}

#[test]
fn rlpd_learns_from_recordings_with_masks() {
    let demos = rollouts(|_, _| {});
    let experiment = experiment(Algorithm::Rlpd);
    let trainer = |demos: &[Rollout]| {
        let mut trainer = Trainer::with_demos(&short(), &experiment, None, demos, DeviceKind::Flex, 2).expect("fits");
        let mut last = String::new();
        while !trainer.is_done() {
            last = format!("{:?}", trainer.update().expect("no action is illegal").learner);
        }
        last
    };
    let unmasked = |rollout: &Rollout| {
        let mut rollout = rollout.clone();
        (rollout.legal, rollout.ends.next_legal) = (Vec::new(), Vec::new());
        rollout
    };
    let without: Vec<Rollout> = demos.iter().map(unmasked).collect();
    assert_eq!(trainer(&demos), trainer(&demos));
    assert_ne!(trainer(&demos), trainer(&without), "the masks of recordings count");
}
