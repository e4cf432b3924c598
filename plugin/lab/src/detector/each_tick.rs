//! Detectors with one question, asked after each tick.

use std::sync::Arc;

use super::{
    contract::{Detector, LevelAhead, Watch},
    moment::Moment,
};

/// A detector that asks one question after each tick of each episode: the short form of a game's own detector.
pub struct EachTick<F> {
    name: &'static str,
    describe: &'static str,
    question: Arc<F>,
}

struct Asking<F>(Arc<F>);

impl<F> EachTick<F>
where
    F: Fn(&Moment<'_>) -> Option<String> + Send + Sync + 'static,
{
    /// Creates a detector with this name and one line about it. The question returns a message if something is wrong.
    pub fn new(name: &'static str, describe: &'static str, question: F) -> Self {
        Self { name, describe, question: Arc::new(question) }
    }
}

impl<F> Detector for EachTick<F>
where
    F: Fn(&Moment<'_>) -> Option<String> + Send + Sync + 'static,
{
    fn name(&self) -> &'static str {
        self.name
    }

    fn describe(&self) -> &'static str {
        self.describe
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn Watch>> {
        Some(Box::new(Asking(Arc::clone(&self.question))))
    }
}

impl<F: Fn(&Moment<'_>) -> Option<String>> Watch for Asking<F> {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        (self.0)(moment)
    }
}
