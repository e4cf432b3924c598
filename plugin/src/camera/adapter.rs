//! Finding a graphics adapter.

use bevy::{
    render::settings::{Backends, RenderCreation, WgpuSettings},
    tasks::block_on,
};

use crate::vision::VisionError;

/// Settings of a renderer without a window. OpenGL is left out: it needs a display, and its drivers print.
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

/// Lets the C library keep the memory that drivers free after each picture, instead of giving it back to the kernel and
/// asking for it again.
///
/// Software Vulkan builds each picture in several megabytes of small blocks. glibc returns them at the end of each,
/// which costs a third of the time in page faults; the size from which it does so is twice that of the largest block of
/// its own that was ever freed, up to 32 MiB.
pub(super) fn keep_memory() {
    const LARGE: usize = 31 << 20;
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGE)));
}

/// Bevy panics without an adapter, so that it must be looked for first.
pub(super) fn check() -> Result<(), VisionError> {
    let settings = settings();
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = settings.backends.unwrap_or(Backends::PRIMARY);
    descriptor.flags = settings.instance_flags;
    let instance = wgpu::Instance::new(descriptor);
    let options = wgpu::RequestAdapterOptions { power_preference: settings.power_preference, ..Default::default() };
    block_on(instance.request_adapter(&options)).map(drop).map_err(|_| VisionError::NoAdapter)
}
