//! The plugin or the system in which a panic occurs, read from the backtrace.
//!
//! Bevy passes neither to a panic's hook. A program that is built without the names of its functions, as with `strip`,
//! has only the file and the line of the panic.

use std::backtrace::Backtrace;

/// Crates whose functions stand between a panic and the plugin or system: the standard library, Bevy's scheduling, and
/// the crates that run games.
const BETWEEN: [&str; 8] =
    ["alloc::", "core::", "std::", "__rustc::", "bevy_app::", "bevy_ecs::", "bevy_playbot::", "playbot_harness::"];

/// Steps of a plugin that Bevy calls.
const STEPS: [&str; 4] = ["build", "finish", "cleanup", "ready"];

/// Returns the innermost plugin or system that runs on this thread, in words. Call it in the hook of a panic.
pub(super) fn panic_origin() -> Option<String> {
    in_words(&format!("{:?}", Backtrace::force_capture()))
}

fn in_words(backtrace: &str) -> Option<String> {
    // The outermost function of the game so far.
    let mut function = None;
    for frame in functions(backtrace) {
        if let Some((plugin, step)) = step_of_plugin(frame) {
            // Functions that are plugins have no name of their own here.
            let name = if plugin.contains("::") { Some(plugin) } else { function };
            let name = name.filter(|name| is_of_game(name))?;
            return Some(format!("in `{step}` of the plugin `{name}`"));
        }
        if frame.starts_with("bevy_ecs::") && frame.contains("__rust_begin_short_backtrace") {
            return function.map(|name| format!("in the system `{name}`"));
        }
        function = name_of(frame).or(function);
    }
    None
}

/// Returns the names of the functions in a backtrace, the innermost first.
fn functions(backtrace: &str) -> impl Iterator<Item = &str> {
    let after = backtrace.split("fn: \"").skip(1);
    after.filter_map(|rest| rest.split_once('"').map(|(name, _)| name))
}

/// Returns the plugin's type and the step, if Bevy has called this function for a plugin.
fn step_of_plugin(frame: &str) -> Option<(&str, &'static str)> {
    let beside_type = frame.strip_prefix('<').and_then(|rest| rest.split_once(" as bevy_app::plugin::Plugin>::"));
    // An implementation in another module than its type has another form.
    let elsewhere = || frame.split_once("<impl bevy_app::plugin::Plugin for ")?.1.rsplit_once(">::");
    let (plugin, rest) = beside_type.or_else(elsewhere)?;
    let step = rest.split("::").next()?;
    STEPS.iter().find(|known| **known == step).map(|step| (plugin, *step))
}

/// Returns the name of a function of the game, without the closures in it.
fn name_of(frame: &str) -> Option<&str> {
    let path = match frame.strip_prefix('<') {
        Some(rest) => rest.split_once(" as ").or_else(|| rest.split_once(">::"))?.0,
        None => frame,
    };
    let path = path.split("::{").next()?;
    (path.contains("::") && is_of_game(path)).then_some(path)
}

fn is_of_game(path: &str) -> bool {
    !BETWEEN.iter().any(|krate| path.starts_with(krate))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the debug output of a backtrace with these functions.
    fn backtrace(functions: &[&str]) -> String {
        let frames: Vec<_> =
            functions.iter().map(|name| format!("{{ fn: \"{name}\", file: \"x.rs\", line: 3 }}")).collect();
        format!("Backtrace [{}]", frames.join(", "))
    }

    const PANIC: [&str; 3] =
        ["std::panicking::panic_with_hook", "__rustc::rust_begin_unwind", "core::panicking::panic_fmt"];

    fn after_panic(functions: &[&str]) -> Option<String> {
        in_words(&backtrace(&[&PANIC, functions].concat()))
    }

    #[test]
    fn the_innermost_plugin_is_named_with_its_step() {
        let words = after_panic(&[
            "bevy_app::app::App::sub_app_mut",
            "<tilemap::TilemapPlugin as bevy_app::plugin::Plugin>::finish::{{closure}}",
            "bevy_app::app::App::finish",
            "<game::GamePlugin as bevy_app::plugin::Plugin>::build",
            "main",
        ]);
        assert_eq!(words.as_deref(), Some("in `finish` of the plugin `tilemap::TilemapPlugin`"));
    }

    #[test]
    fn a_plugin_that_is_implemented_in_another_module_than_its_type_is_named() {
        let frame = "game::setup::<impl bevy_app::plugin::Plugin for game::Levels<game::Forest>>::build::{{closure}}";
        assert_eq!(after_panic(&[frame]).as_deref(), Some("in `build` of the plugin `game::Levels<game::Forest>`"));
    }

    #[test]
    fn a_function_that_is_a_plugin_is_named() {
        let words = after_panic(&[
            "game::camera",
            "<T as bevy_app::plugin::Plugin>::build",
            "bevy_app::app::App::add_boxed_plugin",
        ]);
        assert_eq!(words.as_deref(), Some("in `build` of the plugin `game::camera`"));
    }

    #[test]
    fn a_system_is_named_without_the_functions_that_it_calls() {
        let marker = "bevy_ecs::schedule::executor::__rust_begin_short_backtrace::run_without_applying_deferred";
        let words = after_panic(&[
            "game::grid::Grid::cell",
            "game::load_level::{{closure}}",
            "<Func as bevy_ecs::system::function_system::SystemParamFunction<fn(F0) .> Out>>::run::call_inner",
            "<bevy_ecs::system::function_system::FunctionSystem<M,I,O,F> as bevy_ecs::system::system::System>::run_unsafe",
            marker,
            "game::main",
        ]);
        assert_eq!(words.as_deref(), Some("in the system `game::load_level`"));
    }

    #[test]
    fn a_panic_outside_of_plugins_and_systems_has_no_origin() {
        let harness = "<playbot_harness::foreign::ForeignPlugin as bevy_app::plugin::Plugin>::build";
        assert_eq!(after_panic(&["game::add", harness, "main"]), None);
        assert_eq!(after_panic(&["game::main", "main"]), None);
        assert_eq!(in_words("unsupported backtrace"), None);
    }
}
