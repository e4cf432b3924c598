//! A notice for the person, in the title for a while.

use bevy::prelude::*;
use std::{borrow::Cow, time::Duration};

/// Time for which a notice is shown.
const NOTICE: Duration = Duration::from_secs(3);

/// A notice for the person.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct Notice {
    words: Option<Cow<'static, str>>,
    age: Duration,
}

impl Notice {
    /// Returns the words, as long as they are shown.
    pub fn words(&self) -> Option<&str> {
        self.words.as_deref()
    }

    /// Shows these words for a while.
    pub fn say(&mut self, words: impl Into<Cow<'static, str>>) {
        *self = Self { words: Some(words.into()), age: Duration::ZERO };
    }
}

/// Takes a notice away after its time.
pub(super) fn age_notice(clock: Res<Time<Real>>, mut notice: ResMut<Notice>) {
    if notice.words.is_some() {
        notice.age += clock.delta();
        if notice.age > NOTICE {
            notice.words = None;
        }
    }
}
