//! A game that the plugin has never heard of: land a capsule softly.
//!
//! It brings its own rules, says what the agent sees and does, and gets recording, replay and measurement for it.
//! Run it with `cargo run --release -p bevy_playbot --example lander`.

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use bevy::prelude::*;
use bevy_playbot::{
    demo::{
        file::{DemoHeader, DemoWriter},
        recorder::demo_actions,
    },
    vision::ObservationConfig,
};
use playbot_lab::prelude::*;
use playbot_lab::{
    demo::verify::verify_file,
    eval::{EvalPlan, Player, evaluate, summarize},
    worlds::build_world,
};

/// Height above ground, metres, and speed, metres per second upwards.
#[derive(Component, Default)]
struct Capsule {
    height: f32,
    speed: f32,
    fuel: f32,
}

#[derive(Clone, Copy)]
struct Lander;

/// The level's number decides how high and how fast the capsule starts.
fn start(event: On<StartEpisode>, mut capsules: Query<&mut Capsule>) {
    if let Ok(mut capsule) = capsules.get_mut(event.entity) {
        *capsule =
            Capsule { height: 20.0 + (event.level % 7) as f32 * 5.0, speed: -((event.level % 3) as f32), fuel: 60.0 };
    }
}

fn see(mut agents: Query<(&Capsule, &mut Observation)>) {
    for (capsule, mut observation) in &mut agents {
        observation.set([capsule.height / 50.0, capsule.speed / 10.0, capsule.fuel / 60.0]);
    }
}

/// Action 1 burns: 3 m/s² against a gravity of 1.6 m/s². Touching down at 2 m/s or less wins.
fn fly(
    time: Res<Time>,
    mut agents: Query<(&Control, &Action, &mut Capsule, &mut Reward, &mut Episode, &mut StateHash)>,
) {
    for (control, action, mut capsule, mut reward, mut episode, mut hash) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let burns = action.discrete() == Some(1) && capsule.fuel > 0.0;
        let thrust = if burns { 3.0 } else { 0.0 };
        capsule.fuel -= f32::from(u8::from(burns));
        capsule.speed += (thrust - 1.6) * time.delta_secs();
        capsule.height += capsule.speed * time.delta_secs();
        hash.0 = u64::from(capsule.height.to_bits()) << 32 | u64::from(capsule.speed.to_bits());
        if capsule.height <= 0.0 {
            let soft = capsule.speed >= -2.0;
            reward.add(if soft { 1.0 } else { 0.0 });
            episode.terminate(soft);
        } else if episode.tick >= 400 {
            episode.truncate();
        }
    }
}

/// A careful pilot: burns whenever the capsule falls faster than its height allows.
fn pilot(mut agents: Query<(&Control, &Capsule, &mut Action), Without<BlindBot>>) {
    for (control, capsule, mut action) in &mut agents {
        if *control == Control::Bot {
            let allowed = -1.0 - 0.2 * capsule.height;
            action.0 = ActionValue::Discrete(u32::from(capsule.speed < allowed));
        }
    }
}

impl Game for Lander {
    fn name(&self) -> &'static str {
        "lander"
    }
    fn version(&self) -> u32 {
        1
    }
    fn modes(&self) -> &'static [&'static str] {
        &["moon"]
    }
    fn tick_hz(&self) -> f64 {
        5.0
    }
    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(2)
    }
    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: ["height", "speed", "fuel"].map(String::from).into() }
    }
    fn build(&self, app: &mut App, _mode: &str) {
        app.add_observer(start)
            .add_systems(ObserveSchedule, see)
            .add_systems(FixedPreUpdate, pilot.in_set(PlaybotSystems::Decide))
            .add_systems(FixedUpdate, fly);
    }
    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let sensor = VectorSensor::new(self.observation().names);
        world.spawn((Agent::new(index, self.actions()), sensor, Capsule::default())).id()
    }
    fn demonstrator(&self) -> Option<&'static str> {
        Some("pilot")
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let split: LevelSplit = "moon:0..20".parse()?;
    let plan = EvalPlan {
        split: split.clone(),
        sight: ObservationConfig::default(),
        episodes_per_level: 2,
        seed: 1,
        arenas: 4,
        worlds: 2,
        threads: 2,
    };
    for (name, player) in [("pilot", Player::Demonstrator), ("random", Player::Blind(BlindBot::Uniform))] {
        let summary = summarize(name, &split, &evaluate(&Lander, &player, &plan, |_| {})?);
        println!("{name}: {:.0} % landed softly", 100.0 * summary.success);
    }
    let path = std::env::temp_dir().join(format!("lander-{}.demo", std::process::id()));
    let header = DemoHeader::new("lander", 1, "moon", 5.0, demo_actions(&Lander.actions()));
    let (mut world, agents) = build_world(&Lander, "moon", 1, 0, 1);
    world.insert_resource(Recorder::new(DemoWriter::create(&path, header)?));
    let levels = LevelQueue::list(split.levels().collect::<Vec<_>>());
    world.entity_mut(agents[0]).insert((Control::Bot, Recording::default(), levels));
    while world.get::<Control>(agents[0]).is_some_and(|control| control.is_active()) {
        world.tick()?;
    }
    let report = verify_file(&Lander, &path, |_| {})?;
    println!("{} episodes recorded, {} of them replay differently", report.episodes, report.divergences.len());
    std::fs::remove_file(path)?;
    Ok(())
}
