//! Which detectors look, and how they are set.

use std::sync::Arc;

use bevy_playbot::unknown_name::UnknownName;
use thiserror::Error;

use super::{
    catalogue::{Known, all},
    level_detector::LevelDetector,
    par::Pars,
    tick_time::TickTime,
};
use crate::{detector::Detector, game::Game};

/// Stands for all detectors.
const ALL: &str = "all";

/// What somebody asks for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DetectorChoice {
    /// Names of detectors that look beside the usual ones; `all` for all.
    pub with: Vec<String>,
    /// Names of usual detectors that do not look; `all` for none but those that are named.
    pub without: Vec<String>,
    /// Settings, as `name.key=value`.
    pub settings: Vec<String>,
}

/// The detectors of a test.
#[derive(Clone, Default)]
pub struct Detectors {
    pub(crate) ticks: Vec<Arc<dyn Detector>>,
    pub(crate) levels: Vec<Arc<dyn LevelDetector>>,
    clock: Option<Arc<TickTime>>,
    pars: Pars,
    record: Vec<String>,
}

/// Detectors cannot be chosen so.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum DetectorError {
    /// There is no such detector or setting.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// This is no setting.
    #[error("`{0}` sets nothing: write it as detector.setting=number, such as stuck.ticks=200")]
    Form(String),
    /// The number makes no sense.
    #[error("`{text}`: the setting is a number of at least {least}")]
    Value {
        /// What was written.
        text: String,
        /// The least that makes sense.
        least: String,
    },
    /// A detector is set that does not look.
    #[error("`{text}` sets a detector that does not look: choose it, too, with `--detect {name}`")]
    Idle {
        /// What was written.
        text: String,
        /// The detector.
        name: String,
    },
}

impl Detectors {
    /// The usual ones: those that cost little and give no false alarm in a sound game.
    pub fn usual(game: &dyn Game) -> Self {
        Self::of(all(game).into_iter().filter(Known::is_usual).collect())
    }

    /// Those that somebody asks for.
    ///
    /// # Errors
    ///
    /// There is no such detector or setting, or a number makes no sense.
    pub fn choose(game: &dyn Game, choice: &DetectorChoice) -> Result<Self, DetectorError> {
        let mut known = all(game);
        set(&mut known, choice)?;
        let names: Vec<&str> = known.iter().map(Known::name).chain([ALL]).collect();
        let unknown = choice.with.iter().chain(&choice.without).find(|name| !names.contains(&name.as_str()));
        if let Some(unknown) = unknown {
            return Err(UnknownName::new("detector", unknown, &names).into());
        }
        known.retain(|known| choice.takes(known));
        Ok(Self::of(known))
    }

    fn of(known: Vec<Known>) -> Self {
        let mut detectors = Self::default();
        for mut known in known {
            let values = known.settings().into_iter().map(|setting| format!(" {}={}", setting.key, setting.value));
            let text = values.collect::<String>();
            let text = format!("{}{text}", known.name());
            match known {
                Known::Ticks(detector) => detectors.ticks.push(detector.into()),
                Known::Level(detector) => detectors.levels.push(detector.into()),
                // What it finds is no part of the results.
                Known::Clock(times) => {
                    detectors.clock = Some(Arc::new(times));
                    continue;
                }
            }
            detectors.record.push(text);
        }
        detectors
    }

    /// With pars of levels, for those detectors that ask for them.
    #[must_use]
    pub fn with_pars(mut self, pars: Pars) -> Self {
        if !pars.is_empty() {
            self.record.push(format!("pars {:016x}", pars.hash()));
        }
        self.pars = pars;
        self
    }

    /// The par of the level with this name.
    pub fn par(&self, level: &str) -> Option<f64> {
        self.pars.of(level)
    }

    /// What results depend on: each detector with its settings, and a hash of the pars.
    pub fn record(&self) -> &[String] {
        &self.record
    }

    /// What looks at the clock, if anything does.
    pub fn clock(&self) -> Option<&TickTime> {
        self.clock.as_deref()
    }
}

impl DetectorChoice {
    fn takes(&self, known: &Known) -> bool {
        let names = |list: &[String], name: &str| list.iter().any(|known| known == name);
        if names(&self.with, known.name()) {
            return true;
        }
        if names(&self.without, known.name()) || names(&self.without, ALL) {
            return false;
        }
        known.is_usual() || names(&self.with, ALL)
    }
}

/// Changes settings.
fn set(known: &mut [Known], choice: &DetectorChoice) -> Result<(), DetectorError> {
    for text in &choice.settings {
        let form = || DetectorError::Form(text.clone());
        let (place, value) = text.split_once('=').ok_or_else(form)?;
        let (name, key) = place.trim().split_once('.').ok_or_else(form)?;
        let names: Vec<&str> = known.iter().map(Known::name).collect();
        let unknown = UnknownName::new("detector", name, &names);
        let Some(detector) = known.iter_mut().find(|known| known.name() == name) else { return Err(unknown.into()) };
        if !choice.takes(detector) {
            return Err(DetectorError::Idle { text: text.clone(), name: name.to_owned() });
        }
        let settings = detector.settings();
        let keys: Vec<&str> = settings.iter().map(|setting| setting.key).collect();
        let unknown = UnknownName::new("setting", key, &keys);
        let Some(setting) = settings.into_iter().find(|setting| setting.key == key) else { return Err(unknown.into()) };
        match value.trim().parse::<f64>() {
            Ok(number) if number.is_finite() && number >= setting.least => *setting.value = number,
            _ => return Err(DetectorError::Value { text: text.clone(), least: setting.least.to_string() }),
        }
    }
    Ok(())
}
