//! Tests of values that each level of a foreign game draws.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::{
    demo::file::{DemoReader, DemoWriter},
    level::RandomisedValues,
    vision::ObservationConfig,
};
use playbot::prelude::*;
use playbot_harness::{
    demo::{EpisodeReplayer, demonstration::DemonstrationPlan, verify_file},
    eval::Player,
    foreign::{ForeignGame, Restart},
    randomise::Randomise,
    worlds::{build_world, check_randomised},
};

/// Metres per tick and tick.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct Gravity(f32);

#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct Stones {
    count: u32,
    name: String,
}

/// The gravity that the start of the level has seen.
#[derive(Resource)]
struct SeenAtStart(f32);

#[derive(Component, Default, Reflect)]
#[reflect(Component)]
struct Stone {
    speed: f32,
}

/// A stone that falls for five ticks. The restart does not touch the gravity.
fn fall(restart: Restart) -> ForeignGame {
    let game = |app: &mut App| {
        app.insert_resource(Gravity(10.0))
            .insert_resource(Stones { count: 3, name: "pebble".to_owned() })
            .register_type::<Gravity>()
            .register_type::<Stones>()
            .register_type::<Stone>()
            .add_systems(Startup, |mut commands: Commands, gravity: Res<Gravity>| {
                commands.spawn((Stone::default(), Transform::default()));
                commands.insert_resource(SeenAtStart(gravity.0));
            })
            .add_systems(FixedUpdate, |gravity: Res<Gravity>, stone: Single<(&mut Stone, &mut Transform)>| {
                let (mut stone, mut at) = stone.into_inner();
                stone.speed -= gravity.0;
                at.translation.y += stone.speed;
            });
    };
    ForeignGame::new("fall", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe_paths(["Stone.Transform.translation.y", "Gravity.0"])
        .time_limit(5)
        .restart(restart)
}

fn drawn() -> Randomise {
    Randomise::default().with("Gravity.0".to_owned(), "0.8..1.2".parse().expect("factors"))
}

/// Plays levels in one World, and returns the gravity of each, as the game has it and as the agent has it.
fn gravities(game: &ForeignGame, randomise: &Randomise, levels: &[u64]) -> Vec<(f32, Option<f64>)> {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    randomise.install(&mut world);
    let bot = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list(levels)));
    let mut found = Vec::new();
    while Control::of(&world, agents[0]).is_active() {
        world.tick().expect("sound");
        if world.get::<Episode>(agents[0]).is_some_and(|episode| episode.is_running() && episode.tick == 1) {
            assert_eq!(world.resource::<SeenAtStart>().0, 10.0, "a restart finds the game's own value");
            let values = world.get::<RandomisedValues>(agents[0]);
            found.push((world.resource::<Gravity>().0, values.map(|values| values.0[0].value)));
        }
    }
    found
}

#[test]
fn a_level_has_its_values_in_any_world_and_order() {
    for restart in [Restart::Startup, Restart::Rebuild] {
        let game = fall(restart);
        let played = gravities(&game, &drawn(), &[4, 5, 4]);
        assert_eq!((played.len(), played[0]), (3, played[2]));
        assert_ne!(played[0], played[1]);
        assert!(played.iter().all(|(own, said)| (8.0..12.0).contains(own) && *said == Some(f64::from(*own))));
        assert_eq!(gravities(&game, &drawn(), &[5])[0], played[1]);
        assert_eq!(gravities(&game, &Randomise::default(), &[4]), [(10.0, None)]);
    }
}

#[test]
fn a_recording_replays_with_the_values_that_it_says() {
    let (folder, game) = (tempfile::tempdir().expect("a folder"), fall(Restart::Startup));
    let path = folder.path().join("fall.demo");
    let plan = DemonstrationPlan {
        mode: "default".to_owned(),
        levels: vec![4, 5, 6],
        noise: 0.0,
        seed: 1,
        steps: None,
        keep_observations: true,
        randomise: drawn(),
    };
    let writer = DemoWriter::create(&path, plan.header(&game)).expect("writable");
    let player = Player::Blind(BlindBot::Uniform);
    let (mut world, agent) =
        plan.build_world_of(&game, &player, &ObservationConfig::default(), writer).expect("vectors");
    while Control::of(&world, agent).is_active() {
        world.tick().expect("sound");
    }
    drop(world);
    let reader = DemoReader::open(&path).expect("readable");
    assert_eq!(reader.header().format, 3);
    let episodes = reader.read_all().expect("whole");
    let said: Vec<f32> = episodes.iter().map(|episode| episode.randomised[0].value as f32).collect();
    assert_eq!(said, gravities(&game, &drawn(), &[4, 5, 6]).iter().map(|(own, _)| *own).collect::<Vec<_>>());
    assert!(episodes.iter().zip(&said).all(|(episode, gravity)| episode.observations[1] == *gravity));
    let report = verify_file(&game, &path, |_| {}).expect("readable");
    assert_eq!((report.episodes, report.divergences), (3, Vec::new()));
    // Without its values, or with others, it is another episode.
    let mut replayer = EpisodeReplayer::new(&game, "default");
    let mut plain = episodes[0].clone();
    plain.randomised.clear();
    assert!(replayer.play(Arc::new(plain), |_, _| {}).expect("sound").is_some());
    assert_eq!(replayer.play(Arc::new(episodes[0].clone()), |_, _| {}).expect("sound"), None);
}

#[test]
fn paths_that_lead_to_no_number_are_named_with_the_reason() {
    let game = fall(Restart::Startup);
    for (path, words) in [
        ("Gravitas.0", "the path `Gravitas.0` of `randomise` names neither"),
        ("Gravity.7", "the path `Gravity.7` of `randomise` leads nowhere"),
        ("Stones.name", "the path `Stones.name` of `randomise` leads to a String, which is not a number"),
    ] {
        let randomise = Randomise::default().with(path.to_owned(), "0.8..1.2".parse().expect("factors"));
        let fault = check_randomised(&randomise, &game, "default", 0).expect_err("no number").to_string();
        assert!(fault.contains(words), "{fault}");
    }
    assert_eq!(check_randomised(&drawn(), &game, "default", 0), Ok(()));
    // Components of an entity, and whole numbers, which are rounded.
    let more = drawn().with("Stones.count".to_owned(), "2..2".parse().expect("factors"));
    let more = more.with("Stone.Transform.scale.x".to_owned(), "3..3".parse().expect("factors"));
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    more.install(&mut world);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(0)));
    world.tick().expect("they lead to numbers");
    assert_eq!(world.resource::<Stones>().count, 6);
    let scale = world.query_filtered::<&Transform, With<Stone>>().single(&world).expect("a stone").scale;
    assert_eq!(scale, Vec3::new(3.0, 1.0, 1.0));
}
