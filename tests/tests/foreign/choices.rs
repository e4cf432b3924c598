//! A game in which several choices are made at once and a number beside them: played, recorded, learned and tested.

use bevy::prelude::*;
use bevy_playbot::{
    action::Actions,
    demo::file::{DemoEpisode, DemoReader, DemoWriter},
    virtual_input::ActionAxis,
    vision::ObservationConfig,
};
use playbot::prelude::*;
use playbot_harness::{
    demo::verify_file,
    eval::{EvalPlan, Player, evaluate},
    foreign::{ForeignGame, LevelSeed, Restart},
    single_actions::single_actions,
    worlds::build_world,
};
use playbot_learner::{DeviceKind, ppo::LabelledSteps};
use playbot_tests::training::{check_resuming, last_success_rate};
use playbot_train::{Experiment, Trainer, demo::Demonstrations, experiment::file::parse_experiment};
use std::path::Path;

/// Rooms until the end.
const ROOMS: u32 = 8;

/// A hall of rooms. Each asks for a side, for a jump or none, and for a stick in one half. An agent that does all three
/// in one tick gets into the next room. The episode ends when time runs out.
#[derive(Resource, Default, Clone)]
struct Hall {
    seed: u32,
    room: u32,
}

impl Hall {
    fn wanted(&self) -> ([u32; 2], f32) {
        let mixed = (self.seed + self.room * 7).wrapping_mul(0x9e37_79b9) >> 16;
        ([mixed % 3, (mixed / 3) % 2], if (mixed / 6).is_multiple_of(2) { 1.0 } else { -1.0 })
    }

    fn seen(&self) -> [f32; 5] {
        let ([side, jump], half) = self.wanted();
        let of = |number: u32| f32::from(u8::from(side == number));
        [of(0), of(1), of(2), jump as f32, half]
    }
}

fn game(app: &mut App) {
    fn advance(keys: Res<ButtonInput<KeyCode>>, pads: Query<&Gamepad>, mut hall: ResMut<Hall>) {
        let side = match (keys.pressed(KeyCode::ArrowLeft), keys.pressed(KeyCode::ArrowRight)) {
            (true, _) => 1,
            (_, true) => 2,
            _ => 0,
        };
        let stick = pads.iter().find_map(|pad| pad.get(GamepadAxis::RightStickX)).unwrap_or(0.0);
        let ([wanted, jump], half) = hall.wanted();
        if side == wanted && keys.pressed(KeyCode::Space) == (jump == 1) && stick * half > 0.0 {
            hall.room += 1;
        }
    }
    app.init_resource::<Hall>().add_systems(Update, advance);
}

fn hall() -> ForeignGame {
    let walk = vec![vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]];
    let jump = vec![vec![], vec![KeyCode::Space]];
    let game = ForeignGame::new("hall", 1, game).choices([walk, jump]).separately();
    game.axes([ActionAxis::stick(GamepadAxis::RightStickX)])
        .observe(["stand", "left", "right", "jump", "half"], |hall: Res<Hall>| hall.seen())
        .reward_delta(|hall: Res<Hall>| hall.room as f32)
        .end(|hall: Res<Hall>| (hall.room >= ROOMS).then_some(EpisodeEnd::WON))
        .demonstrator("guide", |hall: Res<Hall>| {
            let (choices, half) = hall.wanted();
            (choices, [0.5 * half])
        })
        .restart(Restart::system(|seed: Res<LevelSeed>, mut hall: ResMut<Hall>| {
            *hall = Hall { seed: seed.0 as u32, room: 0 };
        }))
        .time_limit(40)
}

#[test]
fn keys_of_every_choice_and_the_stick_are_held_together() {
    let game = hall();
    assert_eq!(game.problem(), None);
    assert_eq!(Game::actions(&game), ActionSpace::mixed([3, 2], 1));
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    let (choices, half) = Hall { seed: 5, room: 0 }.wanted();
    let right = ActionValue::Mixed { choices: choices.to_vec(), numbers: vec![half] };
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Constant(right), LevelQueue::Always(5)));
    // On this route a game sees the stick of the frame before.
    world.ticks(2).expect("sound");
    assert!(world.resource::<Hall>().room > 0);
    // Two idle options, three others, and two ends of the number.
    let ways: Vec<usize> = single_actions(&game).iter().map(|single| single.ways.len()).collect();
    assert_eq!(ways, [1, 1, 1, 1, 1, 2]);
}

/// Records two levels of the demonstrator with noise, and returns the episodes after a check that they replay.
fn recorded(game: &ForeignGame, path: &Path) -> Vec<DemoEpisode> {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    world.insert_resource(Recorder::new(DemoWriter::create(path, game.demo_header("default")).expect("fresh")));
    game.tools().bots.attach_demonstrator(&mut world, agents[0], 0.3);
    world.entity_mut(agents[0]).insert((Control::Bot, Recording::default(), LevelQueue::list([3, 4])));
    while world.get::<Control>(agents[0]) != Some(&Control::Idle) {
        world.tick().expect("sound");
    }
    drop(world);
    let report = verify_file(game, path, |_| {}).expect("readable");
    assert_eq!((report.episodes, report.divergences), (2, Vec::new()));
    DemoReader::open(path).and_then(DemoReader::read_all).expect("whole")
}

#[test]
fn a_demonstrator_records_what_replays_and_wins() {
    let game = hall();
    let plan = EvalPlan::of_bot("default:0..19".parse().expect("levels"), 4, 2);
    let results = evaluate(&game, &Player::Demonstrator, &plan, |_| {}).expect("it plays");
    assert!(results.iter().all(|result| result.success), "{results:?}");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hall.demo");
    let episodes = recorded(&game, &path);
    assert!(episodes.iter().all(|episode| matches!(episode.actions, Actions::Mixed { choices: 2, dim: 1, .. })));
}

fn trainer(game: &ForeignGame, steps: u64, threads: usize) -> Trainer {
    let text = r#"(game: "hall", train: "default:0..199", test: "default:200..299", steps: 32768, arenas: 8,
        algorithm: "ppo", ppo: (num_steps: 128, minibatches: 8, epochs: 8, hidden: [32], lr: 0.005, gamma: 0.8, ent_coef: 0.0))"#;
    let experiment = parse_experiment(text, Path::new("hall.ron")).expect("valid");
    let experiment = Experiment { steps, ..experiment };
    Trainer::new(game, &experiment, None, DeviceKind::Flex, threads).expect("fits")
}

#[test]
fn ppo_learns_to_make_all_choices() {
    let rate = last_success_rate(trainer(&hall(), 32_768, 2)).expect("episodes ended");
    assert!(rate > 0.9, "{rate}");
}

/// The hall for agents that decide in every third tick: options and number hold in between.
fn slow_hall() -> ForeignGame {
    hall().every(3).time_limit(60)
}

#[test]
fn ppo_learns_from_the_ticks_in_which_it_decides() {
    let game = slow_hall();
    assert_eq!(game.problem(), None);
    let rate = last_success_rate(trainer(&game, 65_536, 2)).expect("episodes ended");
    assert!(rate > 0.9, "{rate}");
}

#[test]
fn a_recording_of_held_actions_says_which_ticks_were_decisions() {
    let game = slow_hall();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hall.demo");
    let episodes = recorded(&game, &path);
    for episode in &episodes {
        for tick in (0..episode.len()).filter(|tick| tick % 3 != 0) {
            assert_eq!(episode.actions.get(tick), episode.actions.get(tick - 1), "tick {tick}");
        }
    }
    let demos = Demonstrations::read(&game, &ObservationConfig::default(), &path, None).expect("readable");
    let dataset = demos.dataset(&game, 1, |_| {}).expect("replays");
    let steps = LabelledSteps::of(&dataset).expect("of one kind");
    let free: Vec<bool> = steps.legal.chunks(6).map(|row| row[5]).collect();
    let ticks = episodes.iter().flat_map(|episode| 0..episode.len());
    assert_eq!(free, ticks.map(|tick| tick % 3 == 0).collect::<Vec<_>>());
}

#[test]
fn stops_and_threads_change_nothing() {
    for game in [hall(), slow_hall()] {
        check_resuming(&game, |threads| trainer(&game, 4096, threads), 2);
    }
}

#[test]
fn choices_that_cannot_be_made_at_once_are_problems_that_say_what_to_type() {
    let game = || ForeignGame::new("hop", 1, |_: &mut App| {}).observe(["x"], || [0.0]);
    let jump = || vec![vec![], vec![KeyCode::Space]];
    let problem = |game: ForeignGame| game.problem().expect("it cannot be played");
    let text = problem(game().separately().keys([vec![], vec![KeyCode::Space]]));
    assert!(text.contains("`.separately` and no `.choices`"), "{text}");
    let text = problem(game().choices(vec![jump(); 17]).separately());
    assert!(text.contains("17 choices separately, and 16 are possible"), "{text}");
    let text = problem(game().choices([jump(), vec![]]).separately());
    assert!(text.contains("nothing to choose in choice 1"), "{text}");
    let text = problem(game().choices([jump(), jump()]).separately().clicks(["Start"]));
    assert!(text.contains("leave `.separately` out"), "{text}");
    let text = problem(game().choices([jump(), jump()]).axes([ActionAxis::mouse_x(1.0)]));
    assert!(text.contains("`.choices` and `.axes`"), "{text}");
}
