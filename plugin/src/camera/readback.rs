//! Readback of pictures from the graphics adapter: one buffer and one wait for all agents.

use std::collections::VecDeque;

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
};

use super::{CameraError, sensor_view::Stamp};

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
