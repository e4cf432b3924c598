//! The log on standard error, and libraries that write there by themselves.

use crate::output::messages::for_people;
use bevy_playbot::engine::{LevelTick, tick_of_thread};
use playbot_report::counted;
use std::{
    cmp::Reverse,
    collections::BTreeMap,
    fmt,
    fmt::Write as _,
    io::IsTerminal,
    sync::{Arc, Mutex, PoisonError},
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
/// a log that is there already. A failed graphics card is reported by the error that follows. The card that computes is named.
const QUIET: &str = "warn,winit=error,bevy_render=error,bevy_render::extract_resource=off,bevy_gltf=error,bevy_log=off,\
                     cubecl_runtime=error,playbot_learner::device=info";

/// Messages of broken games are left out.
const WITHOUT_GAMES: &str = "off,bevy_playbot=warn,playbot=warn,playbot_games=off";

/// Most messages that are kept for comparison: a game that logs its positions makes any number. Further ones are written
/// each time.
const MOST_KEPT: usize = 1_000;

/// Most messages that are listed at the end of a verb.
const MOST_LISTED: usize = 10;

/// Logs at the levels of `RUST_LOG`, or else warnings, and more with each `-v`. With `-v` each line names its source.
/// Without both, a message of a game is written once, and the result has how often it came again.
pub(crate) fn init(verbose: u8, hears_games: bool) -> Repeats {
    let quiet = if hears_games { QUIET } else { WITHOUT_GAMES };
    // Windows have Bevy's own log too, which reports that this one is there.
    let level = [quiet, "info,bevy_log=off", "debug,bevy_log=off"][usize::from(verbose.min(2))];
    let asked = EnvFilter::try_from_default_env().ok();
    let is_plain = verbose == 0 && asked.is_none();
    let filter = asked.unwrap_or_else(|| EnvFilter::new(level));
    // Colours are for people.
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let repeats = Repeats { counts_games: is_plain, ..Repeats::default() };
    subscriber(filter, is_plain, colours, repeats.clone(), std::io::stderr).init();
    repeats
}

fn subscriber<W>(
    filter: EnvFilter,
    is_plain: bool,
    colours: bool,
    repeats: Repeats,
    writer: W,
) -> impl Subscriber + Send + Sync
where
    W: for<'a> MakeWriter<'a> + Send + Sync + 'static,
{
    // An error of writing the log could only be reported to the same place.
    let lines = Lines { is_plain, full: tracing_subscriber::fmt::format().without_time() };
    let format = tracing_subscriber::fmt().with_env_filter(filter).log_internal_errors(false).with_ansi(colours);
    let format = format.fmt_fields(HarmlessFields(DefaultFields::new()));
    format.event_format(lines).with_writer(writer).finish().with(repeats)
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
            if let Some(tick) = tick_of_thread().filter(|_| !is_of_program(event.metadata().target())) {
                // `INFO` and `WARN` come with a space before them.
                let space = if matches!(*event.metadata().level(), Level::INFO | Level::WARN) { "" } else { " " };
                write!(writer, "{tick}:{space}")?;
            }
            return self.full.format_event(context, writer, event);
        }
        writer.write_str(match *event.metadata().level() {
            Level::ERROR => "error: ",
            Level::WARN => "warning: ",
            _ => "",
        })?;
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

/// Lets equal messages through once.
///
/// Errors about assets and warnings of a training are repeated by nature: every World loads the files of its game and
/// reports the same missing ones, and a damaged checkpoint is found again at each look. Warnings and errors of a game
/// come in every episode and would drown the progress.
#[derive(Clone, Default)]
pub(crate) struct Repeats {
    /// True if messages of games are let through once too.
    counts_games: bool,
    /// Messages that were let through.
    kept: Arc<Mutex<BTreeMap<String, Kept>>>,
}

/// A message that was let through.
#[derive(Clone, Copy, Default)]
struct Kept {
    /// How often it came again, if it is a game's.
    again: u64,
    /// Its first and its last tick, by level and tick, which do not depend on the order of threads. `None` without a
    /// known one.
    ticks: Option<[LevelTick; 2]>,
}

impl Kept {
    fn note(&mut self, tick: Option<LevelTick>) {
        let Some(tick) = tick else { return };
        let [first, last] = self.ticks.get_or_insert([tick; 2]);
        *first = tick.min(*first);
        *last = tick.max(*last);
    }

    /// Returns its ticks in parentheses, after a space; empty without one.
    fn ticks(&self) -> String {
        match self.ticks {
            None => String::new(),
            Some([first, last]) if first == last => format!(" (in {first})"),
            Some([first, last]) => format!(" (first in {first}, last in {last})"),
        }
    }
}

impl Repeats {
    /// Returns whether equal messages of games are written once.
    pub const fn collapses(&self) -> bool {
        self.counts_games
    }

    /// Notes a message. Returns false if an equal one was let through, which is counted if it is a game's.
    pub fn is_new(&self, message: String, is_of_game: bool, tick: Option<LevelTick>) -> bool {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = kept.get_mut(&message) {
            known.again += u64::from(is_of_game);
            known.note(tick);
            return false;
        }
        if kept.len() < MOST_KEPT {
            kept.entry(message).or_default().note(tick);
        }
        true
    }

    /// Prints which messages of a game came again, and how often.
    pub fn report(&self) {
        self.lines().iter().for_each(|line| report!("{line}"));
    }

    /// Returns the lines of the report, the most frequent message first.
    pub(super) fn lines(&self) -> Vec<String> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let mut again: Vec<(&str, &Kept)> = kept.iter().map(|(text, kept)| (text.as_str(), kept)).collect();
        again.retain(|(_, kept)| kept.again > 0);
        if again.is_empty() {
            return Vec::new();
        }
        again.sort_by_key(|(_, kept)| Reverse(kept.again));
        let title = "messages of the game that came again (-v shows them each time):".to_owned();
        // A message may have a stack trace below it.
        let line = |(text, kept): &(&str, &Kept)| {
            let (again, text) = (counted(kept.again, "time"), text.lines().next().unwrap_or_default());
            format!("  {again} more: {text}{}", kept.ticks())
        };
        let more = again.len().saturating_sub(MOST_LISTED);
        let more = (more > 0).then(|| format!("  and {}", counted(more as u64, "other message")));
        [title].into_iter().chain(again.iter().take(MOST_LISTED).map(line)).chain(more).collect()
    }
}

impl<S: Subscriber> Layer<S> for Repeats {
    fn event_enabled(&self, event: &Event<'_>, _: Context<'_, S>) -> bool {
        let (level, target) = (*event.metadata().level(), event.metadata().target());
        let is_of_files = match level {
            Level::ERROR => target.starts_with("bevy_asset"),
            Level::WARN => ["playbot_train", "playbot_harness::sealed_file", "playbot_learner"]
                .iter()
                .any(|from| target.starts_with(from)),
            _ => false,
        };
        // Levels are ordered by how much they show.
        let is_of_game = self.counts_games && level <= Level::WARN && !is_of_program(target);
        if !(is_of_files || is_of_game) {
            return true;
        }
        let mut message = Message(format!("{level} {target}:"));
        event.record(&mut message);
        let tick = tick_of_thread().filter(|_| !is_of_files);
        self.is_new(message.0, !is_of_files, tick)
    }
}

/// Returns whether a message is of the program around the games. The plugin's messages are about the game that it is
/// in.
fn is_of_program(target: &str) -> bool {
    let krate = target.split("::").next().unwrap_or_default();
    krate == "playbot" || (krate.starts_with("playbot_") && krate != "playbot_games")
}

/// The text and the values of an event, after its level and source.
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // A String takes all that is written.
        let _ = match field.name() {
            "message" => write!(self.0, " {value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
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

    use bevy::prelude::{FixedUpdate, Query};
    use bevy_playbot::{engine::run_on_one_thread, prelude::*};

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
        heard(true, say).0
    }

    /// Returns what is written, and the report at the end; `is_plain` without `-v`.
    fn heard(is_plain: bool, say: impl FnOnce()) -> (String, Vec<String>) {
        let page = Page::default();
        let writer = page.clone();
        let repeats = Repeats { counts_games: is_plain, ..Repeats::default() };
        let subscriber = subscriber(EnvFilter::new(QUIET), is_plain, false, repeats.clone(), move || writer.clone());
        tracing::subscriber::with_default(subscriber, say);
        let text = String::from_utf8(page.0.lock().expect("no thread panics").clone()).expect("Unicode");
        (text, repeats.lines())
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

    /// Title of the report of repeated messages.
    const TITLE: &str = "messages of the game that came again (-v shows them each time):";

    #[test]
    fn a_message_of_a_game_is_written_once_and_counted_at_the_end() {
        let (text, lines) = heard(true, || {
            for _episode in 0..58 {
                tracing::error!(target: "my_game::doors", "door {} has no key", 3);
            }
            tracing::warn!(target: "my_game", "it is late\n  at night");
            tracing::warn!(target: "my_game", "it is late\n  at night");
            tracing::warn!(target: "playbot_games", "once only");
        });
        assert_eq!(text.matches("door 3 has no key").count(), 1, "{text}");
        assert_eq!(text.matches("it is late").count(), 1, "{text}");
        let counts =
            ["  57 times more: ERROR my_game::doors: door 3 has no key", "  1 time more: WARN my_game: it is late"];
        assert_eq!(lines, [TITLE, counts[0], counts[1]]);
    }

    #[test]
    fn a_message_of_an_episode_has_its_level_and_tick_and_the_first_and_last_of_all_at_the_end() {
        let mut app = headless_app();
        app.add_systems(FixedUpdate, |mut episodes: Query<&mut Episode>| {
            for mut episode in &mut episodes {
                if episode.tick == 2 {
                    tracing::warn!(target: "my_game", "it is late");
                }
                if episode.level == 4 && episode.tick == 1 {
                    (0..2).for_each(|_| tracing::warn!(target: "my_game", "a door is stuck"));
                }
                if episode.tick == 3 {
                    episode.truncate();
                }
            }
        });
        let agent = (Agent::new(0, ActionSpace::Discrete(2)), Control::Bot, BlindBot::Uniform);
        app.world_mut().spawn((agent, LevelQueue::list([9, 4, 5])));
        run_on_one_thread(app.world_mut());
        let (text, lines) = heard(true, || app.ticks(12).expect("no agent broke its contract"));
        assert!(text.contains("level 9, tick 2: WARN my_game: it is late"), "{text}");
        let late = "  2 times more: WARN my_game: it is late (first in level 4, tick 2, last in level 9, tick 2)";
        let stuck = "  1 time more: WARN my_game: a door is stuck (in level 4, tick 1)";
        assert_eq!(lines, [TITLE, late, stuck]);
    }

    #[test]
    fn messages_with_other_values_are_other_messages() {
        let (text, lines) = heard(true, || {
            for door in [3, 4] {
                tracing::error!(target: "my_game", "door {door} has no key");
                tracing::error!(target: "my_game", door, "no key");
            }
            tracing::error!(target: "other_game", "door 3 has no key");
            tracing::warn!(target: "my_game", "door 3 has no key");
        });
        assert_eq!(text.lines().count(), 6, "{text}");
        assert!(lines.is_empty(), "{lines:?}");
    }

    #[test]
    fn with_v_a_message_of_a_game_is_written_each_time() {
        let (text, lines) = heard(false, || {
            (0..3).for_each(|_| tracing::error!(target: "my_game", "door 3 has no key"));
        });
        assert_eq!(text.matches("door 3 has no key").count(), 3, "{text}");
        assert!(lines.is_empty(), "{lines:?}");
    }

    #[test]
    fn a_message_of_the_program_is_written_each_time() {
        let (text, lines) = heard(true, || {
            for _ in 0..2 {
                tracing::warn!(target: "playbot_test::verdict::folder", "out cannot be locked");
                tracing::warn!(target: "playbot::progress", "Ctrl-C will stop at once");
            }
        });
        assert_eq!(text.lines().count(), 4, "{text}");
        assert!(lines.is_empty(), "{lines:?}");
    }

    #[test]
    fn of_many_messages_the_most_frequent_are_listed_and_no_more_than_a_thousand_kept() {
        let (text, lines) = heard(true, || {
            for round in 0..3 {
                for door in 0..1_001 {
                    if round < 2 || door == 7 {
                        tracing::warn!(target: "my_game", "door {door}");
                    }
                }
            }
        });
        assert_eq!(text.lines().count(), 1_002, "the last door is not kept, so it is written twice");
        assert_eq!((lines.len(), lines[0].as_str()), (12, TITLE));
        assert_eq!(
            (lines[1].as_str(), lines[11].as_str()),
            ("  2 times more: WARN my_game: door 7", "  and 990 other messages")
        );
    }
}
