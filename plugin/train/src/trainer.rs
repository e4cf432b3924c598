//! The training loop, one update at a time, with its progress and the report of each update. The caller owns the
//! progress bar and decides when to stop.
//!
//! - `learner`: the learner of an experiment's algorithm.

pub mod learner;

use crate::{
    checkpoint::CheckpointSummary, collect::Collector, error::TrainError, experiment::Experiment,
    trainer::learner::TrainedLearner,
};
use bevy::prelude::World;
use bevy_playbot::{
    engine::{SharedBatch, panics::PanicReports},
    episode::EpisodeEnded,
    fault::Fault,
    skill_prior::SkillPrior,
};
use playbot_harness::{
    arrangement::Arrangement,
    game::Game,
    parallel::{on_own_threads, on_threads},
    sensors::GameSensors,
    split::seen_by_training,
};
use playbot_learner::{
    ActionSpace, DeviceKind, LearnError, LearnerMetrics, ObsColumns, ObsKind, Observations, Policy, Rollout,
    SeenLevels, SkillModel, SkillSource,
};
use serde::{Deserialize, Serialize};
use std::{
    collections::VecDeque,
    path::Path,
    time::{Duration, Instant},
};

/// Rows on which the first policy is compared with the decoder.
const INITIAL_KL_ROWS: usize = 1024;

/// Tag of the success rate of the last 100 episodes.
pub const SUCCESS_RATE: &str = "charts/success_rate";

/// Tag of the mean return of the last 100 episodes.
pub const EPISODIC_RETURN: &str = "charts/episodic_return";

/// Tag of the mean length of the last 100 episodes, ticks.
pub const EPISODIC_LENGTH: &str = "charts/episodic_length";

/// Tag of the share of clipped actions in the last 100 episodes.
pub const CLIPPED_SHARE: &str = "charts/clipped_share";

/// Tag of the number of episodes that have ended.
pub const EPISODES: &str = "charts/episodes";

/// Tags of the means over the last 100 episodes.
pub const EPISODE_MEANS: [&str; 3] = [EPISODIC_RETURN, EPISODIC_LENGTH, SUCCESS_RATE];

/// Episodes over which the current return, length and success rate are averaged.
pub(crate) const RECENT: usize = 100;

/// Training of one algorithm on one experiment.
pub struct Trainer {
    experiment: Experiment,
    threads: usize,
    pub(crate) learner: TrainedLearner,
    pub(crate) collectors: Vec<Collector>,
    pub(crate) progress: Progress,
    pub(crate) seen: Option<SeenLevels>,
    obs_kind: ObsKind,
    /// Memory of the last rollout's observations, reused for the next.
    obs: Observations,
}

impl Trainer {
    /// Makes a trainer at its first step.
    ///
    /// # Errors
    ///
    /// [`TrainError`] if experiment, game and skill model do not fit one another.
    pub fn new(
        game: &dyn Game,
        experiment: &Experiment,
        skills: Option<&SkillModel>,
        device: DeviceKind,
        threads: usize,
    ) -> Result<Self, TrainError> {
        Self::with_demos(game, experiment, skills, &[], device, threads)
    }

    /// Makes a trainer as [`new`](Self::new) does, for algorithms that may train on recordings too.
    /// [`rollouts`](crate::demo::Demonstrations::rollouts) gives the recordings, which other algorithms
    /// ignore.
    ///
    /// # Errors
    ///
    /// As for [`new`](Self::new); and if the recordings have no reward.
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

    /// Makes a trainer around an existing learner, for a checked experiment.
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
    /// [`TrainError`]; the learner stays as it was.
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

    /// Updates the prior that draws skills, for algorithms that learn it.
    fn renew_skills(&mut self) {
        let Some(prior) = self.skill_prior().filter(|_| self.experiment.algorithm.learns_prior()) else { return };
        for collector in &mut self.collectors {
            collector.world_mut().insert_resource(prior.clone());
        }
    }

    /// Plays `steps` ticks in all Worlds in parallel. Their observations share one buffer, which is reused.
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
            // A World with a core of its own gains nothing from shared passes.
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

    /// Compares the policy with the decoder before the first update of SCORE: they must be equal to the bit. For a
    /// policy over skills, compares it with the prior.
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

    /// Returns whether all steps of the experiment are done.
    pub fn is_done(&self) -> bool {
        self.progress.steps >= self.experiment.steps
    }

    /// Returns the environment steps done.
    pub fn steps(&self) -> u64 {
        self.progress.steps
    }

    /// Returns the updates done.
    pub fn updates(&self) -> u64 {
        self.progress.updates
    }

    /// Returns the experiment.
    pub fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// Returns the levels that it sees, and those in the demonstrations of its skills; `None` for a resumed run of an
    /// older version.
    pub fn seen(&self) -> Option<&SeenLevels> {
        self.seen.as_ref()
    }

    /// Notes the levels of the recordings that it trains on.
    pub fn note_seen(&mut self, recorded: &SeenLevels) {
        self.seen.iter_mut().for_each(|seen| seen.extend(recorded));
    }

    /// Returns a copy of the present policy.
    pub fn policy(&self) -> Policy {
        self.learner.policy()
    }

    /// Returns the time that the learner has spent on gathering minibatches.
    pub fn gathering(&self) -> Duration {
        self.learner.gathering()
    }

    /// Iterates over the Worlds that play, for inspection or measurement.
    pub fn worlds_mut(&mut self) -> impl Iterator<Item = &mut World> {
        self.collectors.iter_mut().map(Collector::world_mut)
    }

    /// Sets the folder for reports of the game's panics, instead of the one for temporary files.
    pub fn report_panics_to(&mut self, folder: &Path) {
        for world in self.worlds_mut() {
            if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
                reports.move_to(folder);
            }
        }
    }

    /// Returns the source of the policy's skills, if it has skills.
    pub fn skill_source(&self) -> Option<SkillSource> {
        self.learner.skills()
    }

    /// Returns the prior that draws its skills.
    pub fn skill_prior(&self) -> Option<SkillPrior> {
        self.skill_source().as_ref().map(SkillPrior::from)
    }
}

/// Result of a World's play.
type Collected = Result<(Rollout, Vec<EpisodeEnded>), Fault>;

/// Plays the Worlds with shared forward passes: the result is the same.
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
    // Most of the threads wait, for the others or for their turn.
    let collected = on_own_threads(
        &mut work,
        |((collector, columns), seat)| collector.collect_at(seat, columns, policy, latent, steps),
        // A World that leaves its seat is no longer waited for.
        |(_, seat)| drop(seat.play()),
    );
    collected.map_err(|source| TrainError::Threads { worlds: count, source })
}

/// Checks that the experiment can be run on this game.
pub(crate) fn check(game: &dyn Game, experiment: &Experiment) -> Result<(), TrainError> {
    if let Some(problem) = game.problem() {
        return Err(Fault(problem).into());
    }
    experiment.check()?;
    experiment.check_game(game)?;
    experiment.observation_config().check(game)?;
    Ok(experiment.check_memory(game)?)
}

/// Results of one update. Everything except `timing` is the same in every run with the same seed.
#[derive(Clone, Debug)]
pub struct UpdateReport {
    /// Updates done, this one included.
    pub update: u64,
    /// Environment steps done, over all arenas together.
    pub step: u64,
    /// Episodes that have ended. Before the 100th, the means below are over fewer episodes, of which short ones end
    /// first.
    pub episodes: u64,
    /// Mean return of the last 100 episodes; `None` before the first has ended.
    pub episodic_return: Option<f64>,
    /// Mean length of the last 100 episodes, ticks.
    pub episodic_length: Option<f64>,
    /// Success rate of the last 100 episodes.
    pub success_rate: Option<f64>,
    /// Share of the ticks of the last 100 episodes whose action was clipped to the game's range; only for continuous
    /// actions.
    pub clipped_share: Option<f64>,
    /// KL divergence from decoder to policy before the first update; only in the first report of SCORE.
    pub initial_kl: Option<f32>,
    /// The learner's metrics.
    pub learner: LearnerMetrics,
    /// Time spent.
    pub timing: Timing,
}

impl UpdateReport {
    /// Returns whether at least 100 episodes have ended, and at least this share of the last 100 succeeded.
    pub fn mostly_succeeds(&self, share: f64) -> bool {
        self.episodes >= RECENT as u64 && self.success_rate.is_some_and(|rate| rate >= share)
    }

    /// Returns all measurements by TensorBoard tag; the same numbers in every run with the same seed.
    pub fn scalars(&self) -> Vec<(&'static str, f64)> {
        let episodes = [
            (EPISODES, Some(self.episodes as f64)),
            (EPISODIC_RETURN, self.episodic_return),
            (EPISODIC_LENGTH, self.episodic_length),
            (SUCCESS_RATE, self.success_rate),
            (CLIPPED_SHARE, self.clipped_share),
            ("score/initial_kl", self.initial_kl.map(f64::from)),
        ];
        let known = episodes.into_iter().filter_map(|(tag, value)| Some((tag, value?)));
        known.chain(self.learner.scalars()).collect()
    }
}

/// Wall-clock seconds of one update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Simulating, observing and deciding.
    pub collect_s: f64,
    /// Learning.
    pub learn_s: f64,
}

/// Returns the natural range of a metric; `None` if any value is possible.
pub fn range_of(tag: &str) -> Option<(f64, f64)> {
    [SUCCESS_RATE, CLIPPED_SHARE].contains(&tag).then_some((0.0, 1.0))
}

/// A finished episode, as the moving averages keep it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RecentEpisode {
    total_reward: f64,
    ticks: u32,
    success: bool,
    /// Ticks whose action was clipped; missing in older checkpoints.
    #[serde(default)]
    clipped: u32,
}

/// Progress of training.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Progress {
    pub(crate) updates: u64,
    pub(crate) steps: u64,
    pub(crate) episodes: u64,
    pub(crate) recent: VecDeque<RecentEpisode>,
}

impl Progress {
    pub(crate) fn note(&mut self, finished: &[EpisodeEnded]) {
        self.episodes += finished.len() as u64;
        self.recent.extend(finished.iter().map(|episode| RecentEpisode {
            total_reward: episode.total_reward,
            ticks: episode.ticks,
            success: episode.success,
            clipped: episode.clipped,
        }));
        let surplus = self.recent.len().saturating_sub(RECENT);
        self.recent.drain(..surplus);
    }

    /// Returns the mean over the last episodes; `None` before the first has ended.
    fn mean(&self, value: fn(&RecentEpisode) -> f64) -> Option<f64> {
        let n = self.recent.len();
        (n > 0).then(|| self.recent.iter().map(value).sum::<f64>() / n as f64)
    }

    fn episodic_return(&self) -> Option<f64> {
        self.mean(|episode| episode.total_reward)
    }

    fn success_rate(&self) -> Option<f64> {
        self.mean(|episode| f64::from(u8::from(episode.success)))
    }

    /// Returns the share of the clipped ticks among those of the last episodes.
    fn clipped_share(&self) -> Option<f64> {
        let ticks = self.mean(|episode| f64::from(episode.ticks)).filter(|ticks| *ticks > 0.0)?;
        Some(self.mean(|episode| f64::from(episode.clipped))? / ticks)
    }

    /// Returns the training results, with means once enough episodes have ended.
    pub(crate) fn summary(&self) -> CheckpointSummary {
        let settled = |mean: Option<f64>| mean.filter(|_| self.recent.len() == RECENT);
        CheckpointSummary {
            step: self.steps,
            episodic_return: settled(self.episodic_return()),
            success_rate: settled(self.success_rate()),
        }
    }

    pub(crate) fn report(&self, learner: LearnerMetrics, initial_kl: Option<f32>, timing: Timing) -> UpdateReport {
        UpdateReport {
            update: self.updates,
            step: self.steps,
            episodes: self.episodes,
            episodic_return: self.episodic_return(),
            episodic_length: self.mean(|episode| f64::from(episode.ticks)),
            success_rate: self.success_rate(),
            clipped_share: self.clipped_share(),
            initial_kl,
            learner,
            timing,
        }
    }
}
