//! Tests of input managers, driven by virtual input: through their keys, and by action.

use bevy::{input::InputPlugin, prelude::*};
use bevy_playbot::{
    prelude::*,
    virtual_input::{
        InputRoute, VirtualInput, VirtualInputPlugin,
        enhanced_input::{EnhancedAction, EnhancedActionPlugin},
        leafwing::{LeafwingActions, LeafwingActionsPlugin},
    },
};

/// The action of the next tick.
#[derive(Resource, Default)]
struct Next(u32);

/// Jumps seen: pressed, and just begun.
#[derive(Resource, Default, Debug, PartialEq)]
struct Jumps(Vec<(bool, bool)>);

fn decide(next: Res<Next>, mut agents: Query<(&Control, &mut Action)>) {
    for (control, mut action) in &mut agents {
        if *control == Control::Bot {
            action.0 = ActionValue::Discrete(next.0);
        }
    }
}

/// Returns an app with an agent that jumps with action 1.
fn app_with(route: InputRoute) -> (App, Entity) {
    let mut app = headless_app();
    app.add_plugins((InputPlugin, VirtualInputPlugin { route }))
        .init_resource::<Next>()
        .init_resource::<Jumps>()
        .add_systems(FixedPreUpdate, decide.in_set(PlaybotSystems::Decide));
    let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Bot)).id();
    (app, agent)
}

/// Plays these actions, a tick each, and returns the game's view of them.
fn play(app: &mut App, actions: &[u32]) -> Vec<(bool, bool)> {
    app.world_mut().resource_mut::<Jumps>().0.clear();
    for &action in actions {
        app.world_mut().resource_mut::<Next>().0 = action;
        app.tick().expect("sound");
    }
    app.world().resource::<Jumps>().0.clone()
}

fn space_jumps() -> VirtualInput {
    VirtualInput::keys([vec![], vec![KeyCode::Space]])
}

mod leafwing {
    use leafwing_input_manager::prelude::*;

    use super::{ActionSpace, *};

    #[derive(Actionlike, Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
    enum Move {
        Jump,
        #[actionlike(Axis)]
        Throttle,
    }

    fn see(states: Query<&ActionState<Move>>, mut jumps: ResMut<Jumps>) {
        for state in &states {
            jumps.0.push((state.pressed(&Move::Jump), state.just_pressed(&Move::Jump)));
        }
    }

    #[test]
    fn keys_drive_its_actions() {
        let (mut app, agent) = app_with(InputRoute::Messages);
        app.add_plugins(InputManagerPlugin::<Move>::default()).add_systems(Update, see);
        app.finish();
        app.world_mut().spawn(InputMap::new([(Move::Jump, KeyCode::Space)]));
        app.world_mut().entity_mut(agent).insert(space_jumps());
        play(&mut app, &[0]);
        // In fixed ticks messages are read in the frame after the decision.
        let seen = play(&mut app, &[1, 1, 0, 0]);
        assert_eq!(seen, [(false, false), (true, true), (true, false), (false, false)]);
    }

    #[test]
    fn actions_are_driven_without_keys_in_their_own_tick() {
        for has_keys in [false, true] {
            let (mut app, agent) = app_with(InputRoute::Direct);
            app.add_plugins((InputManagerPlugin::<Move>::default(), LeafwingActionsPlugin::<Move>::default()))
                .add_systems(FixedUpdate, see);
            app.finish();
            let mut player = app.world_mut().spawn(ActionState::<Move>::default());
            if has_keys {
                player.insert(InputMap::new([(Move::Jump, KeyCode::Space)]));
            }
            app.world_mut().entity_mut(agent).insert(LeafwingActions::default().press(Move::Jump, [1]));
            let seen = play(&mut app, &[0, 1, 1, 0, 0]);
            let wanted = [(false, false), (true, true), (true, false), (false, false), (false, false)];
            assert_eq!(seen, wanted, "has keys: {has_keys}");
            app.world_mut().entity_mut(agent).insert(Control::Human);
            assert_eq!(play(&mut app, &[1]), [(false, false)], "never for people");
        }
    }

    #[test]
    fn values_set_axes() {
        let (mut app, agent) = app_with(InputRoute::Direct);
        app.add_plugins((InputManagerPlugin::<Move>::default(), LeafwingActionsPlugin::<Move>::default()));
        app.finish();
        let actions = LeafwingActions::default().value(Move::Throttle, 1).press_above(Move::Jump, 0, 0.5);
        let player = app.world_mut().spawn(ActionState::<Move>::default()).id();
        let bot = BlindBot::Constant(ActionValue::Continuous(vec![0.75, -0.25]));
        app.world_mut().entity_mut(agent).insert((Agent::new(0, ActionSpace::Continuous(2)), actions, bot));
        app.world_mut().remove_resource::<Next>();
        app.insert_resource(Next::default());
        app.add_systems(FixedPreUpdate, values.in_set(PlaybotSystems::Decide).after(decide));
        app.add_systems(FixedUpdate, |states: Query<&ActionState<Move>>, mut seen: ResMut<Seen>| {
            seen.0.extend(states.iter().map(|state| (state.value(&Move::Throttle), state.pressed(&Move::Jump))));
        })
        .init_resource::<Seen>();
        app.tick().expect("sound");
        app.tick().expect("sound");
        assert_eq!(app.world().resource::<Seen>().0, [(-0.25, true); 2]);
        assert!(app.world().get_entity(player).is_ok());
    }

    #[derive(Resource, Default)]
    struct Seen(Vec<(f32, bool)>);

    fn values(mut actions: Query<&mut bevy_playbot::action::Action>) {
        for mut action in &mut actions {
            action.0 = ActionValue::Continuous(vec![0.75, -0.25]);
        }
    }

    #[test]
    fn an_agent_without_a_state_to_drive_is_a_fault() {
        let (mut app, agent) = app_with(InputRoute::Direct);
        app.add_plugins((InputManagerPlugin::<Move>::default(), LeafwingActionsPlugin::<Move>::default()));
        app.finish();
        app.world_mut().entity_mut(agent).insert(LeafwingActions::default().press(Move::Jump, [1]));
        let fault = app.tick().expect_err("no state").to_string();
        assert!(fault.contains("agent 0") && fault.contains("ActionState<Move>"), "{fault}");
    }
}

mod enhanced {
    use bevy_enhanced_input::prelude::*;

    use super::*;

    #[derive(Component)]
    struct OnFoot;

    #[derive(InputAction)]
    #[action_output(bool)]
    struct Jump;

    fn see(jumps: Query<(&bevy_enhanced_input::prelude::Action<Jump>, &ActionEvents)>, mut seen: ResMut<Jumps>) {
        for (action, events) in &jumps {
            seen.0.push((**action, events.contains(ActionEvents::START)));
        }
    }

    #[test]
    fn keys_drive_its_actions() {
        let (mut app, agent) = app_with(InputRoute::Messages);
        app.add_plugins(EnhancedInputPlugin).add_input_context::<OnFoot>().add_systems(Update, see);
        app.finish();
        app.world_mut().spawn((
            OnFoot,
            actions!(OnFoot[(bevy_enhanced_input::prelude::Action::<Jump>::new(), bindings![KeyCode::Space])]),
        ));
        app.world_mut().entity_mut(agent).insert(space_jumps());
        play(&mut app, &[0]);
        let seen = play(&mut app, &[1, 1, 0, 0]);
        assert_eq!(seen, [(false, false), (true, true), (true, false), (false, false)]);
    }

    #[test]
    fn actions_are_driven_without_keys_in_their_own_tick() {
        let (mut app, agent) = app_with(InputRoute::Direct);
        app.add_plugins((EnhancedInputPlugin, EnhancedActionPlugin::<Jump>::default()))
            .add_input_context_to::<FixedPreUpdate, OnFoot>()
            .add_systems(FixedUpdate, see);
        app.finish();
        let action = bevy_enhanced_input::prelude::Action::<Jump>::new();
        app.world_mut().spawn((OnFoot, actions!(OnFoot[(action, bindings![KeyCode::Space])])));
        app.world_mut().entity_mut(agent).insert(EnhancedAction::<Jump>::per_action([false, true]));
        let seen = play(&mut app, &[0, 1, 1, 0, 0]);
        assert_eq!(seen, [(false, false), (true, true), (true, false), (false, false), (false, false)]);
        app.world_mut().entity_mut(agent).insert(Control::Human);
        assert_eq!(play(&mut app, &[1]), [(false, false)], "never for people");
    }

    #[test]
    fn an_agent_without_an_action_to_drive_is_a_fault() {
        let (mut app, agent) = app_with(InputRoute::Direct);
        app.add_plugins((EnhancedInputPlugin, EnhancedActionPlugin::<Jump>::default()));
        app.finish();
        app.world_mut().entity_mut(agent).insert(EnhancedAction::<Jump>::per_action([false, true]));
        let fault = app.tick().expect_err("no action").to_string();
        assert!(fault.contains("agent 0") && fault.contains("Action<Jump>"), "{fault}");
    }
}
