//! Bevy's list of changes for a renderer, in apps without one.

use bevy::{
    app::SubApp,
    platform::cell::SyncCell,
    prelude::*,
    render::{RenderApp, extract_plugin::ExtractPlugin},
};

/// Empties the list in place of a renderer.
#[derive(Resource, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
struct NoRenderer(#[reflect(ignore)] SyncCell<SubApp>);

/// Bevy notes changes of sprites, meshes and cameras for the renderer, and fails if the list is not kept. The plugin
/// keeps the list and empties it.
pub(crate) struct RenderListPlugin;

impl Plugin for RenderListPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_some() || app.is_plugin_added::<ExtractPlugin>() {
            return;
        }
        app.add_plugins(ExtractPlugin::default());
        // Removed at once: plugins that find the sub-app would assume a renderer and add their systems to it.
        if let Some(renderer) = app.remove_sub_app(RenderApp) {
            // Nothing else reads the list.
            app.insert_resource(NoRenderer(SyncCell::new(renderer))).add_systems(Last, empty_list.ambiguous_with_all());
        }
    }
}

fn empty_list(world: &mut World) {
    world.resource_scope(|world, mut renderer: Mut<NoRenderer>| {
        // Each frame, as a renderer does. The list changes entities, and these changes must not depend on the World's
        // age.
        renderer.0.get().extract(world);
    });
}
