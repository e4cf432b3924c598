//! Mesa without its warnings where there is no desktop.

use std::{os::unix::process::CommandExt, path::Path, process::Command};

/// The variable that switches off Mesa's layer that chooses among devices.
const SWITCH: &str = "NODEVICE_SELECT";

/// Restarts the program, as the same process, with Mesa's choice among devices switched off, if there is no folder of a
/// desktop session. The choice asks a Wayland desktop first, whose library then complains on standard error, several
/// times. wgpu chooses by itself, so nothing is lost.
///
/// The layer reads the environment of the process, which a program cannot change in itself without unsafe code.
pub(crate) fn silence_warnings() {
    let has_session = std::env::var_os("XDG_RUNTIME_DIR").is_some_and(|folder| Path::new(&folder).is_absolute());
    if has_session || std::env::var_os(SWITCH).is_some() {
        return;
    }
    let mut args = std::env::args_os();
    let (Some(name), Ok(program)) = (args.next(), std::env::current_exe()) else { return };
    // It returns only if it fails; the program goes on, with Mesa's warnings.
    let _ = Command::new(program).arg0(name).args(args).env(SWITCH, "1").exec();
}
