//! Settings of detectors.

/// A setting of a detector.
pub struct Setting<'a> {
    /// Its name, in small letters.
    pub key: &'static str,
    /// Its value.
    pub value: &'a mut f64,
    /// The least valid value.
    pub least: f64,
    /// Its meaning, with its unit.
    pub what: &'static str,
}

impl<'a> Setting<'a> {
    /// Creates a setting that is at least 0.
    pub fn new(key: &'static str, value: &'a mut f64, what: &'static str) -> Self {
        Self { key, value, least: 0.0, what }
    }

    /// Replaces the least value.
    pub fn at_least(self, least: f64) -> Self {
        Self { least, ..self }
    }
}
