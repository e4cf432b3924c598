//! One pass of all sensors: it fills their frames with the World as it is now.

use std::time::{Duration, Instant};

use bevy::{prelude::*, tasks::tick_global_task_pools_on_main_thread};

use super::{
    CameraError, ReadbackDelay,
    borrow::{BorrowedCameras, BorrowedTargets},
    images::{self, Images},
    prepare::{Atlas, prepare},
    readback::{MappedFrames, Piece, Readback, Source},
    renderer::Renderer,
    request::{FollowRequest, Requests, gather_requests, report},
    sensor_view::{self, SensorView, SensorViews, Stamp},
    sensor_view_draw::{DrawnStamp, ExtractedStamp},
};
use crate::{fault::Faults, tick::Tick, vision::Frame};

/// Longest time for shaders and images to load, in seconds.
const PATIENCE: u64 = 60;

/// Fills the frames of all agents with a [`CameraSensor`](super::CameraSensor).
pub(super) fn fill_frames(world: &mut World) {
    let requests = gather_requests(world);
    if requests.is_empty() {
        return;
    }
    let Some(mut renderer) = world.remove_resource::<Renderer>() else {
        return report(world, requests.iter(), &CameraError::NoRenderer);
    };
    if let Err(error) = fill_frames_with(world, &mut renderer, &requests) {
        report(world, requests.iter(), &error);
    }
    world.insert_resource(renderer);
}

fn fill_frames_with(world: &mut World, renderer: &mut Renderer, requests: &Requests) -> Result<(), CameraError> {
    prepare(world, requests)?;
    let tick = world.resource::<Tick>().0;
    let mut stamp = world.resource_mut::<Stamp>();
    *stamp = Stamp { look: stamp.look + 1, tick };
    let stamp = *stamp;
    draw_until_ready(world, renderer, requests)?;
    let frames = read_back(world, renderer, requests)?;
    hand_out(world, requests, &frames, stamp);
    world.resource_mut::<Readback>().reuse(frames);
    Ok(())
}

/// Draws repeatedly until every shader and image has loaded: the first time.
fn draw_until_ready(world: &mut World, renderer: &mut Renderer, requests: &Requests) -> Result<(), CameraError> {
    let begun = Instant::now();
    loop {
        draw(world, renderer, requests);
        let waits_for = match images::check(world) {
            Images::Loading => "images",
            _ if !renderer.is_ready() => "shaders",
            Images::Missing(what) => {
                let tick = world.resource::<Tick>().0;
                world.resource_mut::<Faults>().report(format!("tick {tick}: {what}"));
                return Ok(());
            }
            Images::Ready => return Ok(()),
        };
        if begun.elapsed() > Duration::from_secs(PATIENCE) {
            return Err(CameraError::NotReady(waits_for, PATIENCE));
        }
        tick_global_task_pools_on_main_thread();
        renderer.scene.load.run(world);
        #[allow(
            clippy::disallowed_methods,
            reason = "files and shaders arrive by the clock; no tick passes meanwhile"
        )]
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Draws the current World, for sensors only.
fn draw(world: &mut World, renderer: &mut Renderer, requests: &Requests) {
    world.resource_scope(|world, targets: Mut<BorrowedTargets>| {
        let borrowed = BorrowedCameras::select(world, &targets);
        switch(world, !requests.following.is_empty());
        renderer.scene.prepare.run(world);
        place_views(world, requests);
        borrowed.point(world, &targets);
        renderer.draw_unseen(world);
        borrowed.give_back(world);
        if renderer.shows_windows {
            switch(world, false);
        }
    });
}

/// Switches the shared camera on or off.
fn switch(world: &mut World, on: bool) {
    let Some(camera) = world.resource::<SensorViews>().camera else { return };
    if let Some(mut camera) = world.get_mut::<Camera>(camera) {
        camera.bypass_change_detection().is_active = on;
    }
}

/// Moves the views to their targets.
fn place_views(world: &mut World, requests: &Requests) {
    let cells = std::mem::take(&mut world.resource_mut::<Atlas>().layout.cells);
    let view = |(&cell, follow): (&URect, &FollowRequest)| {
        let centre = world.get::<GlobalTransform>(follow.target).map_or(Vec3::ZERO, GlobalTransform::translation);
        let size = follow.request.size.as_vec2();
        SensorView { cell, centre: centre.truncate(), size: Vec2::new(follow.width, follow.width * size.y / size.x) }
    };
    let views: Vec<SensorView> = cells.iter().zip(&requests.following).map(view).collect();
    world.resource_mut::<SensorViews>().views = views;
    world.resource_mut::<Atlas>().layout.cells = cells;
    world.run_system_cached(sensor_view::note_bounds).expect("its resources are the plugin's own");
}

/// Copies the drawn pictures, and waits for the copy.
fn read_back(world: &mut World, renderer: &mut Renderer, requests: &Requests) -> Result<MappedFrames, CameraError> {
    let render_world = renderer.world();
    let extracted = render_world.resource::<ExtractedStamp>().0;
    let drawn = render_world.resource::<DrawnStamp>().get();
    let atlas = world.resource::<Atlas>();
    let targets = world.resource::<BorrowedTargets>();
    let (mut sources, mut pieces) = (Vec::new(), Vec::new());
    if let Some(image) = atlas.image.as_ref().filter(|_| !requests.following.is_empty()) {
        sources.push(Source { image: image.id(), size: atlas.layout.size, stamp: drawn });
        let cells = requests.following.iter().zip(&atlas.layout.cells);
        pieces.extend(cells.map(|(follow, &cell)| Piece { agent: follow.request.agent, source: 0, cell }));
    }
    for target in targets.iter() {
        let agents = requests.through.iter().filter(|(_, camera)| *camera == target.camera);
        let cell = URect { min: UVec2::ZERO, max: target.size };
        pieces.extend(agents.map(|(request, _)| Piece { agent: request.agent, source: sources.len(), cell }));
        sources.push(Source { image: target.image.id(), size: target.size, stamp: extracted });
    }
    let delay = world.resource::<ReadbackDelay>().0 as usize;
    world.resource_mut::<Readback>().exchange(render_world, sources, pieces, delay)
}

/// Writes the frames of this pass, and reports the others.
fn hand_out(world: &mut World, requests: &Requests, frames: &MappedFrames, now: Stamp) {
    let mut late = Vec::new();
    frames.hand_out(|agent, stamp, rows| {
        if stamp != now {
            return late.push((agent, stamp.tick));
        }
        let Ok(mut agent) = world.get_entity_mut(agent) else { return };
        let Some(mut frame) = agent.get_mut::<Frame>() else { return };
        frame.tick = Some(now.tick);
        frame.pixels.clear();
        for row in rows {
            frame.pixels.extend(row.chunks_exact(4).map(|pixel| [pixel[0], pixel[1], pixel[2], 255]));
        }
    });
    for (agent, got) in late {
        report(
            world,
            requests.iter().filter(|request| request.agent == agent),
            &CameraError::Stale { wanted: now.tick, got },
        );
    }
}
