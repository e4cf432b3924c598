//! Tests of faults: errors for the caller that ticks the World, events in an app that runs by itself.

use bevy::{
    prelude::*,
    time::{TimePlugin, TimeUpdateStrategy},
};
use bevy_playbot::{
    fault::{FaultOccurred, Faults},
    headless::set_fixed_step,
    prelude::*,
    test_app::test_app,
};
use playbot_tests::{corridor_plugin, spawn_walker};

#[derive(Resource, Default)]
struct Heard(Vec<String>);

fn listen(app: &mut App) {
    app.init_resource::<Heard>()
        .add_observer(|event: On<FaultOccurred>, mut heard: ResMut<Heard>| heard.0.push(event.fault.to_string()));
}

#[test]
fn an_app_that_runs_by_itself_hears_every_fault_in_its_frame() {
    let mut app = App::new();
    app.add_plugins((TimePlugin, PlaybotPlugin::default())).add_plugins(corridor_plugin);
    let step = set_fixed_step(&mut app, 10.0);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    listen(&mut app);
    let agent = spawn_walker(app.world_mut(), 3);
    app.world_mut().entity_mut(agent).insert((Control::Human, Action(ActionValue::Discrete(9))));
    app.update();
    assert!(app.world().resource::<Heard>().0.is_empty(), "the first frame has no tick");
    app.update();
    let heard = &app.world().resource::<Heard>().0;
    assert!(heard.len() == 1 && heard[0].contains("agent 3") && heard[0].contains("action 9"), "{heard:?}");
    app.update();
    assert_eq!(app.world().resource::<Heard>().0.len(), 1, "said once");
}

#[test]
fn only_the_caller_that_ticks_the_world_gets_the_fault() {
    let mut app = test_app();
    corridor_plugin(&mut app);
    listen(&mut app);
    let agent = spawn_walker(app.world_mut(), 0);
    app.world_mut().entity_mut(agent).insert((Control::Human, Action(ActionValue::Discrete(9))));
    let fault = app.tick().expect_err("no such action").to_string();
    assert!(fault.contains("action 9"), "{fault}");
    app.tick().expect("it was taken");
    assert!(app.world().resource::<Heard>().0.is_empty());
}

#[test]
fn the_first_of_several_faults_is_the_one_that_is_returned() {
    let mut app = headless_app();
    app.add_systems(Update, |mut faults: ResMut<Faults>| {
        faults.report("the cause".into());
        faults.report("what follows".into());
    });
    assert_eq!(app.tick().expect_err("two").to_string(), "the cause");
    let mut app = App::new();
    app.add_plugins((TimePlugin, PlaybotPlugin::default()));
    listen(&mut app);
    let mut faults = app.world_mut().resource_mut::<Faults>();
    faults.report("the cause".into());
    faults.report("what follows".into());
    app.update();
    assert_eq!(app.world().resource::<Heard>().0, ["the cause", "what follows"], "an event for each");
}

#[test]
fn two_agents_of_one_number_are_a_fault() {
    let mut app = test_app();
    corridor_plugin(&mut app);
    for index in [0, 7, 7] {
        spawn_walker(app.world_mut(), index);
    }
    let fault = app.tick().expect_err("two of them").to_string();
    assert!(fault.contains("two agents have the number 7"), "{fault}");
}
