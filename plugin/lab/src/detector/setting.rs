//! Numbers by which detectors are adjusted.

/// A setting of a detector.
pub struct Setting<'a> {
    /// Its name, in small letters.
    pub key: &'static str,
    /// Its value.
    pub value: &'a mut f64,
    /// The least value that makes sense.
    pub least: f64,
    /// What it means, with its unit.
    pub what: &'static str,
}

impl<'a> Setting<'a> {
    /// A setting that is at least 0.
    pub fn new(key: &'static str, value: &'a mut f64, what: &'static str) -> Self {
        Self { key, value, least: 0.0, what }
    }

    /// The same with another least value.
    pub fn at_least(self, least: f64) -> Self {
        Self { least, ..self }
    }
}
