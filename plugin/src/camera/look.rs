//! One look: all sensors fill their frames with the World as it is now.

use std::time::{Duration, Instant};

use bevy::{prelude::*, tasks::tick_global_task_pools_on_main_thread};

use super::{
    CameraError, ReadbackDelay,
    borrow::{BorrowedTargets, Loan},
    eye::{self, Eye, Eyes, Stamp},
    eye_draw::{DrawnStamp, ExtractedStamp},
    images::{self, Images},
    prepare::{Atlas, prepare},
    readback::{Arrived, Piece, Readback, Source},
    renderer::Renderer,
    request::{Asked, Request, report, requests},
};
use crate::{fault::Faults, tick::Tick, vision::Frame};

/// How long shaders and images may take to load, in seconds.
const PATIENCE: u64 = 60;

/// Fills the frames of all agents with a [`CameraSensor`](super::CameraSensor).
pub(super) fn look(world: &mut World) {
    let asked = requests(world);
    if asked.is_empty() {
        return;
    }
    let Some(mut renderer) = world.remove_resource::<Renderer>() else {
        return report(world, asked.iter(), &CameraError::NoRenderer);
    };
    if let Err(error) = look_with(world, &mut renderer, &asked) {
        report(world, asked.iter(), &error);
    }
    world.insert_resource(renderer);
}

fn look_with(world: &mut World, renderer: &mut Renderer, asked: &Asked) -> Result<(), CameraError> {
    prepare(world, asked)?;
    let tick = world.resource::<Tick>().0;
    let mut stamp = world.resource_mut::<Stamp>();
    *stamp = Stamp { look: stamp.look + 1, tick };
    let stamp = *stamp;
    draw_until_ready(world, renderer, asked)?;
    let arrived = read_back(world, renderer, asked)?;
    hand_out(world, asked, &arrived, stamp);
    world.resource_mut::<Readback>().reuse(arrived);
    Ok(())
}

/// Draws, again and again until every shader and image that is being loaded is there: the first time.
fn draw_until_ready(world: &mut World, renderer: &mut Renderer, asked: &Asked) -> Result<(), CameraError> {
    let begun = Instant::now();
    loop {
        draw(world, renderer, asked);
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

/// Draws the World as it is now, for sensors only.
fn draw(world: &mut World, renderer: &mut Renderer, asked: &Asked) {
    world.resource_scope(|world, targets: Mut<BorrowedTargets>| {
        let loan = Loan::select(world, &targets);
        switch(world, !asked.following.is_empty());
        renderer.scene.prepare.run(world);
        open_eyes(world, asked);
        loan.point(world, &targets);
        renderer.draw_unseen(world);
        loan.give_back(world);
        if renderer.shows_windows {
            switch(world, false);
        }
    });
}

/// Switches the shared camera on or off.
fn switch(world: &mut World, on: bool) {
    let Some(camera) = world.resource::<Eyes>().camera else { return };
    if let Some(mut camera) = world.get_mut::<Camera>(camera) {
        camera.bypass_change_detection().is_active = on;
    }
}

/// Puts the eyes where their targets are.
fn open_eyes(world: &mut World, asked: &Asked) {
    let cells = std::mem::take(&mut world.resource_mut::<Atlas>().layout.cells);
    let eye = |(&cell, (request, target, width)): (&URect, &(Request, Entity, f32))| {
        let centre = world.get::<GlobalTransform>(*target).map_or(Vec3::ZERO, GlobalTransform::translation);
        let height = width * request.size.y as f32 / request.size.x as f32;
        Eye { cell, centre: centre.truncate(), size: Vec2::new(*width, height) }
    };
    let eyes: Vec<Eye> = cells.iter().zip(&asked.following).map(eye).collect();
    world.resource_mut::<Eyes>().eyes = eyes;
    world.resource_mut::<Atlas>().layout.cells = cells;
    world.run_system_cached(eye::note_bounds).expect("its resources are the plugin's own");
}

/// Copies what was drawn, and waits for it.
fn read_back(world: &mut World, renderer: &mut Renderer, asked: &Asked) -> Result<Arrived, CameraError> {
    let render_world = renderer.world();
    let extracted = render_world.resource::<ExtractedStamp>().0;
    let drawn = render_world.resource::<DrawnStamp>().get();
    let atlas = world.resource::<Atlas>();
    let targets = world.resource::<BorrowedTargets>();
    let (mut sources, mut pieces) = (Vec::new(), Vec::new());
    if let Some(image) = atlas.image.as_ref().filter(|_| !asked.following.is_empty()) {
        sources.push(Source { image: image.id(), size: atlas.layout.size, stamp: drawn });
        let cells = asked.following.iter().zip(&atlas.layout.cells);
        pieces.extend(cells.map(|((request, ..), &cell)| Piece { agent: request.agent, source: 0, cell }));
    }
    for target in targets.iter() {
        let agents = asked.through.iter().filter(|(_, camera)| *camera == target.camera);
        let cell = URect { min: UVec2::ZERO, max: target.size };
        pieces.extend(agents.map(|(request, _)| Piece { agent: request.agent, source: sources.len(), cell }));
        sources.push(Source { image: target.image.id(), size: target.size, stamp: extracted });
    }
    let delay = world.resource::<ReadbackDelay>().0 as usize;
    world.resource_mut::<Readback>().exchange(render_world, sources, pieces, delay)
}

/// Writes the frames that are of this look, and reports the others.
fn hand_out(world: &mut World, asked: &Asked, arrived: &Arrived, now: Stamp) {
    let mut late = Vec::new();
    arrived.hand_out(|agent, stamp, rows| {
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
            asked.iter().filter(|request| request.agent == agent),
            &CameraError::Stale { wanted: now.tick, got },
        );
    }
}
