//! The selection of detectors and their settings.

use crate::detectors::{ALWAYS, Known, LevelDetector, all, clocks::TickTime, par::Pars};
use bevy_playbot::unknown_name::{UnknownName, nearest};
use playbot_harness::{detector::Detector, game::Game};
use std::sync::Arc;
use thiserror::Error;

/// The name that stands for all detectors.
const ALL: &str = "all";

/// The detectors and settings that a caller asks for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DetectorChoice {
    /// Names of opt-in detectors to add; `all` for all.
    pub with: Vec<String>,
    /// Names of default detectors to leave out; `all` keeps only those that are named.
    pub without: Vec<String>,
    /// Settings, as `name.key=value`.
    pub settings: Vec<String>,
}

/// The detectors of a test.
#[derive(Clone, Default)]
pub struct Detectors {
    /// Detectors that look at every tick.
    pub ticks: Vec<Arc<dyn Detector>>,
    /// Detectors that look at the episodes of a level together.
    pub levels: Vec<Arc<dyn LevelDetector>>,
    clock: Option<Arc<TickTime>>,
    pars: Pars,
    record: Vec<String>,
    /// Settings that the caller asked for, as `name.key=value`.
    pub(crate) settings: Vec<String>,
    options: Vec<String>,
}

/// The reason why a selection is invalid.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum DetectorError {
    /// There is no such detector.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// The detector has no such setting.
    #[error("the detector `{detector}` has no setting `{key}`{}; {}", hint(key, known), settings(known))]
    Setting {
        /// The detector.
        detector: String,
        /// The unknown name.
        key: String,
        /// Its settings.
        known: Vec<String>,
    },
    /// Findings of every test can neither be selected nor left out, and have no settings.
    #[error("`{0}` looks in every test and has no settings: leave it out of the options")]
    Always(String),
    /// The text is not a setting.
    #[error("`{0}` is not a setting: write detector.setting=number, such as stuck.ticks=200")]
    Form(String),
    /// The number is out of range.
    #[error("`{text}`: write a number of at least {least}")]
    Value {
        /// The text.
        text: String,
        /// The least valid number.
        least: String,
    },
    /// A setting of a detector that is not selected.
    #[error("`{text}` sets a detector that is not selected: add `--detect {name}`, or leave the setting out")]
    Idle {
        /// The text.
        text: String,
        /// The detector.
        name: String,
    },
}

impl Detectors {
    /// Selects the default detectors: those that cost little and give no false alarm in an unmutated game.
    pub fn defaults(game: &dyn Game) -> Self {
        Self::of(all(game).into_iter().filter(Known::is_default).collect())
    }

    /// Selects the detectors of a choice.
    ///
    /// # Errors
    ///
    /// There is no such detector or setting, or a number is out of range.
    pub fn choose(game: &dyn Game, choice: &DetectorChoice) -> Result<Self, DetectorError> {
        let mut known = all(game);
        set(&mut known, choice)?;
        let names: Vec<&str> = known.iter().map(Known::name).chain([ALL]).collect();
        let unknown = choice.with.iter().chain(&choice.without).find(|name| !names.contains(&name.as_str()));
        if let Some(unknown) = unknown {
            return Err(no_detector(unknown, &names));
        }
        let options = options(&mut known, choice, &mut all(game));
        known.retain(|known| choice.takes(known));
        Ok(Self { options, settings: choice.settings.clone(), ..Self::of(known) })
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
                // Its findings are no part of the results.
                Known::Clock(times) => {
                    detectors.clock = Some(Arc::new(times));
                    continue;
                }
            }
            detectors.record.push(text);
        }
        detectors
    }

    /// Adds pars of levels, for the detectors that use them, and that come with `--par`.
    #[must_use]
    pub fn with_pars(mut self, pars: Pars) -> Self {
        if !pars.is_empty() {
            self.record.push(format!("pars {:016x}", pars.hash()));
            let looks = |name: &str| self.record.iter().any(|record| record.split(' ').next() == Some(name));
            let left_out = ["shortcut", "too-long"].into_iter().filter(|name| !looks(name));
            let left_out: Vec<String> = left_out.flat_map(|name| ["--no-detect", name]).map(str::to_owned).collect();
            self.options.extend(left_out);
            self.options.extend(["--par".to_owned(), pars.path().display().to_string()]);
        }
        self.pars = pars;
        self
    }

    /// Returns the par of the level with this name.
    pub fn par(&self, level: &str) -> Option<f64> {
        self.pars.of(level)
    }

    /// Returns what results depend on: each detector with its settings, and a hash of the pars.
    pub fn record(&self) -> &[String] {
        &self.record
    }

    /// Returns the options of a command line that select the same detectors and settings.
    pub fn options(&self) -> &[String] {
        &self.options
    }

    /// Returns the names of a game's opt-in detectors that are not selected.
    pub fn off(&self, game: &dyn Game) -> Vec<&'static str> {
        let is_recorded = |name: &str| self.record.iter().any(|record| record.split(' ').next() == Some(name));
        let is_on = |known: &Known| match known {
            Known::Clock(_) => self.clock.is_some(),
            known => is_recorded(known.name()),
        };
        let off = all(game).into_iter().filter(|known| !known.is_default() && !is_on(known));
        off.map(|known| known.name()).collect()
    }

    /// Returns the detector that measures time, if it is selected.
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
        known.is_default() || names(&self.with, ALL)
    }
}

/// Returns the options of a command line that change results, in an order that does not depend on that of the choice.
fn options(known: &mut [Known], choice: &DetectorChoice, defaults: &mut [Known]) -> Vec<String> {
    let is_all = |list: &[String]| list.iter().any(|name| name == ALL);
    let (adds_all, leaves_all) = (is_all(&choice.with), is_all(&choice.without));
    let mut words = Vec::new();
    let mut list = |option: &str, all: bool, names: Vec<&str>| {
        let names: Vec<&str> = all.then_some(ALL).into_iter().chain(names).collect();
        if !names.is_empty() {
            words.extend([option.to_owned(), names.join(",")]);
        }
    };
    let is_implied = |it: &Known| if leaves_all { false } else { adds_all || it.is_default() };
    let counts = |it: &&Known| !matches!(it, Known::Clock(_));
    let chosen =
        |is: bool| known.iter().filter(counts).filter(move |it| choice.takes(it) == is && is_implied(it) != is);
    list("--detect", adds_all && !leaves_all, chosen(true).map(Known::name).collect());
    list("--no-detect", leaves_all, chosen(false).map(Known::name).collect());
    for (known, default) in known.iter_mut().zip(defaults).filter(|(known, _)| counts(&&**known) && choice.takes(known))
    {
        let name = known.name();
        for (setting, default) in known.settings().into_iter().zip(default.settings()) {
            if *setting.value != *default.value {
                words.extend(["--detector".to_owned(), format!("{name}.{}={}", setting.key, setting.value)]);
            }
        }
    }
    words
}

/// Returns the error of an unknown detector.
fn no_detector(name: &str, names: &[&str]) -> DetectorError {
    if ALWAYS.iter().any(|(always, _)| *always == name) {
        return DetectorError::Always(name.to_owned());
    }
    UnknownName::new("detector", name, names).into()
}

fn hint(key: &str, known: &[String]) -> String {
    let known: Vec<&str> = known.iter().map(String::as_str).collect();
    nearest(key, &known).map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"))
}

fn settings(known: &[String]) -> String {
    if known.is_empty() { "it has none".to_owned() } else { format!("it has {}", known.join(", ")) }
}

/// Changes settings.
fn set(known: &mut [Known], choice: &DetectorChoice) -> Result<(), DetectorError> {
    for text in &choice.settings {
        let form = || DetectorError::Form(text.clone());
        let (place, value) = text.split_once('=').ok_or_else(form)?;
        let (name, key) = place.trim().split_once('.').ok_or_else(form)?;
        let names: Vec<&str> = known.iter().map(Known::name).collect();
        let unknown = no_detector(name, &names);
        let Some(detector) = known.iter_mut().find(|known| known.name() == name) else { return Err(unknown) };
        if !choice.takes(detector) {
            return Err(DetectorError::Idle { text: text.clone(), name: name.to_owned() });
        }
        let settings = detector.settings();
        let keys = settings.iter().map(|setting| setting.key.to_owned()).collect();
        let unknown = DetectorError::Setting { detector: name.to_owned(), key: key.to_owned(), known: keys };
        let Some(setting) = settings.into_iter().find(|setting| setting.key == key) else { return Err(unknown) };
        match value.trim().parse::<f64>() {
            Ok(number) if number.is_finite() && number >= setting.least => *setting.value = number,
            _ => return Err(DetectorError::Value { text: text.clone(), least: setting.least.to_string() }),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_harness::foreign::ForeignGame;

    fn said(choice: &DetectorChoice) -> String {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        Detectors::choose(&game, choice).map(drop).expect_err("no such choice").to_string()
    }

    #[test]
    fn an_unknown_setting_is_reported_with_its_detector_and_what_there_is() {
        let settings = vec!["stuck.tick=3".to_owned()];
        let words = said(&DetectorChoice { settings, ..DetectorChoice::default() });
        assert!(
            words.starts_with("the detector `stuck` has no setting `tick` (did you mean `ticks`?); it has "),
            "{words}"
        );
    }

    #[test]
    fn opt_in_detectors_are_off_until_they_are_named() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let off = |with: &[&str]| {
            let with = with.iter().map(|name| (*name).to_owned()).collect();
            let choice = DetectorChoice { with, ..DetectorChoice::default() };
            Detectors::choose(&game, &choice).expect("there are such").off(&game)
        };
        let defaults = off(&[]);
        for name in ["fading-action", "determinism", "tick-time"] {
            assert!(defaults.contains(&name), "{name} is missing in {defaults:?}");
        }
        assert!(!defaults.contains(&"stuck"), "it is a default: {defaults:?}");
        let fewer = off(&["determinism", "tick-time"]);
        assert_eq!(fewer.len() + 2, defaults.len(), "{fewer:?}");
        assert!(!fewer.contains(&"determinism") && !fewer.contains(&"tick-time"), "{fewer:?}");
        assert!(off(&["all"]).is_empty());
    }

    #[test]
    fn settings_other_than_the_defaults_can_be_typed_again() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let list = |text: &str| text.split_whitespace().map(str::to_owned).collect();
        let chosen = |with: &str, without: &str, settings: &str| {
            let choice = DetectorChoice { with: list(with), without: list(without), settings: list(settings) };
            Detectors::choose(&game, &choice).expect("there are such")
        };
        for (with, without, settings, expected) in [
            ("all", "stuck", "", "--detect all --no-detect stuck"),
            ("determinism", "all", "", "--detect determinism --no-detect all"),
            ("stuck", "", "stuck.ticks=7 stuck.ticks=90", "--detector stuck.ticks=90"),
        ] {
            let said = chosen(with, without, settings);
            assert_eq!(said.options().join(" "), expected);
            let mut again = DetectorChoice::default();
            for pair in said.options().chunks(2) {
                let names = pair[1].split(',').map(str::to_owned);
                match pair[0].as_str() {
                    "--detect" => again.with.extend(names),
                    "--no-detect" => again.without.extend(names),
                    _ => again.settings.push(pair[1].clone()),
                }
            }
            let again = Detectors::choose(&game, &again).expect("there are such");
            assert_eq!(again.record(), said.record(), "{expected}");
        }
    }

    #[test]
    fn what_always_looks_is_not_called_unknown() {
        let without = vec!["panic".to_owned()];
        let words = said(&DetectorChoice { without, ..DetectorChoice::default() });
        assert!(words.starts_with("`panic` looks in every test"), "{words}");
    }
}
