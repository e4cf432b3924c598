//! Errors that a game logs.

use playbot_harness::detector::{Detector, WorldTick, WorldWatcher};
use std::{
    fmt,
    sync::{Arc, Mutex, PoisonError},
};
use tracing::{
    Dispatch, Event, Level, Metadata, Subscriber, dispatcher,
    field::{Field, Visit},
    level_filters::LevelFilter,
    span,
    subscriber::Interest,
};

/// A finding for games that log an error. Errors of the engine and of missing files are not the game's code and do not
/// count.
#[derive(Default)]
pub struct ErrorLog;

impl Detector for ErrorLog {
    fn name(&self) -> &'static str {
        "error-log"
    }

    fn describe(&self) -> &'static str {
        "the game logs an error"
    }

    fn watch_world(&self) -> Option<Box<dyn WorldWatcher>> {
        Some(Box::new(Self))
    }
}

impl WorldWatcher for ErrorLog {
    fn hears_errors(&self) -> bool {
        true
    }

    fn tick(&mut self, moment: &WorldTick<'_>) -> Option<String> {
        moment.errors.first().map(|error| format!("the game logged an error: {error}"))
    }
}

// Reader of a game's log of errors.

/// Crates whose errors are not the game's: the engine, its dependencies, and the plugin. Crates of the same name
/// followed by an underscore belong to these as well, except for `bevy`, which many games have in their names.
const ENGINE: [&str; 18] = [
    "wgpu",
    "naga",
    "winit",
    "gilrs",
    "cosmic_text",
    "calloop",
    "alsa",
    "rodio",
    "parley",
    "log",
    "offset_allocator",
    "playbot_harness",
    "playbot_kernels",
    "playbot_learner",
    "playbot_mutation",
    "playbot_report",
    "playbot_test",
    "playbot_train",
];

/// Parts of the engine, after `bevy_`.
const BEVY: [&str; 41] = [
    "a11y",
    "animation",
    "anti_alias",
    "app",
    "asset",
    "audio",
    "camera",
    "color",
    "core_pipeline",
    "core_widgets",
    "ecs",
    "feathers",
    "gilrs",
    "gizmos",
    "gltf",
    "image",
    "input",
    "input_focus",
    "light",
    "log",
    "mesh",
    "pbr",
    "picking",
    "playbot",
    "post_process",
    "reflect",
    "render",
    "scene",
    "shader",
    "sprite",
    "sprite_render",
    "state",
    "tasks",
    "text",
    "time",
    "transform",
    "ui",
    "ui_render",
    "window",
    "winit",
    "world_serialization",
];

/// A line of a game's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// Its level.
    pub level: Level,
    /// Its message, with the other fields behind it as `name=value`.
    pub message: String,
}

/// Collects the log of a thread down to a level, for any log filter. All events go on to the previous subscriber.
pub struct LogReader {
    listener: Dispatch,
    heard: Arc<Mutex<Vec<Heard>>>,
}

/// Collects the errors of a thread, for any log filter. All events go on to the previous subscriber.
pub struct ErrorLogReader(LogReader);

struct Listener {
    outer: Dispatch,
    level: Level,
    most: LevelFilter,
    heard: Arc<Mutex<Vec<Heard>>>,
}

/// A message with its level, and its other fields.
struct Heard {
    level: Level,
    message: Message,
}

impl LogReader {
    /// Creates a reader for this thread of lines that are at least as severe as `level`.
    pub fn down_to(level: Level) -> Self {
        let heard = Arc::<Mutex<Vec<Heard>>>::default();
        let outer = dispatcher::get_default(Clone::clone);
        let most = LevelFilter::current().max(LevelFilter::from_level(level));
        let listener = Dispatch::new(Listener { outer, level, most, heard: Arc::clone(&heard) });
        Self { listener, heard }
    }

    /// Runs some work and collects its lines.
    pub fn listen<T>(&self, work: impl FnOnce() -> T) -> T {
        dispatcher::with_default(&self.listener, work)
    }

    /// Returns the lines since the last call.
    pub fn take(&self) -> Vec<LogLine> {
        let line = |Heard { level, message }: Heard| LogLine { level, message: message.words + &message.fields };
        self.heard().into_iter().map(line).collect()
    }

    fn heard(&self) -> Vec<Heard> {
        std::mem::take(&mut *self.heard.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl ErrorLogReader {
    /// Creates an ear for this thread.
    pub fn new() -> Self {
        Self(LogReader::down_to(Level::ERROR))
    }

    /// Runs some work and collects its errors.
    pub fn listen<T>(&self, work: impl FnOnce() -> T) -> T {
        self.0.listen(work)
    }

    /// Returns the errors since the last call, without fields besides the message.
    pub fn take(&self) -> Vec<String> {
        self.0.heard().into_iter().map(|heard| heard.message.words).collect()
    }
}

impl Default for ErrorLogReader {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns whether the message is not the game's.
fn is_of_engine(target: &str) -> bool {
    let name = target.split("::").next().unwrap_or_default();
    if let Some(part) = name.strip_prefix("bevy") {
        return part.is_empty() || part.strip_prefix('_').is_some_and(|part| BEVY.contains(&part));
    }
    // Not by its prefix: games are called `playbot_games`.
    name == "playbot"
        || ENGINE
            .iter()
            .any(|engine| name.strip_prefix(engine).is_some_and(|rest| rest.is_empty() || rest.starts_with('_')))
}

/// The text of an event.
#[derive(Default)]
struct Message {
    words: String,
    fields: String,
}

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        match field.name() {
            "message" => self.words = format!("{value:?}"),
            // Those of the crate `log` say where the line is in the source.
            name if name.starts_with("log.") => {}
            name => self.fields += &format!(" {name}={value:?}"),
        }
    }
}

impl Subscriber for Listener {
    /// The previous subscriber may want to be asked each time.
    fn register_callsite(&self, _: &'static Metadata<'static>) -> Interest {
        Interest::sometimes()
    }

    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        (metadata.is_event() && *metadata.level() <= self.level) || self.outer.enabled(metadata)
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(self.most)
    }

    fn event(&self, event: &Event<'_>) {
        let metadata = event.metadata();
        let level = *metadata.level();
        if level <= self.level && !is_of_engine(metadata.target()) {
            let mut message = Message::default();
            event.record(&mut message);
            self.heard.lock().unwrap_or_else(PoisonError::into_inner).push(Heard { level, message });
        }
        if self.outer.enabled(metadata) {
            self.outer.event(event);
        }
    }

    fn new_span(&self, span: &span::Attributes<'_>) -> span::Id {
        self.outer.new_span(span)
    }

    fn record(&self, span: &span::Id, values: &span::Record<'_>) {
        self.outer.record(span, values);
    }

    fn record_follows_from(&self, span: &span::Id, follows: &span::Id) {
        self.outer.record_follows_from(span, follows);
    }

    fn enter(&self, span: &span::Id) {
        self.outer.enter(span);
    }

    fn exit(&self, span: &span::Id) {
        self.outer.exit(span);
    }

    fn clone_span(&self, id: &span::Id) -> span::Id {
        self.outer.clone_span(id)
    }

    fn try_close(&self, id: span::Id) -> bool {
        self.outer.try_close(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::prelude::World;

    #[test]
    fn the_first_error_is_reported_and_silence_is_sound() {
        let world = World::new();
        let errors = ["no such door".to_owned(), "no such key".to_owned()];
        let mut watch = ErrorLog.watch_world().expect("it looks at Worlds");
        let reported = watch.tick(&WorldTick { world: &world, errors: &errors });
        assert_eq!(reported.as_deref(), Some("the game logged an error: no such door"));
        assert_eq!(watch.tick(&WorldTick { world: &world, errors: &[] }), None);
    }

    #[test]
    fn errors_of_the_game_are_heard_and_others_are_not() {
        let ear = ErrorLogReader::new();
        let value = ear.listen(|| {
            tracing::error!(target: "my_game::doors", "door {} has no key", 3);
            tracing::warn!(target: "my_game", "it is late");
            tracing::error!(target: "bevy_asset::server", "Path not found: cake.glb");
            7
        });
        assert_eq!((value, ear.take()), (7, vec!["door 3 has no key".to_owned()]));
        tracing::error!(target: "my_game", "after the end");
        assert!(ear.take().is_empty());
    }

    #[test]
    fn lines_down_to_a_level_are_heard_with_their_fields() {
        let reader = LogReader::down_to(Level::INFO);
        reader.listen(|| {
            tracing::info!(target: "my_game", "a door opens");
            tracing::warn!(target: "my_game", door = 3, key = "red", "no key");
            tracing::debug!(target: "my_game", "not heard");
            tracing::info!(target: "bevy_render", "of the engine");
        });
        let line = |level, message: &str| LogLine { level, message: message.to_owned() };
        let expected = [line(Level::INFO, "a door opens"), line(Level::WARN, "no key door=3 key=\"red\"")];
        assert_eq!(reader.take(), expected);
        assert!(reader.take().is_empty());
        let errors = ErrorLogReader::new();
        errors.listen(|| tracing::error!(target: "my_game", door = 3, "no key"));
        assert_eq!(errors.take(), ["no key"], "findings keep their messages");
    }

    #[test]
    fn earlier_subscribers_still_receive_them() {
        let outer = ErrorLogReader::new();
        outer.listen(|| ErrorLogReader::new().listen(|| tracing::error!(target: "my_game", "twice")));
        assert_eq!(outer.take(), ["twice"]);
    }

    #[test]
    fn the_engine_is_distinguished_from_games_with_names_like_it() {
        for engine in ["bevy_ecs::world", "bevy", "playbot_harness::eval", "wgpu_core"] {
            assert!(is_of_engine(engine), "{engine}");
        }
        for game in ["bevyland", "bevy_jam_5", "my_bevy_game", "logs", "garden"] {
            assert!(!is_of_engine(game), "{game}");
        }
    }
}
