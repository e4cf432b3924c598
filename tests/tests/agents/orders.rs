//! Tests that no schedule has our systems in an ambiguous order: neither those of Bevy's own systems, nor those in
//! which a tick is a frame.

use bevy::prelude::*;
use bevy_playbot::{
    engine::{leave_open, set_tick_rate},
    headless::HeadlessPlugins,
    test_app::PlaybotTestExt,
    virtual_input::{
        InputRoute, VirtualInput, VirtualInputPlugin,
        enhanced_input::EnhancedActionPlugin,
        leafwing::{LeafwingActions, LeafwingActionsPlugin},
    },
    vision::{ObservationConfig, ObservationKind},
};
use playbot::prelude::*;
use playbot_games::GAMES;
use playbot_harness::worlds::{build_observing_world, build_world};
use playbot_tests::{
    corridor_plugin,
    foreign::{catch::catch_game, rooms::rooms_game},
    spawn_walker,
};

/// Crates whose systems are checked.
const OURS: [&str; 6] =
    ["bevy_playbot", "playbot_games", "playbot_harness", "playbot_mutation", "playbot_test", "playbot_train"];

const NONE: [&str; 0] = [];

/// Returns an app with all shipped parts, after some ticks.
fn shipped(placement: TickPlacement, more: impl FnOnce(&mut App)) -> App {
    let plugins = PlaybotPlugins::new("corridor", 3);
    let mut app = App::new();
    app.add_plugins((
        HeadlessPlugins::default(),
        if placement == TickPlacement::Frame { plugins.in_frames() } else { plugins },
    ));
    app.add_plugins(corridor_plugin);
    more(&mut app);
    set_tick_rate(&mut app, 60.0);
    let agent = spawn_walker(app.world_mut(), 0);
    let pressed = VirtualInput::keys([vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight], vec![]]);
    app.world_mut().entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, pressed));
    app.finish();
    app.cleanup();
    app.ticks(5).expect("sound");
    app
}

#[test]
fn in_games_that_ship_with_agents() {
    for placement in [TickPlacement::Fixed, TickPlacement::Frame] {
        assert_eq!(shipped(placement, |_| {}).ambiguous_orders(&OURS), NONE, "{placement:?}");
    }
}

#[test]
fn with_input_managers() {
    use leafwing_input_manager::prelude::*;

    #[derive(Actionlike, Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
    enum Move {
        Jump,
    }

    #[derive(bevy_enhanced_input::prelude::InputAction)]
    #[action_output(bool)]
    struct Leap;

    for (placement, route) in [(TickPlacement::Fixed, InputRoute::Direct), (TickPlacement::Frame, InputRoute::Messages)]
    {
        let app = shipped(placement, |app| {
            assert!(app.is_plugin_added::<VirtualInputPlugin>(), "they are added after it");
            app.add_plugins((
                InputManagerPlugin::<Move>::default(),
                LeafwingActionsPlugin::<Move>::new(route),
                bevy_enhanced_input::EnhancedInputPlugin,
                EnhancedActionPlugin::<Leap>::new(route),
            ));
            let _ = LeafwingActions::default().press(Move::Jump, [1]);
        });
        assert_eq!(app.ambiguous_orders(&OURS), NONE, "{placement:?}");
    }
}

/// Returns the ambiguities in a World after some ticks of random play.
fn open_after(ticks: u64, (mut world, agents): (World, Vec<Entity>)) -> Vec<String> {
    leave_open(&mut world);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform));
    world.ticks(ticks).expect("sound");
    world.ambiguous_orders(&OURS)
}

#[test]
fn in_worlds_of_foreign_games() {
    for game in [catch_game(), rooms_game()] {
        let built = build_world(&game, "default", 1, 0, 1);
        assert_eq!(open_after(5, built), NONE, "{}", game.name());
    }
}

#[test]
fn in_worlds_of_all_games_with_pictures_and_without() {
    for (game, kind) in
        GAMES.iter().flat_map(|game| [ObservationKind::Vector, ObservationKind::Raster].map(|kind| (game, kind)))
    {
        let config = ObservationConfig { kind, ..default() };
        let built = match build_observing_world(*game, game.modes()[0], &config, 1, 0, 1) {
            Ok(built) => built,
            Err(_) if kind == ObservationKind::Raster => continue,
            Err(error) => panic!("{}: {error}", game.name()),
        };
        assert_eq!(open_after(3, built), NONE, "{} {kind}", game.name());
    }
}

#[test]
fn two_systems_in_no_order_are_found() {
    #[derive(Resource, Default)]
    struct Score(u32);
    fn earn(mut score: ResMut<Score>) {
        score.0 += 1;
    }
    fn double(mut score: ResMut<Score>) {
        score.0 *= 2;
    }
    let mut app = headless_app();
    app.init_resource::<Score>().add_systems(PreUpdate, (earn, double));
    assert_eq!(app.ambiguous_orders(&["agents"]), NONE, "nothing has run");
    app.ticks(1).expect("sound");
    let found = app.ambiguous_orders(&["agents"]);
    let [pair] = found.as_slice() else { panic!("{found:?}") };
    for part in ["PreUpdate", "::earn`", "::double`", "::Score"] {
        assert!(pair.contains(part), "`{part}` is missing in: {pair}");
    }
    assert_eq!(app.ambiguous_orders(&["order", "bevy_playbot"]), NONE, "of other crates");
}
