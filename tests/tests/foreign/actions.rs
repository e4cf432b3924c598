//! Tests of actions that reach a game without keys, and of decisions that hold for several ticks.

use bevy::{input::mouse::AccumulatedMouseMotion, prelude::*};
use bevy_playbot::{
    demo::file::{Decider, DemoEpisode, DemoReader, DemoWriter},
    engine::PressesForPeople,
    policy::Decision,
    virtual_input::ActionAxis,
    vision::ObservationConfig,
};
use playbot::prelude::*;
use playbot_harness::{demo::verify_file, foreign::ForeignGame, worlds::build_world};
use playbot_learner::{DeviceKind, PpoConfig};
use playbot_tests::{
    foreign::catch::{Paddle, game},
    training::untrained,
};
use playbot_train::{Trainer, experiment::file::parse_experiment};
use std::path::Path;

/// Returns the position of the paddle after three ticks of this action.
fn paddle_after(game: &ForeignGame, control: Control, action: ActionValue) -> Vec2 {
    assert_eq!(game.problem(), None);
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((control, BlindBot::Constant(action), LevelQueue::Always(3)));
    world.ticks(3).expect("sound");
    let mut paddles = world.query_filtered::<&Transform, With<Paddle>>();
    paddles.single(&world).expect("one paddle").translation.truncate()
}

#[test]
fn a_system_of_the_game_hands_the_action_on() {
    fn hand_on(agent: Single<&Action, With<Agent>>, mut paddle: Single<&mut Transform, With<Paddle>>) {
        if agent.0 == ActionValue::Discrete(1) {
            paddle.translation.x += 0.5;
        }
    }
    let handed = ForeignGame::new("handed", 1, game)
        .actions(ActionSpace::Discrete(2), hand_on)
        .observe(["x"], |paddle: Single<&Transform, With<Paddle>>| [paddle.translation.x]);
    let after = |control, index| paddle_after(&handed, control, ActionValue::Discrete(index)).x;
    assert_eq!(after(Control::Bot, 1), 5.5, "half a column in each of three ticks");
    assert_eq!(after(Control::Bot, 0), 4.0);
    assert_eq!(after(Control::Human, 1), 4.0, "people have devices of their own");
}

#[test]
fn axes_move_the_mouse_and_a_stick() {
    fn slide(
        mouse: Res<AccumulatedMouseMotion>,
        pad: Option<Single<&Gamepad>>,
        mut paddle: Single<&mut Transform, With<Paddle>>,
    ) {
        paddle.translation.x += mouse.delta.x;
        paddle.translation.y += pad.and_then(|pad| pad.get(GamepadAxis::LeftStickX)).unwrap_or(0.0);
    }
    let slid = ForeignGame::new("slid", 1, |app: &mut App| {
        game(app);
        app.add_systems(PostUpdate, slide);
    });
    let slid = slid
        .axes([ActionAxis::mouse_x(2.0), ActionAxis::stick(GamepadAxis::LeftStickX)])
        .observe(["x"], |paddle: Single<&Transform, With<Paddle>>| [paddle.translation.x]);
    let after = |mouse, stick| paddle_after(&slid, Control::Bot, ActionValue::Continuous(vec![mouse, stick]));
    assert_eq!(after(0.25, 0.0), Vec2::new(5.5, 0.0), "half a pixel to the right in each of three ticks");
    assert_eq!(after(0.0, -0.5), Vec2::new(4.0, -1.5));
}

/// The numbers of ticks in which the right arrow was held, and in which it was newly pressed.
#[derive(Resource, Default)]
struct Presses {
    held: u32,
    new: u32,
}

/// Returns a game with three actions, whose decisions hold for so many ticks.
fn slow(ticks: u32) -> ForeignGame {
    fn count(keys: Res<ButtonInput<KeyCode>>, mut presses: ResMut<Presses>) {
        presses.held += u32::from(keys.pressed(KeyCode::ArrowRight));
        presses.new += u32::from(keys.just_pressed(KeyCode::ArrowRight));
    }
    let game = |app: &mut App| {
        app.init_resource::<Presses>().add_systems(Update, count);
    };
    ForeignGame::new("slow", 1, game)
        .keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
        .observe(["held"], |presses: Res<Presses>| [presses.held as f32])
        .every(ticks)
}

/// Returns the actions of 24 ticks of a bot in this game.
fn played(game: &ForeignGame, equip: impl Fn(&mut World, Entity)) -> Vec<u32> {
    assert_eq!(game.problem(), None);
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(3)));
    equip(&mut world, agents[0]);
    let mut next = || {
        world.tick().expect("the held action is legal");
        world.get::<Action>(agents[0]).and_then(Action::discrete).expect("a choice")
    };
    (0..24).map(|_| next()).collect()
}

/// Checks that all actions of four ticks from a decision on are equal, and that some decisions differ.
fn check_held(actions: &[u32]) {
    for decision in actions.chunks(4) {
        assert!(decision.iter().all(|action| *action == decision[0]), "{actions:?}");
    }
    assert!(actions.iter().any(|action| *action != actions[0]), "{actions:?}");
}

#[test]
fn random_bots_hold_each_decision_for_its_ticks() {
    for bot in [BlindBot::Uniform, BlindBot::Chaos] {
        let actions = played(&slow(4), |world, agent| {
            world.entity_mut(agent).insert(bot.clone());
        });
        for decision in actions.chunks(4) {
            assert!(decision.iter().all(|action| *action == decision[0]), "{bot:?}: {actions:?}");
        }
    }
}

#[test]
fn a_demonstrator_holds_each_decision_for_its_ticks_with_noise_and_without() {
    let game = slow(4).demonstrator("counter", |mut ticks: Local<u32>| {
        *ticks += 1;
        (*ticks / 3) % 3
    });
    for noise in [0.0, 0.5] {
        check_held(&played(&game, |world, agent| game.tools().bots.attach_demonstrator(world, agent, noise)));
    }
}

#[test]
fn a_legal_action_that_becomes_illegal_holds_until_the_next_decision() {
    let game = slow(4).legal(|presses: Res<Presses>| [false, presses.held > 0, presses.held == 0]);
    let actions = played(&game, |world, agent| {
        world.entity_mut(agent).insert(BlindBot::Uniform);
    });
    assert_eq!(actions[..8], [2, 2, 2, 2, 1, 1, 1, 1]);
}

#[test]
fn a_held_key_is_pressed_once() {
    let game = slow(4).legal(|| [false, false, true]);
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(3)));
    world.ticks(8).expect("sound");
    let presses = world.resource::<Presses>();
    assert_eq!((presses.held, presses.new), (8, 1));
}

#[test]
fn a_policy_holds_each_decision_with_certainty() {
    let game = slow(4);
    let config = PpoConfig { hidden: vec![8], ..PpoConfig::default() };
    let policy = untrained(&game, &ObservationConfig::default(), config);
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    ActivePolicy { policy, draw: ActionDraw::Sample }.install(&mut world, None);
    world.entity_mut(agents[0]).insert((Control::Policy, LevelQueue::Always(3)));
    let mut actions = Vec::new();
    for tick in 0..40 {
        world.tick().expect("the policy fits");
        let decision = world.get::<Decision>(agents[0]).expect("an agent");
        assert_eq!(decision.log_prob == 0.0, tick % 4 != 0, "tick {tick}: {decision:?}");
        actions.push(world.get::<Action>(agents[0]).and_then(Action::discrete).expect("a choice"));
    }
    check_held(&actions);
}

/// Returns a game that is steered by two numbers, each of which holds for four ticks.
fn steered() -> ForeignGame {
    fn note(agent: Single<&Action, With<Agent>>, mut last: ResMut<Steered>) {
        if let ActionValue::Continuous(numbers) = &agent.0 {
            last.0.clone_from(numbers);
        }
    }
    ForeignGame::new("steered", 1, |app: &mut App| {
        app.init_resource::<Steered>();
    })
    .actions(ActionSpace::Continuous(2), note)
    .observe(["x"], |last: Res<Steered>| [last.0.first().copied().unwrap_or(0.0)])
    .demonstrator("swing", |mut ticks: Local<u32>| {
        *ticks += 1;
        let angle = (*ticks % 7) as f32 / 7.0;
        [angle, -angle]
    })
    .every(4)
}

#[derive(Resource, Default)]
struct Steered(Vec<f32>);

#[test]
fn numbers_hold_until_the_next_decision_whoever_decides() {
    let game = steered();
    assert_eq!(game.problem(), None);
    let observation = ObservationConfig::default();
    let policy = untrained(&game, &observation, PpoConfig { hidden: vec![8], ..PpoConfig::default() });
    let players: [(&str, &dyn Fn(&mut World, Entity)); 5] = [
        ("random", &|world, agent| {
            world.entity_mut(agent).insert(BlindBot::Uniform);
        }),
        ("chaos", &|world, agent| {
            world.entity_mut(agent).insert(BlindBot::Chaos);
        }),
        ("demonstrator", &|world, agent| game.tools().bots.attach_demonstrator(world, agent, 0.0)),
        ("noise", &|world, agent| game.tools().bots.attach_demonstrator(world, agent, 0.5)),
        ("policy", &|world, agent| {
            ActivePolicy { policy: policy.clone(), draw: ActionDraw::Sample }.install(world, None);
            world.entity_mut(agent).insert(Control::Policy);
        }),
    ];
    for (name, equip) in players {
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(3)));
        equip(&mut world, agents[0]);
        let mut actions = Vec::new();
        for tick in 0..24 {
            world.tick().expect("the held numbers are legal");
            let decision = world.get::<Decision>(agents[0]).expect("an agent");
            assert!(name != "policy" || (decision.log_prob == 0.0) == (tick % 4 != 0), "tick {tick}: {decision:?}");
            let action = world.get::<Action>(agents[0]).expect("an agent").0.clone();
            assert_eq!(action, ActionValue::Continuous(world.resource::<Steered>().0.clone()), "{name}, tick {tick}");
            actions.push(action);
        }
        for decision in actions.chunks(4) {
            assert!(decision.iter().all(|action| *action == decision[0]), "{name}: {actions:?}");
        }
        assert!(actions.iter().any(|action| *action != actions[0]), "{name}: {actions:?}");
    }
}

#[test]
fn sac_refuses_numbers_that_are_held_and_says_what_learns_them() {
    let text =
        r#"(game: "steered", train: "default:0..9", test: "default:10..19", steps: 4096, arenas: 2, algorithm: "sac")"#;
    let experiment = parse_experiment(text, Path::new("steered.ron")).expect("valid");
    let mut trainer = Trainer::new(&steered().time_limit(50), &experiment, None, DeviceKind::Flex, 1).expect("fits");
    let updates = std::iter::from_fn(|| (!trainer.is_done()).then(|| trainer.update().err()));
    let text = updates.flatten().next().expect("refused").to_string();
    assert!(text.contains("numbers that the game holds for several ticks") && text.contains("ppo"), "{text}");
}

#[test]
fn decisions_that_cannot_hold_are_problems_that_say_what_to_type() {
    let problem = slow(0).problem().expect("no tick is a decision");
    assert!(problem.contains("`slow`") && problem.contains("type `.every(1)`"), "{problem}");
    assert_eq!(slow(1).problem(), None);
}

#[test]
fn keys_are_held_for_the_first_ticks_of_each_decision_and_then_pressed_anew() {
    let game = slow(4).hold(2).legal(|| [false, false, true]);
    assert_eq!(game.problem(), None);
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(3)));
    let mut held = Vec::new();
    for _ in 0..8 {
        world.tick().expect("sound");
        held.push(world.resource::<Presses>().held);
        assert_eq!(world.get::<Action>(agents[0]).and_then(Action::discrete), Some(2), "the decision stays");
    }
    assert_eq!(held, [1, 2, 2, 2, 3, 4, 4, 4]);
    assert_eq!(world.resource::<Presses>().new, 2);
}

/// Records an episode of twelve ticks that holds the right arrow, in a game whose decisions hold keys for two of four
/// ticks. Returns the number of ticks in which it was held, and the divergences of replays of the changed recording.
fn replayed(control: Control, change: impl Fn(&mut DemoEpisode)) -> (u32, Vec<(u64, String)>) {
    let game = slow(4).hold(2).time_limit(12).level(|mut presses: ResMut<Presses>| *presses = Presses::default());
    let folder = tempfile::tempdir().expect("a folder");
    let [whole, path] = ["whole.demo", "changed.demo"].map(|name| folder.path().join(name));
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.insert_resource(Recorder::new(DemoWriter::create(&whole, game.demo_header("default")).expect("fresh")));
    let right = ActionValue::Discrete(2);
    let bot = (BlindBot::Constant(right.clone()), LevelQueue::Always(0));
    world.entity_mut(agents[0]).insert((control, PressesForPeople, Recording::default(), bot));
    for _ in 0..12 {
        world.entity_mut(agents[0]).insert(Action(right.clone()));
        world.tick().expect("sound");
    }
    let held = world.resource::<Presses>().held;
    drop(world);
    let mut writer = DemoWriter::create(&path, game.demo_header("default")).expect("fresh");
    for mut episode in DemoReader::open(&whole).and_then(DemoReader::read_all).expect("whole") {
        assert_eq!(episode.len(), 12);
        change(&mut episode);
        writer.push(&episode).expect("writable");
    }
    let report = verify_file(&game, &path, |_| {}).expect("readable");
    assert_eq!(report.episodes, 1);
    (held, report.divergences)
}

#[test]
fn recordings_of_keys_that_are_let_go_replay() {
    assert_eq!(replayed(Control::Bot, |_| {}), (6, Vec::new()));
}

#[test]
fn people_hold_keys_as_long_as_they_please_and_so_do_replays_of_their_recordings() {
    let (held, divergences) = replayed(Control::Human, |_| {});
    assert!(held > 10, "{held}");
    assert!(divergences.is_empty(), "{divergences:?}");
    let (_, divergences) = replayed(Control::Human, |episode| episode.deciders.fill(Decider::Bot));
    assert_eq!(divergences.len(), 1, "a bot would have let them go");
}

#[test]
fn keys_that_cannot_be_held_so_long_are_problems_that_say_what_to_type() {
    let problem = |game: ForeignGame| game.problem().expect("it cannot be held");
    assert!(problem(slow(4).hold(0)).contains("the game `slow` has `.hold(0)`"));
    assert!(problem(slow(4).hold(0)).contains("type `.hold(1)`"));
    let text = problem(slow(4).hold(5));
    assert!(text.contains("a decision of `.every(4)` ends before: type `.hold(4)` or less"), "{text}");
    let short = ForeignGame::new("short", 1, |_: &mut App| {}).observe(["x"], || [0.0]);
    let text = problem(short.clone().keys([[KeyCode::KeyA]]).hold(2));
    assert!(text.contains("a decision is one tick: add `.every`") && text.contains("`.every(4)`"), "{text}");
    let text = problem(short.actions(ActionSpace::Discrete(2), || {}).every(4).hold(2));
    assert!(text.contains("`.hold` and `.actions`") && text.contains("leave `.hold` out"), "{text}");
    assert_eq!(slow(4).hold(4).problem(), None);
}
