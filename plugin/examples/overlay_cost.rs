//! The time that the overlay adds to a frame: an app with Bevy's UI, text and gizmos, without a renderer, whose agent is
//! driven by a policy with skills of eight values. Frames with and without the overlay alternate in pieces.
//!
//! ```sh
//! cargo run --release -p bevy_playbot --features overlay --example overlay_cost
//! ```

use bevy::{app::PluginGroupBuilder, prelude::*, time::TimeUpdateStrategy};
use bevy_playbot::{headless::set_fixed_step, overlay::PlaybotOverlay, prelude::*};
use playbot_learner::{DeviceKind, Learner as _, PolicySpec, PpoConfig, PpoLearner, Prior, SkillDraw};
use std::time::{Duration, Instant};

const PIECE: u32 = 300;
const PIECES: u32 = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut bare, mut shown) = (app(false)?, app(true)?);
    // Fonts and layouts of the first frames.
    run(&mut bare, 120);
    run(&mut shown, 120);
    let (mut without, mut with) = (Vec::new(), Vec::new());
    for _ in 0..PIECES {
        without.push(run(&mut bare, PIECE));
        with.push(run(&mut shown, PIECE));
    }
    let (without, with) = (median(without), median(with));
    let (of, added) = (without.as_secs_f64() * 1e3, (with.as_secs_f64() - without.as_secs_f64()) * 1e3);
    #[allow(clippy::print_stdout, reason = "the result")]
    {
        println!("a frame without the overlay: {of:.3} ms; the overlay adds {added:.3} ms");
    }
    Ok(())
}

/// Returns the app of a game whose agent walks in a circle, one tick a frame.
fn app(has_overlay: bool) -> Result<App, Box<dyn std::error::Error>> {
    let spec = PolicySpec { obs: 2.into(), latent: 8, action_space: ActionSpace::Discrete(3) };
    let policy = PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::default())?.policy();
    let prior = Prior::standard_normal(8, true);
    let mut app = App::new();
    app.add_plugins((plugins(), PlaybotPlugin::default()))
        .insert_resource(ActivePolicy { policy, draw: ActionDraw::Sample })
        .insert_resource(SkillPrior { prior, skill_interval: 10, draw: SkillDraw::Sample })
        .insert_resource(PlaybotSeed(1))
        .add_systems(ObserveSchedule, |mut agents: Query<(&Transform, &mut Observation)>| {
            agents.iter_mut().for_each(|(at, mut seen)| seen.set([at.translation.x, at.translation.y]));
        })
        .add_systems(FixedUpdate, |mut agents: Query<(&Episode, &mut Transform, &mut Reward)>| {
            for (episode, mut at, mut reward) in &mut agents {
                let angle = episode.tick as f32 * 0.05;
                at.translation = 100.0 * Vec3::new(libm::cosf(angle), libm::sinf(angle), 0.0);
                reward.add(0.1);
            }
        });
    if has_overlay {
        app.add_plugins(PlaybotOverlay::default());
    }
    let step = set_fixed_step(&mut app, 60.0);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    app.world_mut().spawn(Camera2d);
    let agent = (Agent::new(0, ActionSpace::Discrete(3)), VectorSensor::new(["x", "y"]), Control::Policy);
    app.world_mut().spawn((agent, Transform::default()));
    app.finish();
    app.cleanup();
    Ok(app)
}

/// Returns Bevy's plugins, without an event loop and without a graphics card, whatever this is built with.
fn plugins() -> PluginGroupBuilder {
    let plugins = DefaultPlugins.build();
    #[cfg(feature = "window")]
    let plugins = plugins.disable::<bevy::winit::WinitPlugin>();
    #[cfg(feature = "camera")]
    let plugins = plugins.set(bevy::render::RenderPlugin {
        render_creation: bevy::render::settings::WgpuSettings { backends: None, ..default() }.into(),
        ..default()
    });
    plugins
}

/// Runs some frames at 60 a second of the overlay's clock, and returns the mean time of one.
fn run(app: &mut App, frames: u32) -> Duration {
    let begun = Instant::now();
    for _ in 0..frames {
        app.update();
    }
    begun.elapsed() / frames
}

fn median(mut times: Vec<Duration>) -> Duration {
    times.sort();
    times[times.len() / 2]
}
