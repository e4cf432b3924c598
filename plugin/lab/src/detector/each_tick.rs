//! Detectors that are one question, asked after each tick.

use std::sync::Arc;

use super::{
    contract::{Detector, LevelAhead, Watch},
    moment::Moment,
};

/// Asks one question after each tick of each episode: the short way to a game's own detector.
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
    /// A detector with this name and one line about it. The question answers what is wrong, if anything.
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
