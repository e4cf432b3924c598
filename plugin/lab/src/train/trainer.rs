//! The training loop, one update at a time: the caller owns the progress bar and decides when to stop.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use bevy::prelude::World;
use bevy_playbot::{episode::EpisodeEnded, fault::Fault, shared_batch::SharedBatch, skill_prior::SkillPrior};
use playbot_learner::{
    ActionSpace, DeviceKind, LearnError, ObsColumns, ObsKind, Observations, Policy, Rollout, SeenLevels, SkillModel,
    SkillSource,
};

use super::{
    collect::Collector,
    config::Experiment,
    learner::TrainedLearner,
    progress::Progress,
    train_error::TrainError,
    update_report::{Timing, UpdateReport},
};
use crate::{
    arrangement::Arrangement,
    game::Game,
    held_out::seen_by_training,
    parallel::{on_own_threads, on_threads},
    sensors::GameSensors,
};
use bevy_playbot::panics::PanicReports;

/// Rows on which the first policy is compared with the decoder.
const INITIAL_KL_ROWS: usize = 1024;

/// One algorithm being trained on one experiment.
pub struct Trainer {
    experiment: Experiment,
    threads: usize,
    pub(crate) learner: TrainedLearner,
    pub(crate) collectors: Vec<Collector>,
    pub(crate) progress: Progress,
    pub(crate) seen: Option<SeenLevels>,
    obs_kind: ObsKind,
    /// Memory of the last rollout's observations, for the next.
    obs: Observations,
}

impl Trainer {
    /// A trainer at its first step.
    ///
    /// # Errors
    ///
    /// [`TrainError`] if experiment, game and skill model do not go together.
    pub fn new(
        game: &dyn Game,
        experiment: &Experiment,
        skills: Option<&SkillModel>,
        device: DeviceKind,
        threads: usize,
    ) -> Result<Self, TrainError> {
        Self::with_demos(game, experiment, skills, &[], device, threads)
    }

    /// [`new`](Self::new) for algorithms that may train on recordings too:
    /// [`rollouts`](crate::demo::dataset::Demonstrations::rollouts) gives them. The others do not look at them.
    ///
    /// # Errors
    ///
    /// As there; and if nothing in the recordings was ever rewarded.
    pub fn with_demos(
        game: &dyn Game,
        experiment: &Experiment,
        skills: Option<&SkillModel>,
        demos: &[Rollout],
        device: DeviceKind,
        threads: usize,
    ) -> Result<Self, TrainError> {
        check(game, experiment)?;
        let learner = TrainedLearner::new(game, experiment, skills, demos, device)?;
        let mut seen = seen_by_training(game, &experiment.train);
        if let Some(demos) = skills.filter(|_| experiment.algorithm.needs_skills()).and_then(SkillModel::demos) {
            seen.extend(demos);
        }
        let trainer = Self::with_learner(game, experiment, learner, threads)?;
        Ok(Self { seen: Some(seen), ..trainer })
    }

    /// A trainer around a learner that exists already, for an experiment that was checked.
    pub(crate) fn with_learner(
        game: &dyn Game,
        experiment: &Experiment,
        learner: TrainedLearner,
        threads: usize,
    ) -> Result<Self, TrainError> {
        let prior = learner.skills().as_ref().map(SkillPrior::from);
        let arrangement = Arrangement::new(game, experiment.arenas, experiment.worlds);
        let share = arrangement.arenas;
        let (levels, observation_config, seed) = (&experiment.train, experiment.observation_config(), experiment.seed);
        let collectors: Result<_, _> = arrangement
            .first_agents()
            .map(|first| Collector::new(game, levels, &observation_config, seed, first, share, prior.clone()))
            .collect();
        let (experiment, collectors) = (experiment.clone(), collectors?);
        let obs_kind = observation_config.obs_kind(game);
        let (progress, obs) = (Progress::default(), Observations::empty(&obs_kind));
        Ok(Self { experiment, threads, learner, collectors, progress, seen: None, obs_kind, obs })
    }

    /// Plays one rollout in every arena and learns from it.
    ///
    /// # Errors
    ///
    /// [`TrainError`]; what was learned before stays as it was.
    pub fn update(&mut self) -> Result<UpdateReport, TrainError> {
        let start = Instant::now();
        let (policy, latent) = (self.learner.policy(), self.learner.rollout_latent());
        self.renew_skills();
        let steps = self.experiment.rollout_steps();
        let (rollout, finished) = self.collect(&policy, latent, steps)?;
        let collect_s = start.elapsed().as_secs_f64();
        let initial_kl = self.initial_kl(&rollout)?;
        let learner = self.learner.learn(&rollout)?;
        self.obs = rollout.obs;
        self.progress.note(&finished);
        self.progress.updates += 1;
        self.progress.steps += self.experiment.steps_per_update();
        let timing = Timing { collect_s, learn_s: start.elapsed().as_secs_f64() - collect_s };
        let mut report = self.progress.report(learner, initial_kl, timing);
        report.clipped_share =
            report.clipped_share.filter(|_| matches!(policy.action_space(), ActionSpace::Continuous(_)));
        Ok(report)
    }

    /// Draws skills from what was learned of them, where that goes on.
    fn renew_skills(&mut self) {
        let Some(prior) = self.skill_prior().filter(|_| self.experiment.algorithm.learns_prior()) else { return };
        for collector in &mut self.collectors {
            collector.world_mut().insert_resource(prior.clone());
        }
    }

    /// Plays `steps` ticks in all Worlds at once. Their observations share one piece of memory, which is kept.
    fn collect(
        &mut self,
        policy: &Policy,
        latent: usize,
        steps: usize,
    ) -> Result<(Rollout, Vec<EpisodeEnded>), TrainError> {
        let mut obs = std::mem::replace(&mut self.obs, Observations::empty(&self.obs_kind));
        let shares: Vec<usize> = self.collectors.iter().map(|collector| collector.agents().len()).collect();
        let columns = obs.columns(&self.obs_kind, steps, &shares);
        let mut work: Vec<_> = self.collectors.iter_mut().zip(columns).collect();
        let collected = if work.len() > self.threads || !policy.is_on_host() {
            collect_together(work, self.threads, policy, latent, steps)?
        } else {
            // With a core of its own a World gains nothing from waiting for others.
            on_threads(&mut work, self.threads, |(collector, columns)| {
                collector.collect_into(columns, policy, latent, steps)
            })
        };
        let (mut rollouts, mut finished) = (Vec::new(), Vec::new());
        for part in collected {
            let (rollout, ended) = part?;
            rollouts.push(rollout);
            finished.extend(ended);
        }
        Ok((Rollout::join_around(obs, rollouts)?, finished))
    }

    /// Before the first update of SCORE, the policy must be the decoder, to the bit; likewise a policy over skills the prior.
    fn initial_kl(&self, rollout: &Rollout) -> Result<Option<f32>, LearnError> {
        let Experiment { algorithm, score, .. } = &self.experiment;
        let copied = algorithm.learns_prior() || (algorithm.needs_skills() && score.init_from_decoder);
        if self.progress.updates > 0 || !copied {
            return Ok(None);
        }
        let rows = INITIAL_KL_ROWS.min(rollout.steps * rollout.envs);
        let (z, obs) = (&rollout.z[..rows * rollout.latent], rollout.obs.rows(0..rows, rollout.obs_kind.numbers()));
        self.learner.initial_kl(z, obs, rows)
    }

    /// Whether all steps of the experiment are done.
    pub fn is_done(&self) -> bool {
        self.progress.steps >= self.experiment.steps
    }

    /// Environment steps done.
    pub fn steps(&self) -> u64 {
        self.progress.steps
    }

    /// Updates done.
    pub fn updates(&self) -> u64 {
        self.progress.updates
    }

    /// The experiment.
    pub fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// The levels that it sees, and those that the demonstrations of its skills show; `None` where a run of an older version goes on.
    pub fn seen(&self) -> Option<&SeenLevels> {
        self.seen.as_ref()
    }

    /// Notes what recordings show that it trains on.
    pub fn note_seen(&mut self, recorded: &SeenLevels) {
        self.seen.iter_mut().for_each(|seen| seen.extend(recorded));
    }

    /// The policy as it is now.
    pub fn policy(&self) -> Policy {
        self.learner.policy()
    }

    /// Time that the learner spent putting minibatches together so far.
    pub fn gathering(&self) -> Duration {
        self.learner.gathering()
    }

    /// The Worlds that play, to look into or to measure.
    pub fn worlds_mut(&mut self) -> impl Iterator<Item = &mut World> {
        self.collectors.iter_mut().map(Collector::world_mut)
    }

    /// Writes what is kept of a panic of the game into this folder, instead of the one for temporary files.
    pub fn report_panics_to(&mut self, folder: &Path) {
        for world in self.worlds_mut() {
            if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
                reports.move_to(folder);
            }
        }
    }

    /// Where the policy's skills come from, if it has any.
    pub fn skill_source(&self) -> Option<SkillSource> {
        self.learner.skills()
    }

    /// The prior that draws its skills.
    pub fn skill_prior(&self) -> Option<SkillPrior> {
        self.skill_source().as_ref().map(SkillPrior::from)
    }
}

/// What a World has played.
type Collected = Result<(Rollout, Vec<EpisodeEnded>), Fault>;

/// Lets Worlds play that share their forward passes: what they play is the same.
fn collect_together(
    worlds: Vec<(&mut Collector, ObsColumns<'_>)>,
    threads: usize,
    policy: &Policy,
    latent: usize,
    steps: usize,
) -> Result<Vec<Collected>, TrainError> {
    let count = worlds.len();
    let seats = SharedBatch::seats(policy, count, threads);
    let mut work: Vec<_> = worlds.into_iter().zip(seats).collect();
    // Most of them wait, for the others or for their turn.
    let collected = on_own_threads(
        &mut work,
        |((collector, columns), seat)| collector.collect_at(seat, columns, policy, latent, steps),
        // Whoever has sat down and leaves is not waited for.
        |(_, seat)| drop(seat.play()),
    );
    collected.map_err(|source| TrainError::Threads { worlds: count, source })
}

/// Whether the experiment can be run on this game.
pub(crate) fn check(game: &dyn Game, experiment: &Experiment) -> Result<(), TrainError> {
    if let Some(problem) = game.problem() {
        return Err(Fault(problem).into());
    }
    experiment.check()?;
    experiment.check_game(game)?;
    experiment.observation_config().check(game)?;
    Ok(experiment.check_memory(game)?)
}
