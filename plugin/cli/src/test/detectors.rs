//! What looks for defects, as the command line names it.

use std::path::Path;

use playbot_lab::{
    detectors::{ALWAYS, DetectorChoice, DetectorInfo, Detectors, TIMING, forget_timing, list},
    game::Game,
};

use crate::{
    error::{CliError, Outcome, print_line},
    number::counted,
};

/// Which detectors look, and how they are set.
#[derive(clap::Args, Clone, Debug)]
pub struct DetectorArgs {
    /// Detectors that look beside the usual ones, separated by commas; all for all of them.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    detect: Vec<String>,
    /// Usual detectors that do not look, separated by commas; all for none but those that --detect names.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    no_detect: Vec<String>,
    /// A setting of a detector; may be given several times.
    #[arg(long, value_name = "NAME.KEY=VALUE")]
    detector: Vec<String>,
    /// List all detectors with their settings, and test nothing.
    #[arg(long = "detectors")]
    pub list_detectors: bool,
}

impl DetectorArgs {
    /// The detectors that were chosen.
    ///
    /// # Errors
    ///
    /// There is no such detector or setting, or a number makes no sense.
    pub fn choose(&self, game: &dyn Game) -> Result<Detectors, CliError> {
        let choice = DetectorChoice {
            with: self.detect.clone(),
            without: self.no_detect.clone(),
            settings: self.detector.clone(),
        };
        Detectors::choose(game, &choice).map_err(|error| CliError::Usage(error.to_string()))
    }
}

/// Lists what there is for a game, a detector to a line, with its settings below it.
pub fn list_detectors(game: &dyn Game, json: bool) -> Result<Outcome, CliError> {
    for (name, about) in ALWAYS {
        if json {
            print_line(serde_json::json!({"name": name, "finds": about, "looks": "always", "settings": {}}))?;
        } else {
            print_line(line(name, "always", about))?;
        }
    }
    for detector in list(game) {
        let looks = if detector.is_usual { "usual" } else { "chosen" };
        if json {
            print_line(as_json(&detector, looks))?;
            continue;
        }
        print_line(line(detector.name, looks, detector.about))?;
        for (key, value, what) in &detector.settings {
            print_line(format!("{:29}{key}={value}  {what}", ""))?;
        }
    }
    Ok(Outcome::Pass)
}

/// Forgets the slow ticks of an earlier test in a folder.
pub fn forget_slow_ticks(folder: &Path) -> Result<(), CliError> {
    forget_timing(folder).map_err(|error| no_timing(folder, "remove", &error))
}

/// Writes the slow ticks of a test to their file, and says how many there are.
pub fn tell_slow_ticks(detectors: &Detectors, folder: &Path) -> Result<(), CliError> {
    let Some(clock) = detectors.clock() else { return Ok(()) };
    let count = clock.write(folder).map_err(|error| no_timing(folder, "write", &error))?;
    tell!("{} in {}", counted(count as u64, "slow tick"), folder.join(TIMING).display());
    Ok(())
}

fn no_timing(folder: &Path, action: &str, error: &std::io::Error) -> CliError {
    CliError::Io(format!("cannot {action} {}: {error}", folder.join(TIMING).display()))
}

fn line(name: &str, looks: &str, about: &str) -> String {
    format!("{name:20} {looks:7} {about}")
}

fn as_json(detector: &DetectorInfo, looks: &str) -> serde_json::Value {
    let settings = detector.settings.iter().map(|(key, value, _)| ((*key).to_owned(), serde_json::json!(value)));
    let settings: serde_json::Map<String, serde_json::Value> = settings.collect();
    serde_json::json!({"name": detector.name, "finds": detector.about, "looks": looks, "settings": settings})
}
