//! Tests of the program in a shell: exit codes, and messages about failed and unfinished work.

#[path = "../hostile/dice.rs"]
mod dice;
mod escapes;
mod kills;
#[cfg(target_os = "linux")]
mod limits;
#[path = "../shared/program.rs"]
mod program;
mod recordings;
mod repaired;
#[cfg(unix)]
mod stop_times;
#[cfg(unix)]
mod stopped;
#[cfg(target_os = "linux")]
mod stopped_view;
#[cfg(target_os = "linux")]
mod traced;
mod trained_on;
#[cfg(target_os = "linux")]
mod unwritable;
#[cfg(unix)]
mod watched;
mod written;
