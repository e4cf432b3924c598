//! The log on standard error, and libraries that write there by themselves.

use crate::output::messages::for_people;
use std::{
    collections::BTreeSet,
    fmt,
    io::IsTerminal,
    sync::{Mutex, PoisonError},
};
use tracing::{
    Event, Level, Subscriber,
    field::{Field, Visit},
};
use tracing_subscriber::{
    EnvFilter, Layer,
    field::RecordFields,
    fmt::{
        FmtContext, FormatEvent, FormatFields, MakeWriter,
        format::{DefaultFields, Format, Full, Writer},
    },
    layer::{Context, SubscriberExt},
    registry::LookupSpan,
    util::SubscriberInitExt,
};

/// Filters messages that need no warning: a window manager without settings, a renderer in software or none at all, and
/// a log that is there already. A failed graphics card is reported by the error that follows.
const QUIET: &str = "warn,winit=error,bevy_render=error,bevy_render::extract_resource=off,bevy_gltf=error,bevy_log=off,\
                     cubecl_runtime=error";

/// Messages of broken games are left out.
const WITHOUT_GAMES: &str = "off,bevy_playbot=warn,playbot=warn,playbot_games=off";

/// Logs at the levels of `RUST_LOG`, or else warnings, and more with each `-v`. With `-v` each line names its source.
pub(crate) fn init(verbose: u8, hears_games: bool) {
    let quiet = if hears_games { QUIET } else { WITHOUT_GAMES };
    let level = [quiet, "info", "debug"][usize::from(verbose.min(2))];
    let asked = EnvFilter::try_from_default_env().ok();
    let is_plain = verbose == 0 && asked.is_none();
    let filter = asked.unwrap_or_else(|| EnvFilter::new(level));
    // Colours are for people.
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    subscriber(filter, is_plain, colours, std::io::stderr).init();
}

fn subscriber<W>(filter: EnvFilter, is_plain: bool, colours: bool, writer: W) -> impl Subscriber + Send + Sync
where
    W: for<'a> MakeWriter<'a> + Send + Sync + 'static,
{
    // An error of writing the log could only be reported to the same place.
    let lines = Lines { is_plain, full: tracing_subscriber::fmt::format().without_time() };
    let format = tracing_subscriber::fmt().with_env_filter(filter).log_internal_errors(false).with_ansi(colours);
    let format = format.fmt_fields(HarmlessFields(DefaultFields::new()));
    format.event_format(lines).with_writer(writer).finish().with(FilesOnce::default())
}

/// The format of a line of the log.
struct Lines {
    /// Messages of this workspace are written as the verbs write theirs, without the source.
    is_plain: bool,
    full: Format<Full, ()>,
}

impl<S, N> FormatEvent<S, N> for Lines
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, context: &FmtContext<'_, S, N>, mut writer: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let krate = event.metadata().target().split("::").next().unwrap_or_default();
        let is_ours = krate == "playbot" || krate == "bevy_playbot" || krate.starts_with("playbot_");
        if !(self.is_plain && is_ours) {
            return self.full.format_event(context, writer, event);
        }
        writer.write_str(if *event.metadata().level() == Level::ERROR { "error: " } else { "warning: " })?;
        context.field_format().format_fields(writer.by_ref(), event)?;
        writeln!(writer)
    }
}

/// The text and values of an event without terminal control characters: much of it comes from files.
struct HarmlessFields(DefaultFields);

impl<'writer> FormatFields<'writer> for HarmlessFields {
    fn format_fields<R: RecordFields>(&self, mut writer: Writer<'writer>, fields: R) -> fmt::Result {
        let mut words = String::new();
        self.0.format_fields(Writer::new(&mut words), fields)?;
        writer.write_str(&for_people(&words))
    }
}

/// Lets each error about an asset and each warning of a training through once. Every World loads the files of its game
/// and reports the same missing ones, and a damaged checkpoint is found again at each look.
#[derive(Default)]
struct FilesOnce {
    said: Mutex<BTreeSet<String>>,
}

impl<S: Subscriber> Layer<S> for FilesOnce {
    fn event_enabled(&self, event: &Event<'_>, _: Context<'_, S>) -> bool {
        let metadata = event.metadata();
        let is_repeated = match *metadata.level() {
            Level::ERROR => metadata.target().starts_with("bevy_asset"),
            Level::WARN => ["playbot_train", "playbot_harness::sealed_file", "playbot_learner"]
                .iter()
                .any(|from| metadata.target().starts_with(from)),
            _ => false,
        };
        if !is_repeated {
            return true;
        }
        let mut message = Message::default();
        event.record(&mut message);
        self.said.lock().unwrap_or_else(PoisonError::into_inner).insert(message.0)
    }
}

/// The text of an event.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

/// Restarts the program, as the same process, with Mesa's choice among devices switched off, if there is no folder of a
/// desktop session. The choice asks a Wayland desktop first, whose library then complains on standard error, several
/// times. wgpu chooses by itself, so nothing is lost.
///
/// The layer reads the environment of the process, which a program cannot change in itself without unsafe code.
#[cfg(all(target_os = "linux", feature = "camera"))]
pub(crate) fn silence_mesa() {
    use std::{env, os::unix::process::CommandExt, path::Path, process::Command};
    const SWITCH: &str = "NODEVICE_SELECT";
    let has_session = env::var_os("XDG_RUNTIME_DIR").is_some_and(|folder| Path::new(&folder).is_absolute());
    if has_session || env::var_os(SWITCH).is_some() {
        return;
    }
    let mut args = env::args_os();
    let (Some(name), Ok(program)) = (args.next(), env::current_exe()) else { return };
    // It returns only if it fails; the program goes on, with Mesa's warnings.
    let _ = Command::new(program).arg0(name).args(args).env(SWITCH, "1").exec();
}

#[cfg(test)]
mod tests {
    use std::{io, sync::Arc};

    use super::*;

    #[derive(Clone, Default)]
    struct Page(Arc<Mutex<Vec<u8>>>);

    impl io::Write for Page {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().expect("no thread panics").extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn logged(say: impl FnOnce()) -> String {
        let page = Page::default();
        let writer = page.clone();
        let subscriber = subscriber(EnvFilter::new(QUIET), true, false, move || writer.clone());
        tracing::subscriber::with_default(subscriber, say);
        String::from_utf8(page.0.lock().expect("no thread panics").clone()).expect("Unicode")
    }

    #[test]
    fn a_missing_file_is_named_once_however_many_worlds_miss_it() {
        let text = logged(|| {
            for _world in 0..16 {
                for file in ["cake.glb", "alien.glb"] {
                    tracing::error!(target: "bevy_asset::server", "Path not found: {file}");
                }
            }
        });
        assert_eq!(text.lines().count(), 2, "{text}");
        assert!(text.contains("cake.glb") && text.contains("alien.glb"), "{text}");
    }

    #[test]
    fn a_warning_of_a_training_is_one_plain_line() {
        let text = logged(|| {
            for _list in 0..3 {
                tracing::warn!(target: "playbot_train::checkpoint", "a checkpoint is passed over: {}", "x: damaged");
            }
            tracing::warn!(target: "bevy_ecs", "something of the engine");
        });
        assert!(text.starts_with("warning: a checkpoint is passed over: x: damaged\n"), "{text}");
        assert_eq!(text.lines().count(), 2, "{text}");
        assert!(text.contains("bevy_ecs: something of the engine"), "{text}");
    }

    #[test]
    fn no_words_of_a_file_steer_the_terminal() {
        for from_us in [true, false] {
            let text = logged(|| {
                let name = "a\u{1b}[2J\u{202e}b\u{9b}\u{7}\rc";
                match from_us {
                    true => tracing::warn!(target: "playbot_train", file = name, "{name} is damaged"),
                    false => tracing::error!(target: "bevy_asset", file = %name, "{name} is damaged"),
                }
            });
            assert!(text.contains("is damaged") && text.contains("\\u{202e}b"), "{text:?}");
            let steers = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
            assert!(!text.contains(steers), "{text:?}");
        }
    }

    #[test]
    fn everything_else_is_said_as_often_as_it_happens() {
        let text = logged(|| {
            for _ in 0..2 {
                tracing::error!("the game has a fault");
                tracing::warn!(target: "bevy_asset::server", "a loader is there twice");
            }
        });
        assert_eq!(text.matches("the game has a fault").count(), 2, "{text}");
        assert_eq!(text.matches("a loader is there twice").count(), 2, "{text}");
    }
}
