//! Detection of a graphics adapter, and settings of the renderer.

use bevy::{
    render::settings::{Backends, RenderCreation, WgpuSettings},
    tasks::block_on,
};

use crate::vision::VisionError;

/// Returns the settings of a renderer without a window. OpenGL is left out: it needs a display, and its drivers
/// print.
fn settings() -> WgpuSettings {
    WgpuSettings { backends: Some(Backends::from_env().unwrap_or(Backends::PRIMARY)), ..WgpuSettings::default() }
}

pub(crate) fn creation() -> RenderCreation {
    settings().into()
}

/// Settings of a renderer that draws nothing.
pub(crate) fn none() -> RenderCreation {
    WgpuSettings { backends: None, ..WgpuSettings::default() }.into()
}

/// Lets the C library keep the memory that drivers free after each picture, instead of returning it to the kernel.
///
/// Software Vulkan builds each picture in several megabytes of small blocks. glibc returns them after each picture,
/// and the page faults cost a third of the time. glibc does so from a size that is twice the largest separately
/// mapped block ever freed, up to 32 MiB.
pub(super) fn keep_memory() {
    const LARGE: usize = 31 << 20;
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGE)));
}

/// Checks for an adapter, because Bevy panics without one.
pub(super) fn check() -> Result<(), VisionError> {
    let settings = settings();
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = settings.backends.unwrap_or(Backends::PRIMARY);
    descriptor.flags = settings.instance_flags;
    let instance = wgpu::Instance::new(descriptor);
    let options = wgpu::RequestAdapterOptions { power_preference: settings.power_preference, ..Default::default() };
    block_on(instance.request_adapter(&options)).map(drop).map_err(|_| VisionError::NoAdapter)
}
