//! The scope of comparisons: the game's state, without the engine's housekeeping.

use super::report::Comparison;

/// Path prefixes of the plugin's own types, and of types that the engine creates for itself: on other threads, for the
/// screen, or whenever a file happens to be loaded.
const HOUSEKEEPING: [&str; 31] = [
    "accesskit",
    "bevy_a11y::",
    "bevy_anti_alias::",
    "bevy_app::",
    "bevy_asset::",
    "bevy_audio::",
    "bevy_camera::",
    "bevy_clipboard::",
    "bevy_core_pipeline::",
    "bevy_diagnostic::",
    "bevy_gilrs::",
    "bevy_gizmos",
    "bevy_image::",
    "bevy_input_focus::",
    "bevy_log::",
    "bevy_pbr::",
    "bevy_picking::",
    "bevy_playbot::",
    "bevy_post_process::",
    "bevy_render::",
    "bevy_shader::",
    "bevy_sprite_render::",
    "bevy_text::",
    "bevy_ui",
    "bevy_window::",
    "bevy_winit::",
    "playbot_cli::",
    "playbot_lab::",
    "playbot_learner::",
    "wgpu",
    "winit::",
];

/// The parts of the engine's entity system that belong to the game.
const HIERARCHY: [&str; 2] = ["bevy_ecs::hierarchy::ChildOf", "bevy_ecs::hierarchy::Children"];

/// Clocks and keys go on from one episode to the next.
const GOES_ON: [&str; 4] = ["bevy_time::", "bevy_input::", "leafwing_input_manager::", "bevy_enhanced_input::"];

/// Bevy's real-time clock. Without a window it is a mock; [`Comparison::Clock`] reveals its readers.
const WALL_CLOCK: &str = "bevy_time::time::Time<bevy_time::real::Real>";

/// Returns whether a type is the engine's or the plugin's, so that it says little about the cause of a difference.
pub(super) fn is_engine(path: &str) -> bool {
    path.starts_with("bevy_") || HOUSEKEEPING.iter().any(|prefix| path.starts_with(prefix))
}

/// Returns whether components and resources of this type are compared at all.
pub(super) fn is_compared(path: &str) -> bool {
    let is_housekeeping = HOUSEKEEPING.iter().any(|prefix| path.starts_with(prefix)) || path == WALL_CLOCK;
    !is_housekeeping && (!path.starts_with("bevy_ecs::") || HIERARCHY.contains(&path))
}

/// Returns whether they are part of this comparison.
pub(super) fn is_compared_in(comparison: Comparison, path: &str) -> bool {
    comparison != Comparison::Restart || !GOES_ON.iter().any(|prefix| path.starts_with(prefix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_games_state_is_compared_and_the_engines_housekeeping_is_not() {
        for path in ["breakout::Score", "bevy_transform::components::transform::Transform", HIERARCHY[0]] {
            assert!(is_compared(path), "{path}");
        }
        for path in [WALL_CLOCK, "bevy_render::sync_world::RenderEntity", "bevy_playbot::control::Control"] {
            assert!(!is_compared(path), "{path}");
        }
    }

    #[test]
    fn clocks_are_no_state_that_a_restart_resets() {
        let clock = "bevy_time::time::Time<bevy_time::fixed::Fixed>";
        assert!(is_compared(clock) && is_compared_in(Comparison::Repeat, clock));
        assert!(!is_compared_in(Comparison::Restart, clock));
    }
}
