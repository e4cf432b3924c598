//! Parts of Bevy that a build may lack, and their place in a World without a screen: the event loop and the renderer.
//!
//! A game may switch on Bevy's `bevy_winit` and `bevy_render` without the features `window` and `camera` of this crate,
//! and Cargo does not say so. The functions here therefore import all of `bevy` within their own block. Where Bevy has
//! the module `winit` or `render`, that import hides the module of this name beside them. Where Bevy lacks it, the
//! types beside them stand in, which no group of plugins contains.

use bevy::{
    app::{PanicHandlerPlugin, PluginGroupBuilder, SubApp},
    asset::{AssetLoader, LoadContext, io::Reader},
    image::{CompressedImageFormatSupport, CompressedImageFormats},
    platform::cell::SyncCell,
    prelude::*,
};
use std::sync::atomic::{AtomicBool, Ordering};
use tracing::{dispatcher, subscriber::NoSubscriber};

/// The event loop of a Bevy without `bevy_winit`.
#[allow(dead_code, reason = "used only where Bevy has no event loop")]
mod winit {
    use bevy::prelude::*;

    pub(super) struct WinitPlugin;

    impl Plugin for WinitPlugin {
        fn build(&self, _: &mut App) {}
    }
}

/// The renderer of a Bevy without `bevy_render`.
#[allow(dead_code, reason = "used only where Bevy has no renderer")]
mod render {
    use bevy::{app::AppLabel, prelude::*};

    #[derive(AppLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub(crate) struct RenderApp;

    #[derive(Default)]
    pub(crate) struct RenderPlugin {
        pub(crate) render_creation: settings::RenderCreation,
        pub(crate) synchronous_pipeline_compilation: bool,
        pub(crate) rest: (),
    }

    impl Plugin for RenderPlugin {
        fn build(&self, _: &mut App) {}
    }

    pub(crate) mod settings {
        #[derive(Default)]
        pub(crate) struct RenderCreation;

        #[derive(Default)]
        pub(crate) struct WgpuSettings {
            pub(crate) backends: Option<()>,
            pub(crate) rest: (),
        }

        impl From<WgpuSettings> for RenderCreation {
            fn from(_: WgpuSettings) -> Self {
                Self
            }
        }
    }

    pub(crate) mod extract_plugin {
        use bevy::prelude::*;

        #[derive(Default)]
        pub(crate) struct ExtractPlugin {
            pub(crate) rest: (),
        }

        impl Plugin for ExtractPlugin {
            fn build(&self, _: &mut App) {}
        }
    }

    pub(crate) mod pipelined_rendering {
        use bevy::prelude::*;

        pub(crate) struct PipelinedRenderingPlugin;

        impl Plugin for PipelinedRenderingPlugin {
            fn build(&self, _: &mut App) {}
        }
    }
}

/// The shaders of a Bevy without `bevy_shader`.
#[allow(dead_code, reason = "used only where Bevy has no shaders")]
mod shader {
    use bevy::{
        asset::{AssetLoader, LoadContext, io::Reader},
        prelude::*,
    };

    #[derive(Asset, TypePath)]
    pub(crate) struct Shader;

    impl Shader {
        pub(crate) fn from_wgsl(_: &'static str, _: String) -> Self {
            Self
        }
    }

    #[derive(TypePath)]
    pub(crate) struct ShaderLoader;

    impl AssetLoader for ShaderLoader {
        type Asset = Shader;
        type Settings = ();
        type Error = std::io::Error;

        async fn load(&self, _: &mut dyn Reader, _: &(), _: &mut LoadContext<'_>) -> Result<Shader, Self::Error> {
            Ok(Shader)
        }
    }
}

/// What draws cameras, of a Bevy without `bevy_core_pipeline`.
#[allow(dead_code, unused_imports, reason = "used only where Bevy draws no cameras")]
mod core_pipeline {
    use bevy::prelude::*;

    #[derive(Default)]
    pub(crate) struct CorePipelinePlugin;

    impl Plugin for CorePipelinePlugin {
        fn build(&self, _: &mut App) {}
    }

    pub(crate) mod core_2d {
        pub(crate) use super::super::Nothing as Core2dPlugin;
    }

    pub(crate) mod core_3d {
        pub(crate) use super::super::Nothing as Core3dPlugin;
    }

    pub(crate) mod oit {
        pub(crate) use super::super::Nothing as OrderIndependentTransparencyPlugin;
    }

    pub(crate) mod prepass {
        pub(crate) use super::super::Nothing as BackgroundMotionVectorsPlugin;
    }

    pub(crate) mod tonemapping {
        pub(crate) use super::super::Nothing as TonemappingPlugin;
        use bevy::prelude::*;

        #[derive(Resource, Reflect)]
        #[reflect(Resource)]
        pub(crate) struct TonemappingLuts {
            pub(crate) blender_filmic: Handle<Image>,
            pub(crate) agx: Handle<Image>,
            pub(crate) tony_mc_mapface: Handle<Image>,
        }
    }
}

/// The gamepads of a Bevy without `bevy_gilrs`.
#[allow(dead_code, unused_imports, reason = "used only where Bevy has no gamepads")]
mod gilrs {
    pub(crate) use super::Nothing as GilrsPlugin;
}

/// The drawn gizmos of a Bevy without `bevy_gizmos_render`.
#[allow(dead_code, unused_imports, reason = "used only where Bevy draws no gizmos")]
mod gizmos_render {
    pub(crate) use super::Nothing as GizmoRenderPlugin;
}

/// The log of a Bevy without `bevy_log`.
#[allow(dead_code, reason = "used only where Bevy has no log")]
mod log {
    use bevy::prelude::*;

    #[derive(Default)]
    pub(crate) struct LogPlugin {
        pub(crate) rest: (),
    }

    impl Plugin for LogPlugin {
        fn build(&self, _: &mut App) {}
    }
}

/// The sounds of a Bevy without `bevy_audio`.
#[allow(dead_code, unused_imports, reason = "used only where Bevy has no sounds")]
mod audio {
    use bevy::{
        asset::{AssetLoader, LoadContext, io::Reader},
        prelude::*,
    };

    #[derive(Default)]
    pub(crate) struct AudioPlugin {
        pub(crate) global_volume: GlobalVolume,
    }

    impl Plugin for AudioPlugin {
        fn build(&self, _: &mut App) {}
    }

    #[derive(Resource, Default, Reflect)]
    #[reflect(Resource)]
    pub(crate) struct GlobalVolume;

    #[derive(Asset, TypePath)]
    pub(crate) struct Pitch;

    #[derive(Asset, TypePath)]
    pub(crate) struct AudioSource;

    #[derive(Default, TypePath)]
    pub(crate) struct AudioLoader;

    impl AssetLoader for AudioLoader {
        type Asset = AudioSource;
        type Settings = ();
        type Error = std::io::Error;

        async fn load(&self, _: &mut dyn Reader, _: &(), _: &mut LoadContext<'_>) -> Result<AudioSource, Self::Error> {
            Ok(AudioSource)
        }
    }
}

/// A plugin in place of one that Bevy lacks.
#[allow(dead_code, reason = "used only where Bevy lacks a plugin")]
pub(crate) struct Nothing;

impl Plugin for Nothing {
    fn build(&self, _: &mut App) {}

    fn is_unique(&self) -> bool {
        false
    }
}

/// Leaves out the event loop, the thread that draws beside the World, and the gamepads and loudspeakers of the computer.
pub(super) fn without_devices(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    #[allow(unused_imports, reason = "Bevy may lack these modules")]
    use bevy::*;
    let plugins = without::<winit::WinitPlugin>(plugins);
    let plugins = without::<gilrs::GilrsPlugin>(plugins);
    let plugins = without::<render::pipelined_rendering::PipelinedRenderingPlugin>(plugins);
    if plugins.contains::<audio::AudioPlugin>() {
        plugins.add_after::<audio::AudioPlugin>(SilentSounds).disable::<audio::AudioPlugin>()
    } else {
        plugins
    }
}

/// Leaves the log to the first World of a program that has none: Bevy's plugin logs an error in each further World.
pub(super) fn with_one_log(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    #[allow(unused_imports, reason = "Bevy may lack these modules")]
    use bevy::*;

    /// Whether a World has looked after the log.
    static SEEN: AtomicBool = AtomicBool::new(false);

    let is_first = !SEEN.swap(true, Ordering::Relaxed);
    if is_first && dispatcher::get_default(|log| log.is::<NoSubscriber>()) {
        plugins
    } else {
        without::<log::LogPlugin>(plugins)
    }
}

fn without<P: Plugin>(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    if plugins.contains::<P>() { plugins.disable::<P>() } else { plugins }
}

/// Sets up the renderer to draw nothing. With `shows_sub_app` its sub-app exists while the game's plugins are built.
pub(super) fn without_drawing(plugins: PluginGroupBuilder, shows_sub_app: bool) -> PluginGroupBuilder {
    #[allow(unused_imports, reason = "Bevy may lack these modules")]
    use bevy::*;
    if !plugins.contains::<render::RenderPlugin>() {
        return plugins;
    }
    let render_creation = render::settings::WgpuSettings { backends: None, ..default() }.into();
    let plugins = plugins
        .set(render::RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() })
        .add_before::<render::RenderPlugin>(EmptyShaders);
    let plugins = without::<gizmos_render::GizmoRenderPlugin>(plugins);
    let plugins = if plugins.contains::<core_pipeline::CorePipelinePlugin>() {
        plugins
            .add_after::<core_pipeline::CorePipelinePlugin>(CamerasWithoutPictures)
            .disable::<core_pipeline::CorePipelinePlugin>()
    } else {
        plugins
    };
    if shows_sub_app {
        // Shown after Bevy's own plugins, which would need a graphics adapter if they found it, and hidden before any
        // plugin is finished.
        plugins.add_before::<PanicHandlerPlugin>(HiddenRenderer).add(ShownRenderer)
    } else {
        plugins.add(RenderListPlugin)
    }
}

/// Lets a game load sounds and play them to no loudspeaker, as on a computer without one.
struct SilentSounds;

impl Plugin for SilentSounds {
    fn build(&self, app: &mut App) {
        #[allow(unused_imports, reason = "Bevy may lack these modules")]
        use bevy::*;
        app.init_resource::<audio::GlobalVolume>()
            .init_asset::<audio::AudioSource>()
            .init_asset::<audio::Pitch>()
            .init_asset_loader::<audio::AudioLoader>();
    }
}

// Bevy's shaders, in apps without a renderer.

/// Loads every shader as an empty one.
///
/// Bevy's plugins load about a hundred of them, and reading what each imports is most of the work of building a World.
struct EmptyShaders;

impl Plugin for EmptyShaders {
    fn build(&self, app: &mut App) {
        #[allow(unused_imports, reason = "Bevy may lack these modules")]
        use bevy::*;

        #[derive(TypePath)]
        struct EmptyShaderLoader;

        impl AssetLoader for EmptyShaderLoader {
            type Asset = shader::Shader;
            type Settings = <shader::ShaderLoader as AssetLoader>::Settings;
            type Error = std::io::Error;

            async fn load(
                &self,
                _: &mut dyn Reader,
                _: &Self::Settings,
                context: &mut LoadContext<'_>,
            ) -> Result<shader::Shader, Self::Error> {
                Ok(shader::Shader::from_wgsl("", context.path().to_string()))
            }

            fn extensions(&self) -> &[&str] {
                &["spv", "wgsl", "vert", "frag", "comp", "wesl"]
            }
        }

        // Loaders of pictures ask which compressed formats a graphics card has.
        app.insert_resource(CompressedImageFormatSupport(CompressedImageFormats::NONE));
        if app.world().contains_resource::<AssetServer>() {
            // Announced for no files, Bevy's own loader gets none when the renderer brings it.
            app.preregister_asset_loader::<shader::ShaderLoader>(&[]).register_asset_loader(EmptyShaderLoader);
        }
    }
}

/// Gives cameras all components that they have where they are drawn.
///
/// It takes the place of Bevy's plugin, which reads a shader for each of forty formats of pictures besides, and three
/// tables of colours.
struct CamerasWithoutPictures;

impl Plugin for CamerasWithoutPictures {
    fn build(&self, app: &mut App) {
        #[allow(unused_imports, reason = "Bevy may lack these modules")]
        use bevy::*;
        app.insert_resource(core_pipeline::tonemapping::TonemappingLuts {
            blender_filmic: Handle::default(),
            agx: Handle::default(),
            tony_mc_mapface: Handle::default(),
        })
        .add_plugins((
            core_pipeline::core_2d::Core2dPlugin,
            core_pipeline::core_3d::Core3dPlugin,
            core_pipeline::tonemapping::TonemappingPlugin,
            core_pipeline::oit::OrderIndependentTransparencyPlugin,
            core_pipeline::prepass::BackgroundMotionVectorsPlugin,
        ));
    }
}

// Bevy's list of changes for a renderer, in apps without one.

/// Empties the list in place of a renderer.
#[derive(Resource, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
struct NoRenderer(#[reflect(ignore)] SyncCell<SubApp>);

/// Bevy notes changes of sprites, meshes and cameras for the renderer, and fails if the list is not kept. The plugin
/// keeps the list and empties it.
struct RenderListPlugin;

impl Plugin for RenderListPlugin {
    fn build(&self, app: &mut App) {
        #[allow(unused_imports, reason = "Bevy may lack these modules")]
        use bevy::*;
        if app.get_sub_app(render::RenderApp).is_some()
            || app.is_plugin_added::<render::extract_plugin::ExtractPlugin>()
        {
            return;
        }
        app.add_plugins(render::extract_plugin::ExtractPlugin::default());
        // Removed at once: plugins that find the sub-app would assume a renderer and add their systems to it.
        if let Some(renderer) = app.remove_sub_app(render::RenderApp) {
            keep_list(app, renderer);
        }
    }
}

/// Empties the list in place of a renderer, by its sub-app.
fn keep_list(app: &mut App, renderer: SubApp) {
    // Nothing else reads the list.
    app.insert_resource(NoRenderer(SyncCell::new(renderer))).add_systems(Last, empty_list.ambiguous_with_all());
}

fn empty_list(world: &mut World) {
    world.resource_scope(|world, mut renderer: Mut<NoRenderer>| {
        // Each frame, as a renderer does. The list changes entities, and these changes must not depend on the World's
        // age.
        renderer.0.get().extract(world);
    });
}

/// Creates the renderer's sub-app, to which plugins add systems that never run.
struct ShownRenderer;

impl Plugin for ShownRenderer {
    fn build(&self, app: &mut App) {
        #[allow(unused_imports, reason = "Bevy may lack these modules")]
        use bevy::*;
        app.add_plugins(render::extract_plugin::ExtractPlugin::default());
    }
}

/// Takes the renderer's sub-app away before plugins are finished.
struct HiddenRenderer;

impl Plugin for HiddenRenderer {
    fn build(&self, _: &mut App) {}

    fn finish(&self, app: &mut App) {
        #[allow(unused_imports, reason = "Bevy may lack these modules")]
        use bevy::*;
        if app.remove_sub_app(render::RenderApp).is_none() {
            return;
        }
        // Another one, without the systems that plugins have added.
        let mut empty = App::new();
        empty.add_plugins(render::extract_plugin::ExtractPlugin::default());
        if let Some(renderer) = empty.remove_sub_app(render::RenderApp) {
            keep_list(app, renderer);
        }
    }
}
