//! Tests of actions that click on buttons of Bevy's UI.

use std::fmt::Debug;

use bevy::{
    camera::{ImageRenderTarget, RenderTarget},
    input::{ButtonState, mouse::MouseButtonInput},
    prelude::*,
    render::render_resource::TextureFormat,
    ui::{InteractionDisabled, IsDefaultUiCamera, Pressed},
    window::{PrimaryWindow, WindowEvent},
};
use bevy_playbot::virtual_input::ActionAxis;
use playbot::prelude::*;
use playbot_harness::foreign::{ButtonClicks, ForeignGame};

use crate::pointers::played;

/// The names of the buttons that the game has seen pressed.
#[derive(Resource, Default)]
struct Presses(Vec<String>);

/// The events of the mouse that Bevy's picking reads.
#[derive(Resource, Default)]
struct MouseEvents(Vec<&'static str>);

/// The events that Bevy's picking has triggered at entities with a name, such as `Click StartButton`.
#[derive(Resource, Default)]
struct PointerEvents(Vec<String>);

fn button(name: &'static str, text: &'static str) -> impl Bundle {
    let node = Node { width: Val::Px(200.0), height: Val::Px(50.0), ..default() };
    (Button, Name::new(name), node, children![Text::new(text)])
}

/// Spawns a row of buttons. `Start` covers the pixels from (0, 0) to (200, 50), and two others have the text `Back`.
fn build_menu(mut commands: Commands) {
    let whole = Node { width: Val::Percent(100.0), height: Val::Percent(100.0), ..default() };
    commands.spawn((
        whole,
        children![
            button("StartButton", "Start"),
            (Node::default(), Name::new("Options"), children![button("OptionsBack", "Back")]),
            (Node::default(), Name::new("Credits"), children![button("CreditsBack", "Back")]),
            (Node::default(), Visibility::Hidden, children![button("HiddenButton", "Secret")]),
            (button("OffButton", "Off"), InteractionDisabled),
            // Without `Interaction`, for observers alone.
            (Node { width: Val::Px(200.0), height: Val::Px(50.0), ..default() }, Name::new("Plain")),
        ],
    ));
}

fn note_presses(buttons: Query<(&Interaction, &Name), Changed<Interaction>>, mut presses: ResMut<Presses>) {
    let pressed = buttons.iter().filter(|(interaction, _)| **interaction == Interaction::Pressed);
    presses.0.extend(pressed.map(|(_, name)| name.to_string()));
}

fn note_events(mut events: MessageReader<WindowEvent>, mut seen: ResMut<MouseEvents>) {
    seen.0.extend(events.read().filter_map(|event| match event {
        WindowEvent::CursorMoved(_) => Some("moved"),
        WindowEvent::MouseButtonInput(MouseButtonInput { state: ButtonState::Pressed, .. }) => Some("down"),
        WindowEvent::MouseButtonInput(_) => Some("up"),
        _ => None,
    }));
}

fn note_pointer<E: Clone + Debug + Reflect>(
    event: On<Pointer<E>>,
    names: Query<&Name, With<Node>>,
    mut seen: ResMut<PointerEvents>,
) {
    let kind = std::any::type_name::<E>().rsplit("::").next().unwrap_or_default();
    seen.0.extend(names.get(event.entity).map(|name| format!("{kind} {name}")));
}

/// The menu, without a camera, so that nothing lays it out.
fn bare_menu(app: &mut App) {
    app.init_resource::<Presses>()
        .init_resource::<MouseEvents>()
        .init_resource::<PointerEvents>()
        .add_observer(note_pointer::<Press>)
        .add_observer(note_pointer::<Click>)
        .add_observer(note_pointer::<Release>)
        .add_observer(note_pointer::<Cancel>)
        .add_systems(Startup, build_menu)
        .add_systems(Update, (note_presses, note_events));
}

fn menu(app: &mut App) {
    bare_menu(app);
    app.add_systems(Startup, |mut commands: Commands| {
        commands.spawn(Camera2d);
    });
}

/// The menu, drawn into an image, where no window has a cursor.
fn painted_menu(app: &mut App) {
    bare_menu(app);
    app.add_systems(Startup, |mut images: ResMut<Assets<Image>>, mut commands: Commands| {
        let handle = images.add(Image::new_target_texture(1280, 720, TextureFormat::Rgba8UnormSrgb, None));
        let target = RenderTarget::Image(ImageRenderTarget { handle, scale_factor: 1.0 });
        commands.spawn((Camera2d, target, IsDefaultUiCamera));
    });
}

fn game(menu: fn(&mut App)) -> ForeignGame {
    ForeignGame::new("menu", 1, menu).observe(["nothing"], || [0.0])
}

fn pressed(world: &World) -> &[String] {
    &world.resource::<Presses>().0
}

fn counts(world: &World, agent: Entity) -> (u32, u32) {
    let clicks = world.get::<ButtonClicks>(agent).expect("it clicks");
    (clicks.clicked(), clicks.missed())
}

/// Returns the number of buttons that are pressed now.
fn still_pressed(world: &mut World) -> usize {
    let mut buttons = world.query::<&Interaction>();
    buttons.iter(world).filter(|interaction| **interaction == Interaction::Pressed).count()
}

#[test]
fn buttons_are_clicked_on_by_text_by_name_and_by_path() {
    for menu in [menu as fn(&mut App), bare_menu] {
        let game = game(menu).keys([Vec::<KeyCode>::new()]).clicks(["Start", "StartButton", "Options/Back"]);
        assert_eq!(Game::actions(&game), ActionSpace::Discrete(4));
        for (action, name) in [(1, "StartButton"), (2, "StartButton"), (3, "OptionsBack")] {
            let (mut world, agent) = played(&game, &[action]);
            assert_eq!(pressed(&world), [name], "action {action}");
            assert_eq!((still_pressed(&mut world), counts(&world, agent)), (1, (1, 0)), "action {action}");
        }
    }
}

/// Stands for the crate `bevy_ui_widgets`, which this program is built without. The real one is tested in
/// `tests/foreign/default_features/orchard/tests/widgets.rs`.
mod stand_in {
    use bevy::prelude::*;

    #[derive(Component, Reflect)]
    #[reflect(Component)]
    #[type_path = "bevy_ui_widgets::button"]
    pub struct Button;
}

/// Buttons with a text, and neither `Interaction` nor a `Name`.
fn bare_widgets(app: &mut App) {
    let size = || Node { width: Val::Px(200.0), height: Val::Px(50.0), ..default() };
    let build = move |mut commands: Commands| {
        commands.spawn(Node::default()).with_children(|menu| {
            menu.spawn((size(), stand_in::Button, children![Text::new("Start")]));
            menu.spawn((size(), children![Text::new("Quit")])).observe(
                |_: On<Pointer<Click>>, mut seen: ResMut<PointerEvents>| seen.0.push("observer of Quit".to_owned()),
            );
            menu.spawn((size(), stand_in::Button, children![Text::new("Back")]));
            menu.spawn((size(), Button, children![Text::new("Back")]));
            // Does nothing.
            menu.spawn((size(), children![Text::new("Title")]));
        });
    };
    app.register_type::<stand_in::Button>().init_resource::<PointerEvents>();
    app.add_observer(press_widget).add_observer(click_widget).add_observer(release_widget);
    app.add_systems(Startup, build);
}

type Widgets<'w, 's> = Query<'w, 's, Has<Pressed>, With<stand_in::Button>>;

// As in `bevy_ui_widgets`, a widget that is not pressed is pressed, and one that is pressed is clicked on.

fn press_widget(press: On<Pointer<Press>>, widgets: Widgets, mut commands: Commands) {
    if widgets.get(press.entity).is_ok_and(|is_pressed| !is_pressed) {
        commands.entity(press.entity).insert(Pressed);
    }
}

fn click_widget(click: On<Pointer<Click>>, widgets: Widgets, mut seen: ResMut<PointerEvents>) {
    seen.0.extend(widgets.get(click.entity).unwrap_or_default().then(|| "widget".to_owned()));
}

fn release_widget(release: On<Pointer<Release>>, widgets: Widgets, mut commands: Commands) {
    if widgets.get(release.entity).unwrap_or_default() {
        commands.entity(release.entity).remove::<Pressed>();
    }
}

fn widgets(app: &mut App) {
    bare_widgets(app);
    app.add_systems(Startup, |mut commands: Commands| {
        commands.spawn(Camera2d);
    });
}

#[test]
fn widgets_and_observed_nodes_are_clicked_on_by_text() {
    for menu in [widgets as fn(&mut App), bare_widgets] {
        let game = game(menu).keys([Vec::<KeyCode>::new()]).clicks(["Start", "Quit"]);
        let (world, agent) = played(&game, &[1, 1, 0, 0, 2, 0, 0]);
        assert_eq!(world.resource::<PointerEvents>().0, ["widget", "widget", "observer of Quit"]);
        assert_eq!(counts(&world, agent), (3, 0));
    }
}

#[test]
fn widgets_and_observed_nodes_are_in_the_warnings() {
    let warning = |name: &'static str| {
        let (world, agent) = played(&game(widgets).clicks([name]).time_limit(2), &[0, 0]);
        assert_eq!(counts(&world, agent), (0, 2), "{name}");
        let clicks = world.get::<ButtonClicks>(agent).expect("it clicks");
        let [warning] = clicks.warnings() else { panic!("once: {:?}", clicks.warnings()) };
        warning.clone()
    };
    let text = warning("Back");
    assert!(text.contains("2 buttons are called `Back`"), "one of either kind: {text}");
    let text = warning("Title");
    assert!(text.ends_with("There was `Back`, `Back`, `Quit`, `Start`"), "a text is no button: {text}");
}

#[test]
fn a_button_is_let_go_of_in_the_next_tick() {
    for menu in [menu as fn(&mut App), bare_menu] {
        let game = game(menu).keys([Vec::<KeyCode>::new()]).clicks(["Start"]);
        let (mut world, _) = played(&game, &[1, 0]);
        assert_eq!(pressed(&world).len(), 1);
        assert_eq!(still_pressed(&mut world), 0);
        assert!(!world.resource::<ButtonInput<MouseButton>>().pressed(MouseButton::Left));
    }
}

#[test]
fn each_tick_is_a_click_of_its_own() {
    for menu in [menu as fn(&mut App), bare_menu] {
        let (world, agent) = played(&game(menu).clicks(["Start", "Credits/Back"]), &[0, 0, 1, 0]);
        assert_eq!(pressed(&world), ["StartButton", "StartButton", "CreditsBack", "StartButton"]);
        assert_eq!(counts(&world, agent), (4, 0));
    }
}

#[test]
fn the_mouse_does_what_a_persons_does() {
    let game = game(menu).keys([Vec::<KeyCode>::new()]).clicks(["Start"]);
    let (mut world, _) = played(&game, &[1, 1, 0]);
    assert_eq!(world.resource::<MouseEvents>().0, ["moved", "down", "up", "down", "up"]);
    let mut windows = world.query_filtered::<&Window, With<PrimaryWindow>>();
    let window = windows.single(&world).expect("one window");
    assert_eq!(window.cursor_position(), Some(Vec2::new(100.0, 25.0)), "the middle of the button");
}

#[test]
fn observers_of_picking_see_a_click_with_the_mouse_and_without_it() {
    for (menu, place) in [(menu as fn(&mut App), "window"), (bare_menu, "nothing"), (painted_menu, "image")] {
        let game = game(menu).keys([Vec::<KeyCode>::new()]).clicks(["Start", "Plain"]);
        let (world, agent) = played(&game, &[1, 0, 0, 2, 0, 0]);
        let of = |name: &str| ["Press", "Click", "Release"].map(|kind| format!("{kind} {name}"));
        assert_eq!(world.resource::<PointerEvents>().0, [of("StartButton"), of("Plain")].concat(), "in {place}");
        assert_eq!(counts(&world, agent), (2, 0), "in {place}");
        assert_eq!(pressed(&world), ["StartButton"], "in {place}: by `Interaction`, which the other has not");
    }
}

#[test]
fn each_tick_is_a_click_for_observers_too() {
    for menu in [menu as fn(&mut App), bare_menu, painted_menu] {
        let game = game(menu).keys([Vec::<KeyCode>::new()]).clicks(["Start"]);
        let (world, _) = played(&game, &[1, 1, 1, 0, 0]);
        let clicks = world.resource::<PointerEvents>().0.iter().filter(|event| *event == "Click StartButton").count();
        assert_eq!(clicks, 3);
    }
}

#[test]
fn a_press_that_the_end_of_an_episode_interrupts_is_no_click() {
    let game = game(bare_menu).keys([Vec::<KeyCode>::new()]).clicks(["Start"]).time_limit(1);
    let (world, _) = played(&game, &[1, 0]);
    assert_eq!(world.resource::<PointerEvents>().0, ["Press StartButton", "Cancel StartButton"]);
}

/// Agents that see pictures through the camera that shows the menu.
#[cfg(feature = "screen")]
#[test]
fn agents_that_see_pictures_click_as_others_do() {
    use bevy_playbot::vision::{ImageOptions, ObservationConfig, ObservationKind};
    use playbot_harness::worlds::build_observing_world;

    let game = game(menu).keys([Vec::<KeyCode>::new()]).clicks(["Start"]).camera();
    let image = ImageOptions { width: 16, height: 16, ..default() };
    let config = ObservationConfig { kind: ObservationKind::Camera, image };
    let (mut world, agents) = build_observing_world(&game, "default", &config, 0, 0, 1)
        .expect("these tests need a Vulkan driver: apt-get install mesa-vulkan-drivers");
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
    for action in [1, 0, 0] {
        world.entity_mut(agents[0]).insert(Action(ActionValue::Discrete(action)));
        world.tick().expect("sound");
    }
    assert_eq!(pressed(&world), ["StartButton"]);
    assert_eq!(world.resource::<MouseEvents>().0, ["moved", "down", "up"]);
    let seen = &world.resource::<PointerEvents>().0;
    assert_eq!(*seen, ["Press", "Click", "Release"].map(|kind| format!("{kind} StartButton")));
}

#[test]
fn a_click_on_a_hidden_or_disabled_button_is_counted_and_has_no_effect() {
    for name in ["Secret", "OffButton"] {
        let (world, agent) = played(&game(menu).clicks([name]).time_limit(2), &[0, 0]);
        assert_eq!(counts(&world, agent), (0, 2), "{name}");
        assert!(pressed(&world).is_empty(), "{name}");
        let clicks = world.get::<ButtonClicks>(agent).expect("it clicks");
        assert!(clicks.warnings().is_empty(), "{name} exists: {:?}", clicks.warnings());
    }
}

#[test]
fn a_name_that_two_buttons_share_is_a_warning_that_names_both_paths() {
    let (world, agent) = played(&game(menu).clicks(["Back"]), &[0, 0]);
    assert_eq!(counts(&world, agent), (0, 2));
    assert!(pressed(&world).is_empty());
    let clicks = world.get::<ButtonClicks>(agent).expect("it clicks");
    let [warning] = clicks.warnings() else { panic!("once: {:?}", clicks.warnings()) };
    for part in ["`menu`", "2 buttons are called `Back`", "`Credits/Back`, `Options/Back`"] {
        assert!(warning.contains(part), "`{part}` is missing in: {warning}");
    }
}

#[test]
fn a_button_that_never_existed_in_an_episode_is_a_warning_with_the_nearest_name() {
    let game = game(menu).clicks(["Stort"]).time_limit(2);
    let (world, agent) = played(&game, &[0]);
    let warnings = |world: &World| world.get::<ButtonClicks>(agent).expect("it clicks").warnings().to_vec();
    assert!(warnings(&world).is_empty(), "it may still appear");
    let (world, _) = played(&game, &[0, 0]);
    assert_eq!(counts(&world, agent), (0, 2));
    let warnings = warnings(&world);
    let [warning] = warnings.as_slice() else { panic!("once: {warnings:?}") };
    for part in ["no button `Stort`", "did you mean `Start`?", "`Credits/Back`", "`Options/Back`"] {
        assert!(warning.contains(part), "`{part}` is missing in: {warning}");
    }
}

#[test]
fn actions_that_click_are_named_after_their_buttons() {
    let game = game(menu).keys([vec![], vec![KeyCode::Space]]).clicks(["Start"]);
    assert_eq!(game.tools().input.action_names(), ["nothing", "Space", "click Start"]);
    assert!(game.tools().input.key_bindings().is_none(), "keys alone do not play it");
}

#[test]
fn clicks_that_contradict_other_settings_are_reported() {
    let problem = |game: ForeignGame| game.problem().expect("they do not go together");
    let text = problem(game(menu).clicks(["Start"]).actions(ActionSpace::Discrete(2), || {}));
    assert!(text.contains("has `.clicks` and `.actions`") && text.contains("keep one"), "{text}");
    let steer = [ActionAxis::keys([KeyCode::KeyA], [KeyCode::KeyD])];
    let text = problem(game(menu).clicks(["Start"]).axes(steer));
    assert!(text.contains("`menu` has `.clicks`, which belong to discrete actions"), "{text}");
    let text = problem(game(menu).clicks(["Start", " "]));
    assert!(text.contains("`.clicks` with an empty name"), "{text}");
}
