//! Composition of observations from frames.

use crate::{
    agent::{Agent, AgentOrder, Control},
    episode::{Episode, EpisodeCount, Tick},
    fault::Faults,
    observation::Observation,
    vision::{
        Frame, ImageOptions, ImageSensor, PaintedVelocity, VisionError, options,
        options::{BlankEpisodes, PictureKey, PictureStack},
    },
};
use bevy::prelude::*;
use thiserror::Error;

/// The reason why a frame cannot become an observation.
#[derive(Debug, Error)]
enum ComposeError {
    #[error("{0}")]
    Options(#[from] VisionError),
    #[error("there is no frame of tick {wanted}: no sensor has looked yet; give the agent one, and add its plugin")]
    Missing { wanted: u64 },
    #[error("there is no frame of tick {wanted}: the sensor's last one is of tick {got}")]
    Stale { wanted: u64, got: u64 },
    #[error("the frame has {got} pixels, but the agent sees {width}x{height}")]
    Size { got: usize, width: u32, height: u32 },
    #[error("the velocity is to be painted, but the agent has no `PaintedVelocity`")]
    NoVelocity,
    #[error("the velocity to be painted is {0}; the game must not produce it")]
    Velocity(Vec2),
}

/// Returns whether the agent's observation is used: a level is being played and the agent is
/// controlled.
pub(crate) fn is_observed(control: &Control, episode: &Episode) -> bool {
    control.is_active() && episode.is_running()
}

/// Makes the image of each agent's observation from its frame.
pub(super) fn compose(
    tick: Res<Tick>,
    order: Res<AgentOrder>,
    mut agents: Query<(
        (&Agent, &Control, &Episode, &EpisodeCount),
        (&ImageSensor, &Frame, Option<&PaintedVelocity>),
        (&mut PictureStack, &mut BlankEpisodes, &mut Observation),
    )>,
    mut faults: ResMut<Faults>,
) {
    for &entity in order.entities() {
        let Ok(((agent, control, episode, count), (sensor, frame, velocity), (mut stack, mut blank, mut observation))) =
            agents.get_mut(entity)
        else {
            continue;
        };
        if !is_observed(control, episode) {
            continue;
        }
        if let Err(error) = check(&sensor.0, frame, velocity, tick.0) {
            faults.report(format!("{}: {error}", episode.moment(agent)));
            continue;
        }
        blank.note(&frame.pixels, episode.tick == 0);
        let moment = PictureKey { episode: count.finished, level: episode.level, tick: episode.tick };
        write_image(&sensor.0, frame, velocity, moment, &mut stack, &mut observation.image);
    }
}

fn check(
    options: &ImageOptions,
    frame: &Frame,
    velocity: Option<&PaintedVelocity>,
    wanted: u64,
) -> Result<(), ComposeError> {
    options.check()?;
    match frame.tick {
        None => return Err(ComposeError::Missing { wanted }),
        Some(got) if got != wanted => return Err(ComposeError::Stale { wanted, got }),
        Some(_) => {}
    }
    let (width, height, got) = (options.width, options.height, frame.pixels.len());
    if got != width as usize * height as usize {
        return Err(ComposeError::Size { got, width, height });
    }
    match velocity {
        None if options.paint_velocity => Err(ComposeError::NoVelocity),
        Some(velocity) if options.paint_velocity && !velocity.0.is_finite() => Err(ComposeError::Velocity(velocity.0)),
        _ => Ok(()),
    }
}

/// Writes `[channels, height, width]`, keeping the allocation.
fn write_image(
    options: &ImageOptions,
    frame: &Frame,
    velocity: Option<&PaintedVelocity>,
    moment: PictureKey,
    stack: &mut PictureStack,
    image: &mut Vec<u8>,
) {
    let paint = |bytes: &mut [u8]| {
        options::write_planes(&frame.pixels, options, bytes);
        if let (true, Some(velocity)) = (options.paint_velocity, velocity) {
            options::paint_velocity(velocity.0.to_array(), options, bytes);
        }
    };
    image.resize(options.shape().numbers(), 0);
    match options.stack {
        1 => paint(image),
        count => stack.push(moment, count as usize, paint, image),
    }
}

/// Reports images of the wrong length, with agent and tick.
pub(crate) fn check_images(
    agents: Query<(&Agent, &ImageSensor, &Observation, &Control, &Episode)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, sensor, observation, control, episode) in &agents {
        let (expected, got) = (sensor.0.shape().numbers(), observation.image.len());
        if is_observed(control, episode) && got != expected {
            faults.report(format!(
                "{}: the observation's image has {got} bytes, its sensor makes {expected}; add the sensor and its \
                 plugin, and leave the image to them",
                episode.moment(agent)
            ));
        }
    }
}
