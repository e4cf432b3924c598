//! Location of the sources of the `bevy` package in cargo's folders.

use std::{
    env,
    path::PathBuf,
    process::{Command, Stdio},
};

use serde_json::Value;

/// Returns the folder of the `bevy` package of this workspace, from cargo.
pub(crate) fn bevy_folder() -> Result<PathBuf, String> {
    // Cargo also lists dependencies of the workspace's tests, which may not have been downloaded yet.
    let metadata = metadata(&["--offline"]).or_else(|_| metadata(&[]))?;
    let manifest = metadata["packages"]
        .as_array()
        .into_iter()
        .flatten()
        .find(|package| {
            package["name"] == "bevy" && package["version"].as_str().is_some_and(|v| v.starts_with("0.19."))
        })
        .and_then(|package| package["manifest_path"].as_str())
        .ok_or("there is no package bevy 0.19 in this workspace")?;
    let folder = PathBuf::from(manifest).parent().map(PathBuf::from);
    folder.ok_or_else(|| format!("{manifest} lies in no folder"))
}

/// Returns cargo's metadata of the workspace.
fn metadata(options: &[&str]) -> Result<Value, String> {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["metadata", "--locked", "--format-version", "1"]).args(options);
    // Packages for other systems need not have been downloaded.
    if let Ok(target) = env::var("TARGET") {
        command.args(["--filter-platform", &target]);
    }
    // Cargo asks the compiler, which reads its standard input.
    let output =
        command.stdin(Stdio::null()).output().map_err(|error| format!("cannot run cargo metadata: {error}"))?;
    if !output.status.success() {
        let why = String::from_utf8_lossy(&output.stderr).trim().replace('\n', "; ");
        return Err(format!("cargo metadata does not find it ({why}); `cargo fetch` may help"));
    }
    serde_json::from_slice(&output.stdout)
        .map_err(|error| format!("cargo metadata answers something else than JSON: {error}"))
}
