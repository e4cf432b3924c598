//! Which plugin brings a resource: what a game is told when it asks for one that is not there.

use std::any::TypeId;

use bevy::prelude::*;

/// Resources of Bevy by the beginning of their short names, and who brings them. The first match counts.
const KNOWN: [(&str, &str); 33] = [
    ("ButtonInput<", "`InputPlugin`"),
    ("Axis<", "`InputPlugin`"),
    ("Touches", "`InputPlugin`"),
    ("Accumulated", "`InputPlugin`"),
    ("Time", "`TimePlugin`"),
    ("AssetServer", "`AssetPlugin`"),
    ("Assets<Image>", "`ImagePlugin`"),
    ("Assets<TextureAtlasLayout>", "`ImagePlugin`"),
    ("Assets<Mesh>", "`MeshPlugin` (Bevy's feature `bevy_mesh`)"),
    ("Assets<ColorMaterial>", "`SpriteRenderPlugin` (Bevy's feature `bevy_sprite_render`)"),
    ("Assets<StandardMaterial>", "`PbrPlugin` (Bevy's feature `bevy_pbr`)"),
    ("Assets<AudioSource>", "`AudioPlugin` (Bevy's feature `bevy_audio`)"),
    ("Assets<Pitch>", "`AudioPlugin` (Bevy's feature `bevy_audio`)"),
    ("GlobalVolume", "`AudioPlugin` (Bevy's feature `bevy_audio`)"),
    ("Assets<Font>", "`TextPlugin` (Bevy's feature `bevy_text`)"),
    ("Assets<Gltf", "`GltfPlugin` (Bevy's feature `bevy_gltf`)"),
    ("Assets<AnimationGraph>", "`AnimationPlugin` (Bevy's feature `bevy_animation`)"),
    ("Assets<AnimationClip>", "`AnimationPlugin` (Bevy's feature `bevy_animation`)"),
    ("Assets<Shader>", "`RenderPlugin` (Bevy's feature `bevy_render`)"),
    ("Assets<", "`init_asset`, called by the plugin that the asset belongs to,"),
    ("State<", "`init_state`, with `StatesPlugin` (Bevy's feature `bevy_state`),"),
    ("NextState<", "`init_state`, with `StatesPlugin` (Bevy's feature `bevy_state`),"),
    ("Messages<", "`add_message`"),
    ("ClearColor", "`CameraPlugin` (Bevy's feature `bevy_camera`)"),
    ("GlobalAmbientLight", "`LightPlugin` (Bevy's feature `bevy_light`)"),
    ("DirectionalLightShadowMap", "`LightPlugin` (Bevy's feature `bevy_light`)"),
    ("UiScale", "`UiPlugin` (Bevy's feature `bevy_ui`)"),
    ("InputFocus", "`InputFocusPlugin` (Bevy's feature `bevy_input_focus`)"),
    ("GizmoConfigStore", "`GizmoPlugin` (Bevy's feature `bevy_gizmos`)"),
    ("DiagnosticsStore", "`DiagnosticsPlugin`"),
    ("FrameCount", "`FrameCountPlugin`"),
    ("RenderDevice", "a renderer, which a headless World does not have: it"),
    ("Rapier", "`RapierPhysicsPlugin`"),
];

/// Who brings a resource of this short name.
pub(crate) fn plugin_of(resource: &str) -> Option<&'static str> {
    KNOWN.iter().find(|(name, _)| resource.starts_with(name)).map(|(_, plugin)| *plugin)
}

/// Resources of Bevy that some system of this World asks for and that are not there, with who brings them. This is what
/// can be said of them where Bevy is built without names.
pub(crate) fn missing_by_type(world: &World) -> Vec<&'static str> {
    let known = [
        (TypeId::of::<AssetServer>(), "`AssetServer` (`AssetPlugin`)"),
        (TypeId::of::<Assets<Image>>(), "`Assets<Image>` (`ImagePlugin`)"),
        (TypeId::of::<Assets<Mesh>>(), "`Assets<Mesh>` (`MeshPlugin`)"),
        #[cfg(feature = "camera")]
        (TypeId::of::<Assets<ColorMaterial>>(), "`Assets<ColorMaterial>` (`SpriteRenderPlugin`)"),
        (TypeId::of::<ButtonInput<KeyCode>>(), "`ButtonInput<KeyCode>` (`InputPlugin`)"),
        (TypeId::of::<ButtonInput<MouseButton>>(), "`ButtonInput<MouseButton>` (`InputPlugin`)"),
        (TypeId::of::<ClearColor>(), "`ClearColor` (`CameraPlugin`)"),
        (TypeId::of::<Touches>(), "`Touches` (`InputPlugin`)"),
        (TypeId::of::<Time>(), "`Time` (`TimePlugin`)"),
        (TypeId::of::<Time<Fixed>>(), "`Time<Fixed>` (`TimePlugin`)"),
    ];
    let is_missing = |id: TypeId| {
        let asked_for = world.components().get_id(id);
        asked_for.is_some_and(|id| !world.contains_resource_by_id(id))
    };
    known.into_iter().filter(|(id, _)| is_missing(*id)).map(|(_, words)| words).collect()
}

#[cfg(test)]
mod tests {
    use bevy::ecs::system::BoxedSystem;

    use super::*;

    #[test]
    fn what_is_asked_for_and_not_there_is_told_without_names() {
        let mut world = World::new();
        assert_eq!(missing_by_type(&world), Vec::<&str>::new(), "nobody asks for anything");
        let ask = |_: Res<AssetServer>, _: Res<ButtonInput<KeyCode>>, _: Res<Time>| {};
        let mut system: BoxedSystem = Box::new(IntoSystem::into_system(ask));
        system.initialize(&mut world);
        let keys = "`ButtonInput<KeyCode>` (`InputPlugin`)";
        assert_eq!(missing_by_type(&world), ["`AssetServer` (`AssetPlugin`)", keys, "`Time` (`TimePlugin`)"]);
        world.init_resource::<ButtonInput<KeyCode>>();
        world.init_resource::<Time>();
        assert_eq!(missing_by_type(&world), ["`AssetServer` (`AssetPlugin`)"]);
    }
}
