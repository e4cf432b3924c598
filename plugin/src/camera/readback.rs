//! One pass of all sensors: it fills their frames with the World as it is now.

use crate::{
    camera::{
        CameraError, TileBorder,
        renderer::Renderer,
        request,
        request::{
            BorrowedCameras, BorrowedTargets, FollowRequest, Images, Layout, Requests, gather_requests, render_target,
            report, target_image,
        },
        sensor_view,
        sensor_view::{DrawnStamp, ExtractedStamp, SensorView, SensorViews, Stamp, spawn_camera},
    },
    episode::Tick,
    fault::Faults,
    vision::Frame,
};
use bevy::{
    asset::AssetId,
    prelude::*,
    render::{
        render_asset::RenderAssets,
        render_resource::{
            Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, Extent3d, MapMode, PollType,
            TexelCopyBufferInfo, TexelCopyBufferLayout,
        },
        renderer::{RenderDevice, RenderQueue},
        texture::GpuImage,
    },
    tasks::tick_global_task_pools_on_main_thread,
};
use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

/// Longest time for shaders and images to load, in seconds.
const PATIENCE: u64 = 60;

/// Fills the frames of all agents with a [`CameraSensor`](crate::camera::CameraSensor).
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
        let waits_for = match request::check(world) {
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

// Readback of pictures from the graphics adapter: one buffer and one wait for all agents.

/// Rows of a picture in a buffer begin at multiples of this, in bytes: a rule of wgpu.
const ROW: u32 = 256;

/// Delays frames by this many passes, which must be reported as a fault: for tests. 0 by default.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct ReadbackDelay(pub u32);

/// A texture to copy.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub(super) image: AssetId<Image>,
    pub(super) size: UVec2,
    /// Stamp of the drawn picture.
    pub(super) stamp: Stamp,
}

/// The picture of one agent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) agent: Entity,
    /// Index of its source.
    pub(super) source: usize,
    pub(super) cell: URect,
}

/// A copy in progress.
struct Copied {
    buffer: Buffer,
    sources: Vec<(Source, u64)>,
    pieces: Vec<Piece>,
}

/// The buffers: a single one as long as no frame is delayed.
#[derive(Default, Resource, Reflect)]
#[reflect(Resource)]
pub(super) struct Readback {
    #[reflect(ignore)]
    on_the_way: VecDeque<Copied>,
    #[reflect(ignore)]
    spare: Vec<Buffer>,
}

/// Pictures in a mapped buffer.
pub(super) struct MappedFrames {
    copied: Copied,
}

fn pitch(width: u32) -> u32 {
    (width * 4).next_multiple_of(ROW)
}

impl Readback {
    /// Copies the sources as they are drawn now, and waits for the copy that was begun `delay` calls ago.
    pub(super) fn exchange(
        &mut self,
        render_world: &World,
        sources: Vec<Source>,
        pieces: Vec<Piece>,
        delay: usize,
    ) -> Result<MappedFrames, CameraError> {
        let copied = self.copy(render_world, sources, pieces)?;
        self.on_the_way.push_back(copied);
        while self.on_the_way.len() > delay + 1 {
            self.on_the_way.pop_front();
        }
        let late = self.on_the_way.len() <= delay;
        let Some(copied) = (!late).then(|| self.on_the_way.pop_front()).flatten() else {
            return Err(CameraError::Missing("the readback is late".into()));
        };
        wait(render_world.resource::<RenderDevice>(), &copied.buffer)?;
        Ok(MappedFrames { copied })
    }

    fn copy(&mut self, render_world: &World, sources: Vec<Source>, pieces: Vec<Piece>) -> Result<Copied, CameraError> {
        let mut size = 0;
        let offset = |source: &Source| {
            let offset = size;
            size += u64::from(pitch(source.size.x)) * u64::from(source.size.y);
            offset
        };
        let offsets: Vec<u64> = sources.iter().map(offset).collect();
        let device = render_world.resource::<RenderDevice>();
        let buffer = self.buffer(device, size);
        let images = render_world.resource::<RenderAssets<GpuImage>>();
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("frames") });
        for (source, &offset) in sources.iter().zip(&offsets) {
            let image = images
                .get(source.image)
                .ok_or_else(|| CameraError::Missing("its texture is not on the graphics adapter".into()))?;
            let layout =
                TexelCopyBufferLayout { offset, bytes_per_row: Some(pitch(source.size.x)), rows_per_image: None };
            let size = Extent3d { width: source.size.x, height: source.size.y, depth_or_array_layers: 1 };
            encoder.copy_texture_to_buffer(
                image.texture.as_image_copy(),
                TexelCopyBufferInfo { buffer: &buffer, layout },
                size,
            );
        }
        render_world.resource::<RenderQueue>().submit([encoder.finish()]);
        Ok(Copied { buffer, sources: sources.into_iter().zip(offsets).collect(), pieces })
    }

    fn buffer(&mut self, device: &RenderDevice, size: u64) -> Buffer {
        self.spare.retain(|buffer| buffer.size() == size);
        self.spare.pop().unwrap_or_else(|| {
            device.create_buffer(&BufferDescriptor {
                label: Some("frames"),
                size,
                usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })
    }

    /// Takes the buffer back for the next copy.
    pub(super) fn reuse(&mut self, frames: MappedFrames) {
        frames.copied.buffer.unmap();
        self.spare.push(frames.copied.buffer);
    }
}

fn wait(device: &RenderDevice, buffer: &Buffer) -> Result<(), CameraError> {
    let (sender, receiver) = std::sync::mpsc::channel();
    device.map_buffer(&buffer.slice(..), MapMode::Read, move |result| {
        // The receiver is gone if the wait failed.
        let _ = sender.send(result);
    });
    device.poll(PollType::wait_indefinitely()).map_err(|error| CameraError::Missing(error.to_string()))?;
    match receiver.try_recv() {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) => Err(CameraError::Missing(error.to_string())),
        Err(_) => Err(CameraError::Missing("the graphics adapter did not answer".into())),
    }
}

impl MappedFrames {
    /// Passes each picture to `take`, with its stamp and its rows: 4 bytes a pixel, top row first.
    pub(super) fn hand_out(&self, mut take: impl FnMut(Entity, Stamp, &mut dyn Iterator<Item = &[u8]>)) {
        let bytes = self.copied.buffer.slice(..).get_mapped_range();
        for piece in &self.copied.pieces {
            let (source, offset) = self.copied.sources[piece.source];
            let pitch = pitch(source.size.x) as usize;
            let left = offset as usize + piece.cell.min.x as usize * 4;
            let width = piece.cell.width() as usize * 4;
            let mut rows = (piece.cell.min.y as usize..piece.cell.max.y as usize).map(|y| {
                let start = left + y * pitch;
                &bytes[start..start + width]
            });
            take(piece.agent, source.stamp, &mut rows);
        }
    }
}

// Preparation of textures for the requested pictures.

/// The common texture and its division into cells.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct Atlas {
    /// Sizes of the pictures for which it was made.
    sizes: Vec<UVec2>,
    pub(super) layout: Layout,
    pub(super) image: Option<Handle<Image>>,
}

/// Makes room for all pictures. Does nothing as long as their sizes are unchanged.
pub(super) fn prepare(world: &mut World, requests: &Requests) -> Result<(), CameraError> {
    divide_atlas(world, requests)?;
    let mut cameras: Vec<(Entity, UVec2)> = Vec::new();
    for (request, camera) in &requests.through {
        if !cameras.contains(&(*camera, request.size)) {
            cameras.push((*camera, request.size));
        }
    }
    world.resource_scope(|world, mut targets: Mut<BorrowedTargets>| {
        targets.update(&cameras, &mut world.resource_mut::<Assets<Image>>());
    });
    raise_border(world, requests);
    Ok(())
}

fn divide_atlas(world: &mut World, requests: &Requests) -> Result<(), CameraError> {
    let sizes: Vec<UVec2> = requests.following.iter().map(|follow| follow.request.size).collect();
    if sizes.is_empty() || sizes == world.resource::<Atlas>().sizes {
        return Ok(());
    }
    let limit = world.resource::<RenderDevice>().limits().max_texture_dimension_2d;
    let layout = Layout::new(&sizes, limit)?;
    let atlas = world.resource::<Atlas>();
    let mut image = atlas.image.clone().filter(|_| atlas.layout.size == layout.size);
    if image.is_none() {
        let new = world.resource_mut::<Assets<Image>>().add(target_image(layout.size));
        point_camera(world, new.clone());
        image = Some(new);
    }
    *world.resource_mut::<Atlas>() = Atlas { sizes, layout, image };
    Ok(())
}

/// Lets the shared camera draw on the texture.
fn point_camera(world: &mut World, image: Handle<Image>) {
    let camera = world.resource::<SensorViews>().camera.filter(|&camera| world.get::<Camera>(camera).is_some());
    let camera = camera.unwrap_or_else(|| spawn_camera(world));
    world.resource_mut::<SensorViews>().camera = Some(camera);
    let mut camera = world.entity_mut(camera);
    camera.insert(render_target(image));
    if let Some(mut projection) = camera.get_mut::<Projection>() {
        // Makes Bevy look at the new target's size.
        projection.set_changed();
    }
}

/// Raises the border of tile layers to the largest visible distance.
fn raise_border(world: &mut World, requests: &Requests) {
    let seen = |follow: &FollowRequest| {
        let size = follow.request.size.as_vec2();
        follow.width.max(follow.width * size.y / size.x) / 2.0 + 1.0
    };
    let needed = requests.following.iter().map(seen).fold(0.0, f32::max);
    if world.resource::<TileBorder>().0 < needed {
        world.resource_mut::<TileBorder>().0 = needed;
    }
}
