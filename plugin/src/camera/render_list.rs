//! Bevy's list of what a renderer has yet to hear of, in apps that have none.

use bevy::{
    app::SubApp,
    platform::cell::SyncCell,
    prelude::*,
    render::{RenderApp, extract_plugin::ExtractPlugin},
};

/// Who would draw, and takes what is on the list.
#[derive(Resource, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
struct NoRenderer(#[reflect(ignore)] SyncCell<SubApp>);

/// Sprites, meshes and cameras are noted for the renderer as they come and go, and Bevy fails where nobody keeps the list.
/// Keeps it and empties it.
pub(crate) struct RenderListPlugin;

impl Plugin for RenderListPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_some() || app.is_plugin_added::<ExtractPlugin>() {
            return;
        }
        app.add_plugins(ExtractPlugin::default());
        // Removed at once: plugins that find the sub-app would think that there is a renderer and add their systems to it.
        if let Some(renderer) = app.remove_sub_app(RenderApp) {
            // Nobody else looks at the list.
            app.insert_resource(NoRenderer(SyncCell::new(renderer))).add_systems(Last, empty_list.ambiguous_with_all());
        }
    }
}

fn empty_list(world: &mut World) {
    world.resource_scope(|world, mut renderer: Mut<NoRenderer>| {
        // Each frame, as a renderer does: what is on the list changes entities, which must not depend on how old the World is.
        renderer.0.get().extract(world);
    });
}
