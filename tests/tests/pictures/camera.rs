//! Tests of camera sensors.

#[cfg(feature = "screen")]
mod errors;
#[cfg(feature = "screen")]
mod foreign;
#[cfg(feature = "screen")]
mod of;
#[cfg(feature = "screen")]
mod sensor;
#[cfg(feature = "screen")]
mod ticks;

use bevy_playbot::{camera::CameraSensorPlugin, vision::VisionError};

/// Set for a copy of this program that finds no adapter.
const CHILD: &str = "PLAYBOT_TEST_WITHOUT_ADAPTER";

#[test]
fn without_an_adapter_the_raster_is_offered() {
    if std::env::var_os(CHILD).is_some() {
        let error = CameraSensorPlugin::headless().expect_err("there is no driver");
        assert_eq!(error, VisionError::NoAdapter);
        assert!(error.to_string().contains("observation: Raster"), "{error}");
        return;
    }
    let this = std::env::current_exe().expect("a test program");
    let output = std::process::Command::new(this)
        .args(["--exact", "camera::without_an_adapter_the_raster_is_offered"])
        .envs([("VK_DRIVER_FILES", "/nowhere.json"), ("VK_ICD_FILENAMES", "/nowhere.json"), (CHILD, "1")])
        .output()
        .expect("a copy");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{said}{}", String::from_utf8_lossy(&output.stderr));
}
