//! Errors of systems in a headless World: reported as text instead of a panic.
//!
//! Bevy passes errors to a plain function without a World. Headless Worlds run their systems on the
//! thread that ticks them, so the function stores errors per thread until the end of the frame.

use bevy::{
    ecs::{
        error::{BevyError, ErrorContext, FallbackErrorHandler, Severity, match_severity},
        system::SystemParamValidationError,
    },
    prelude::*,
};
use std::cell::RefCell;

/// Bevy's text in place of a name when it is built without its feature `debug`, which this crate
/// switches on.
const NAMELESS: &str = "<Enable the debug feature";

thread_local! {
    /// The first failure of a frame.
    static FIRST: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Lets the systems of a World that runs on one thread report errors instead of panicking: see [`take`].
pub fn listen(world: &mut World) {
    world.insert_resource(FallbackErrorHandler(keep));
}

/// Drops an error that another World on this thread has left.
pub(crate) fn clear() {
    FIRST.with_borrow_mut(|first| *first = None);
}

fn keep(error: BevyError, context: ErrorContext) {
    if error.severity() != Severity::Panic {
        return match_severity(error, context);
    }
    let words = explain(&format!("{} `{}`", context.kind(), context.name()), &error);
    FIRST.with_borrow_mut(|first| {
        first.get_or_insert(words);
    });
}

/// Takes the first failure on this thread since the last call, as text.
pub fn take() -> Option<String> {
    FIRST.with_borrow_mut(Option::take)
}

/// Explains why a system (or the `context`) could not run. Names the missing item and the plugin
/// that adds it.
pub fn explain(context: &str, error: &BevyError) -> String {
    match error.downcast_ref::<SystemParamValidationError>() {
        Some(invalid) => {
            let param = format!("{}{}", invalid.param.shortname(), invalid.field);
            describe(context, &param, &invalid.message)
        }
        None => format!("{context} failed: {error}").trim_end().to_owned(),
    }
}

/// Describes the missing item and the plugin that adds it.
fn describe(context: &str, param: &str, message: &str) -> String {
    if param.contains(NAMELESS) {
        return format!("{context} cannot run: {message}; switch on Bevy's feature `debug` to see its name");
    }
    let inner = ["Res<", "ResMut<", "NonSend<", "NonSendMut<"].iter().find_map(|kind| param.strip_prefix(kind));
    let resource = inner.and_then(|inner| inner.strip_suffix('>'));
    if let Some(resource) = resource {
        let whose = match plugin_of(resource) {
            Some(plugin) => format!("{plugin} adds it"),
            None => "insert it, or add the plugin that adds it".to_owned(),
        };
        return format!("{context} needs the resource `{resource}`, which does not exist: {whose}");
    }
    let of_messages = ["MessageReader<", "MessageWriter<"].iter().find_map(|kind| param.strip_prefix(kind));
    match of_messages.and_then(|rest| rest.split_once(">::")).map(|(kind, _)| kind) {
        Some(kind) => {
            format!("{context} needs messages of the type `{kind}`, which were never added: call `add_message`")
        }
        None => format!("{context} has a parameter `{param}` that does not work: {message}"),
    }
}

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
    fn a_missing_resource_is_named_with_the_plugin_that_brings_it() {
        let text = describe("system `setup`", "ResMut<Assets<ColorMaterial>>", "Resource does not exist");
        assert_eq!(
            text,
            "system `setup` needs the resource `Assets<ColorMaterial>`, which does not exist: `SpriteRenderPlugin` \
             (Bevy's feature `bevy_sprite_render`) adds it"
        );
        let text = describe("system `score`", "Res<Score>", "Resource does not exist");
        assert!(text.contains("`Score`") && text.ends_with("insert it, or add the plugin that adds it"), "{text}");
        let text = describe("system `hear`", "MessageReader<Bang>::messages", "Message not initialized");
        assert!(text.contains("`Bang`") && text.contains("`add_message`"), "{text}");
        let text = describe("system `x`", "Odd", "it is odd");
        assert_eq!(text, "system `x` has a parameter `Odd` that does not work: it is odd");
    }

    #[test]
    fn without_names_it_is_said_how_to_get_them() {
        let text = describe("system `aim`", "<Enable the debug feature to see the name>", "Resource does not exist");
        assert_eq!(
            text,
            "system `aim` cannot run: Resource does not exist; switch on Bevy's feature `debug` to see its name"
        );
    }

    #[test]
    fn a_game_s_own_resource_is_not_taken_for_bevy_s() {
        assert_eq!(plugin_of("TimeLeft"), None);
        assert_eq!(plugin_of("Touches2"), None);
        assert_eq!([plugin_of("Time"), plugin_of("Time<Fixed>")], [Some("`TimePlugin`"); 2]);
        assert!(plugin_of("Assets<GltfNode>").is_some_and(|plugin| plugin.contains("GltfPlugin")));
        assert!(plugin_of("Assets<Level>").is_some_and(|plugin| plugin.contains("init_asset")));
    }
}
