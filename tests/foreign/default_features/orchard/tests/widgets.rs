//! Tests of clicks on the buttons of `bevy_ui_widgets`, which Bevy has by default.

use bevy::{
    prelude::*,
    ui_widgets::{Activate, Button as WidgetButton},
};
use playbot::harness::{
    foreign::{ButtonClicks, ForeignGame},
    game::Game,
    worlds::build_world,
};
use playbot::prelude::*;

/// The buttons that were activated.
#[derive(Resource, Default)]
struct Activated(Vec<&'static str>);

/// A menu without a camera, so that nothing lays it out.
fn bare_menu(app: &mut App) {
    app.init_resource::<Activated>().add_systems(Startup, |mut commands: Commands| {
        commands.spawn(Node::default()).with_children(|menu| {
            for name in ["Start", "Quit"] {
                let size = Node { width: Val::Px(200.0), height: Val::Px(50.0), ..default() };
                menu.spawn((WidgetButton, size, children![Text::new(name)]))
                    .observe(move |_: On<Activate>, mut activated: ResMut<Activated>| activated.0.push(name));
            }
        });
    });
}

fn menu(app: &mut App) {
    bare_menu(app);
    app.add_systems(Startup, |mut commands: Commands| {
        commands.spawn(Camera2d);
    });
}

#[test]
fn widgets_are_clicked_on_by_text() {
    for menu in [menu as fn(&mut App), bare_menu] {
        let game = ForeignGame::new("widgets", 1, menu).observe(["nothing"], || [0.0]);
        let game = game.keys([Vec::<KeyCode>::new()]).clicks(["Start", "Quit"]);
        assert_eq!(game.problem(), None);
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
        for action in [2, 0, 0, 1, 1, 0, 0] {
            world.entity_mut(agents[0]).insert(Action(ActionValue::Discrete(action)));
            world.tick().expect("sound");
        }
        assert_eq!(world.resource::<Activated>().0, ["Quit", "Start", "Start"]);
        let clicks = world.get::<ButtonClicks>(agents[0]).expect("it clicks");
        assert_eq!((clicks.clicked(), clicks.missed()), (3, 0), "{:?}", clicks.warnings());
    }
}
