//! The start of a run from another one: what is taken, which runs fit, and the ancestry that runs keep.

#[cfg(test)]
mod tests;

use crate::{
    checkpoint::{Checkpoint, CheckpointChoice},
    experiment::{Algorithm, Experiment, LearnerKind},
    run_dir::{Ancestor, OpenedRun, RunDir, RunError, RunInfo},
    trainer::{TrainedLearner, Trainer},
};
use playbot_harness::{game::Game, held_out::HeldOut, sealed_file::file_checksum, sensors::GameSensors};
use playbot_learner::{DeviceKind, FileError, HasExitCode, InputMap, ObsKind, SkillModel, StartFrom, TakenOver};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The run that another one begins with.
#[derive(Clone, Copy, Debug)]
pub struct BeginFrom<'a> {
    /// Its folder.
    pub run: &'a Path,
    /// The checkpoint whose weights, normalisers and skills are taken.
    pub checkpoint: CheckpointChoice,
    /// True if Adam goes on with its moments, instead of beginning anew.
    pub moments: bool,
}

impl<'a> BeginFrom<'a> {
    /// Returns a start from the last checkpoint of a run, with a fresh optimiser.
    pub fn new(run: &'a Path) -> Self {
        Self { run, checkpoint: CheckpointChoice::Last, moments: false }
    }
}

/// A new run cannot begin with another one.
#[derive(Debug, Error)]
pub enum BeginError {
    /// The two do not fit.
    #[error("no run can begin with the weights of {}: {why}", run.display())]
    Misfit {
        /// Folder of the run with the weights.
        run: PathBuf,
        /// The reason.
        why: String,
    },
    /// The other run cannot be read.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl HasExitCode for BeginError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Misfit { .. } => 3,
            Self::Run(error) => error.exit_code(),
        }
    }
}

/// The parts that a run of one algorithm takes from a run of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Parts {
    policy: bool,
    critic: bool,
}

/// Returns the parts that a run of `to` takes from one of `from`, beside its skills.
///
/// # Errors
///
/// There are none, for the reason that is returned.
fn parts(from: Algorithm, to: Algorithm) -> Result<Parts, String> {
    let by_ppo = to.learner() == LearnerKind::Ppo && !(to.learns_prior() && from != to);
    match (from, to) {
        _ if from == to && by_ppo => Ok(Parts { policy: true, critic: true }),
        (Algorithm::Imitation, Algorithm::Ppo) => Ok(Parts { policy: true, critic: false }),
        _ if from.needs_skills() && to.needs_skills() && from != to => Ok(Parts { policy: false, critic: false }),
        _ if from == to => Err(format!(
            "the weights of {from} cannot be taken, since its critics and its replay buffer belong together: go on with it \
             by --resume"
        )),
        _ if to.needs_skills() => Err(format!(
            "it was trained by {from}, which has no skills, and the new one is by {to}, which begins with its decoder: \
             learn skills with `playbot learn-skills` and name them with --skills, or add --algorithm ppo"
        )),
        _ if from.needs_skills() => Err(format!(
            "it was trained by {from}, whose policy reads skills, and the new one is by {to}, which has none: add \
             --algorithm {from}"
        )),
        _ => Err(format!("it was trained by {from}, and the new one is by {to}: add --algorithm {from}")),
    }
}

/// An opened run that another one is to begin with.
pub(crate) struct Origin {
    path: PathBuf,
    info: RunInfo,
    checkpoint: Checkpoint,
    parts: Parts,
    moments: bool,
    inputs: Option<InputMap>,
    skills: Option<SkillModel>,
}

impl Origin {
    /// Opens a run that a run of `experiment` is to begin with. `has_skills`: the new run has a skill model already.
    ///
    /// # Errors
    ///
    /// [`BeginError::Misfit`] with the reason that they do not fit, or that the run cannot be read.
    pub(crate) fn open(
        game: &dyn Game,
        from: &BeginFrom<'_>,
        experiment: &Experiment,
        has_skills: bool,
        device: DeviceKind,
    ) -> Result<Self, BeginError> {
        let path = from.run;
        let refuse = |why: String| BeginError::Misfit { run: path.to_owned(), why };
        if path.is_file() {
            return Err(refuse("it is a file: name the folder of a run, and a skill model with --skills".to_owned()));
        }
        let OpenedRun { run, experiment: theirs, info } = RunDir::open(path)?;
        if theirs.game != experiment.game {
            return Err(refuse(format!("it is of {}, and the new one of {}", theirs.game, experiment.game)));
        }
        if info.game_version != game.version() {
            tracing::warn!(
                "{} was trained on version {} of {}, and the game is at version {}: rules that changed have to be learned anew",
                path.display(),
                info.game_version,
                theirs.game,
                game.version()
            );
        }
        let parts = parts(info.algorithm, experiment.algorithm).map_err(refuse)?;
        let (old, new) = (theirs.observation_config(), experiment.observation_config());
        if old != new && (old.is_image() || new.is_image()) {
            return Err(refuse(format!(
                "its policy reads {old}, and the new one {new}: give both the same `observation`"
            )));
        }
        if let Some(seen) = HeldOut::new(game, &experiment.test).shown_by(info.seen.as_ref()) {
            let test = &experiment.test;
            return Err(refuse(format!("it has learned from {seen}, and the new run holds out {test} (`test`)")));
        }
        if !info.algorithm.has_checkpoints() {
            let why = format!(
                "it is a run of {}, which has no weights but its skill model: name that with --skills",
                info.algorithm
            );
            return Err(refuse(why));
        }
        let checkpoint = run.checkpoint(from.checkpoint)?;
        let file = |error: FileError| refuse(error.to_string());
        let learner = TrainedLearner::load(info.algorithm, &checkpoint.learner_file(), device).map_err(file)?;
        let inputs = input_map(game, &info, learner.spec().obs, experiment).map_err(refuse)?;
        let skills = match experiment.algorithm.needs_skills() && !has_skills {
            true => learner.skill_model(inputs.as_ref()).map_err(|error| refuse(error.to_string()))?,
            false => None,
        };
        let skills = skills.map(|skills| skills.with_picture(new.picture_metadata()));
        if !parts.policy && skills.is_none() {
            let (found, wanted) = (info.algorithm, experiment.algorithm);
            let why = format!("of a run of {found} a run of {wanted} takes its skills only: leave --skills out");
            return Err(refuse(why));
        }
        let moments = from.moments;
        Ok(Self { path: path.to_owned(), info, checkpoint, parts, moments, inputs, skills })
    }

    /// Returns the skills that the new run takes from this one; `None` if it takes none.
    pub(crate) fn skills(&self) -> Option<&SkillModel> {
        self.skills.as_ref()
    }

    /// Gives the new run what it takes, and notes it with the levels that the other one has seen.
    ///
    /// # Errors
    ///
    /// [`BeginError::Misfit`] with the reason that they do not fit.
    pub(crate) fn give(self, trainer: &mut Trainer, info: &mut RunInfo) -> Result<Started, BeginError> {
        let refuse = |why: String| BeginError::Misfit { run: self.path.clone(), why };
        if self.skills.is_some() {
            info.skills.clone_from(&self.info.skills);
        } else if self.parts.policy && info.skills != self.info.skills {
            let why = "its skill model is another one: leave --skills out, and the new run takes those of this one";
            return Err(refuse(why.to_owned()));
        }
        let file = self.checkpoint.learner_file();
        let report = match self.parts.policy {
            true => {
                let (moments, critic) = (self.moments, self.parts.critic);
                let start = StartFrom { path: &file, inputs: self.inputs.as_ref(), moments, critic };
                Some(trainer.learner.start_from(&start).map_err(|error| refuse(error.to_string()))?)
            }
            false => None,
        };
        match &self.info.seen {
            Some(seen) => {
                trainer.note_seen(seen);
                info.seen.iter_mut().for_each(|levels| levels.extend(seen));
            }
            // A run of an older version, whose levels are unknown.
            None => (trainer.seen, info.seen) = (None, None),
        }
        let taken = report.clone().unwrap_or_default();
        let ancestor = Ancestor {
            run: self.path,
            step: self.checkpoint.summary.step,
            algorithm: Some(self.info.algorithm),
            checksum: Some(file_checksum(&file).map_err(RunError::from)?),
            taken: taken.taken,
            anew: taken.anew.into_iter().map(|(layer, _)| layer).collect(),
            new_inputs: taken.new_inputs,
            begun_from: self.info.begun_from.map(Box::new),
        };
        info.begun_from = Some(ancestor);
        Ok(Started { has_skills: self.skills.is_some(), report })
    }
}

/// What a run began with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Started {
    /// True if its skills are those of the other run.
    pub has_skills: bool,
    /// The layers of its policy and critic; `None` if only skills were taken.
    pub report: Option<TakenOver>,
}

/// Returns the place of each observed value in the observation of the other run, whose policy reads `old`. `None` if
/// nothing has to be found: pictures, or values of the same number without names.
fn input_map(
    game: &dyn Game,
    info: &RunInfo,
    old: ObsKind,
    experiment: &Experiment,
) -> Result<Option<InputMap>, String> {
    let (ObsKind::Vector(old), ObsKind::Vector(new)) = (old, experiment.observation_config().obs_kind(game)) else {
        return Ok(None);
    };
    let names = game.observation().names;
    let map = match info.observed.len() == old && names.len() == new {
        true => InputMap::by_name(&info.observed, &names),
        // A run of an older version, which has no names.
        false => InputMap::appended(old, new),
    };
    map.map(Some).map_err(|error| error.to_string())
}
