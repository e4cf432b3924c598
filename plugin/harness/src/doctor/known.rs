//! Diagnostics, counters and clocks of known engines, which comparisons leave out by default.

/// Crates of physics engines.
const PHYSICS: [&str; 4] = ["avian2d::", "avian3d::", "bevy_rapier2d::", "bevy_rapier3d::"];

/// Types of theirs that count runs or follow the screen, by the last part of the path: modules differ from version to
/// version.
const COUNTERS: [&str; 4] =
    ["LastPhysicsTick", "PhysicsDiagnosticsUiSettings", "SimulationToRenderTime", "DebugRenderContext"];

/// Bevy's overlays, with frame times. `bevy_diagnostic` is never compared.
const OVERLAYS: &str = "bevy_dev_tools::";

/// Returns whether a type holds only measurements of an engine: how long its parts took, how often they ran, or its own
/// copy of a clock.
pub(super) fn is_diagnostic(path: &str) -> bool {
    let is_of_physics = |path: &str| PHYSICS.iter().any(|engine| path.starts_with(engine));
    // `Time<Physics>` and `Time<Substeps>`.
    if let Some(clock) = path.strip_prefix("bevy_time::time::Time<") {
        return is_of_physics(clock);
    }
    let plain = path.split('<').next().unwrap_or(path);
    let name = plain.rsplit("::").next().unwrap_or(plain);
    path.starts_with(OVERLAYS) || (is_of_physics(path) && (name.ends_with("Diagnostics") || COUNTERS.contains(&name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_of_engines_are_left_out() {
        for path in [
            "avian2d::dynamics::solver::diagnostics::SolverDiagnostics",
            "avian3d::collision::diagnostics::CollisionDiagnostics",
            "avian2d::spatial_query::diagnostics::SpatialQueryDiagnostics",
            "avian2d::diagnostics::total::PhysicsTotalDiagnostics",
            "avian3d::diagnostics::entity_counters::PhysicsEntityDiagnostics",
            "avian3d::picking::PhysicsPickingDiagnostics",
            "avian2d::diagnostics::ui::PhysicsDiagnosticsUiSettings",
            "avian2d::schedule::LastPhysicsTick",
            "bevy_time::time::Time<avian2d::schedule::time::Physics>",
            "bevy_time::time::Time<avian3d::schedule::time::Substeps>",
            "bevy_rapier2d::plugin::context::SimulationToRenderTime",
            "bevy_rapier3d::render::DebugRenderContext",
            "bevy_dev_tools::fps_overlay::FpsOverlayConfig",
        ] {
            assert!(is_diagnostic(path), "{path}");
        }
    }

    #[test]
    fn simulated_state_and_measurements_of_games_are_compared() {
        for path in [
            "avian2d::dynamics::rigid_body::LinearVelocity",
            "avian2d::dynamics::integrator::Gravity",
            "bevy_rapier2d::dynamics::rigid_body::Velocity",
            "bevy_time::time::Time<bevy_time::fixed::Fixed>",
            "my_game::SolverDiagnostics",
            "my_game::LastPhysicsTick",
            "avian2d_extras::Diagnostics",
        ] {
            assert!(!is_diagnostic(path), "{path}");
        }
    }
}
