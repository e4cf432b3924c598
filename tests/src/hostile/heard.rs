//! Warnings of the program while it works.

use std::sync::{Arc, Mutex, PoisonError};

use tracing::{
    Dispatch, Event, Level, Metadata, Subscriber, dispatcher,
    field::{Field, Visit},
    level_filters::LevelFilter,
    span,
};

/// Does some work on this thread, and returns the warnings of this workspace meanwhile.
pub(super) fn heard<T>(work: impl FnOnce() -> T) -> (T, Vec<String>) {
    let listener = Listener::default();
    let done = dispatcher::with_default(&Dispatch::new(listener.clone()), work);
    let words = std::mem::take(&mut *listener.0.lock().unwrap_or_else(PoisonError::into_inner));
    (done, words)
}

#[derive(Clone, Default)]
struct Listener(Arc<Mutex<Vec<String>>>);

/// The text of an event.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

impl Subscriber for Listener {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= Level::WARN && metadata.target().contains("playbot")
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(LevelFilter::WARN)
    }

    fn event(&self, event: &Event<'_>) {
        let mut message = Message::default();
        event.record(&mut message);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(message.0);
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_of_this_workspace_are_heard_and_nothing_else_is() {
        let (done, words) = heard(|| {
            tracing::warn!(target: "playbot_train", "line {} is damaged", 3);
            tracing::info!(target: "playbot_train", "all is well");
            tracing::warn!(target: "bevy_asset", "no such file");
            7
        });
        assert_eq!((done, words), (7, vec!["line 3 is damaged".to_owned()]));
        assert!(heard(|| ()).1.is_empty());
    }
}
