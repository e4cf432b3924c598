//! Tests of actions that reach a game without keys.

use bevy::{input::mouse::AccumulatedMouseMotion, prelude::*};
use bevy_playbot::virtual_input::ActionAxis;
use playbot::prelude::*;
use playbot_harness::{foreign::ForeignGame, worlds::build_world};
use playbot_tests::foreign::catch::{Paddle, game};

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
