//! Plugins of Bevy by the resources that they add, for error messages about missing resources.

/// Resources of Bevy by their short names, and the plugins that add them; `*` stands for any rest.
/// The first match counts.
const KNOWN: [(&str, &str); 37] = [
    ("ButtonInput<*", "`InputPlugin`"),
    ("Axis<*", "`InputPlugin`"),
    ("Touches", "`InputPlugin`"),
    ("Accumulated*", "`InputPlugin`"),
    ("Time", "`TimePlugin`"),
    ("Time<*", "`TimePlugin`"),
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
    ("Assets<Gltf*", "`GltfPlugin` (Bevy's feature `bevy_gltf`)"),
    ("Assets<AnimationGraph>", "`AnimationPlugin` (Bevy's feature `bevy_animation`)"),
    ("Assets<AnimationClip>", "`AnimationPlugin` (Bevy's feature `bevy_animation`)"),
    ("Assets<Shader>", "`RenderPlugin` (Bevy's feature `bevy_render`)"),
    ("Assets<*", "`init_asset`, called by the plugin that the asset belongs to,"),
    ("State<*", "`init_state`, with `StatesPlugin` (Bevy's feature `bevy_state`),"),
    ("NextState<*", "`init_state`, with `StatesPlugin` (Bevy's feature `bevy_state`),"),
    ("Messages<*", "`add_message`"),
    ("ClearColor", "`CameraPlugin` (Bevy's feature `bevy_camera`)"),
    ("GlobalAmbientLight", "`LightPlugin` (Bevy's feature `bevy_light`)"),
    ("DirectionalLightShadowMap", "`LightPlugin` (Bevy's feature `bevy_light`)"),
    ("UiScale", "`UiPlugin` (Bevy's feature `bevy_ui`)"),
    ("InputFocus", "`InputFocusPlugin` (Bevy's feature `bevy_input_focus`)"),
    ("GizmoConfigStore", "`GizmoPlugin` (Bevy's feature `bevy_gizmos`)"),
    ("DiagnosticsStore", "`DiagnosticsPlugin`"),
    ("FrameCount", "`FrameCountPlugin`"),
    ("RenderDevice", "a renderer, which a headless World does not have: it"),
    ("EventLoopProxyWrapper*", "`WinitPlugin`, which a headless World does not have: it"),
    ("DisplayHandleWrapper", "`WinitPlugin`, which a headless World does not have: it"),
    ("WinitMonitors", "`WinitPlugin`, which a headless World does not have: it"),
    ("Rapier*", "`RapierPhysicsPlugin`"),
];

/// Returns the plugin that adds a resource of this short name.
pub(crate) fn plugin_of(resource: &str) -> Option<&'static str> {
    KNOWN.iter().find(|(name, _)| is_named(resource, name)).map(|(_, plugin)| *plugin)
}

fn is_named(resource: &str, name: &str) -> bool {
    name.strip_suffix('*').map_or(resource == name, |beginning| resource.starts_with(beginning))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_game_s_own_resource_is_not_taken_for_bevy_s() {
        assert_eq!(plugin_of("TimeLeft"), None);
        assert_eq!(plugin_of("Touches2"), None);
        assert_eq!([plugin_of("Time"), plugin_of("Time<Fixed>")], [Some("`TimePlugin`"); 2]);
        assert!(plugin_of("Assets<GltfNode>").is_some_and(|plugin| plugin.contains("GltfPlugin")));
        assert!(plugin_of("Assets<Level>").is_some_and(|plugin| plugin.contains("init_asset")));
    }
}
