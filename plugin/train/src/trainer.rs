//! The training loop, one update at a time, with its progress, and the learner of each algorithm. The caller owns the
//! progress bar and decides when to stop.
//!
//! The folder:
//!
//! - `away`: Worlds that play in other processes.
//! - `rivals`: rivals of a trainer, between its rollouts and in its checkpoints.
//! - `warnings`: numbers that are hard to learn from, and large buffers.

mod away;
mod rivals;
mod warnings;

use crate::{
    checkpoint::CheckpointSummary,
    collect::{ArenaState, Collector, Ended, RestoreError, restore_arenas, save_arenas},
    error::TrainError,
    experiment::{Algorithm, Experiment, ExperimentError, LearnerKind},
    levels::{EndedEpisode, LevelPlan, LevelState},
    metrics_log::{RECENT, Timing, UpdateReport},
    self_play::SelfPlay,
    trainer::{
        away::Away,
        warnings::{normalises_observations, strange_scales, warn_of_large_buffer},
    },
};
use bevy::prelude::World;
use bevy_playbot::{
    agent::Agent,
    engine::{SharedBatch, panics::PanicReports},
    episode::EpisodeEnded,
    fault::Fault,
    observation::VectorSensor,
    skill_prior::SkillPrior,
    vision::{ObservationConfig, ObservationKind},
};
use playbot_harness::{
    game::Game,
    held_out::HeldOut,
    parallel::{on_own_threads, on_threads, one_by_one},
    sensors::GameSensors,
    split::LevelSplit,
    worlds::{check_randomised, is_bound_to_its_thread},
};
use playbot_learner::{
    ActionSpace, ContinuedSchedule, DeviceKind, FileError, LearnError, Learner, LearnerMetrics, ObsColumns, ObsKind,
    Observations, Policy, PolicySpec, PpoLearner, Rollout, SacLearner, SeenLevels, SkillModel, SkillSource,
    SpirlLearner, Workers, shared_time,
};
use playbot_report::counted;
use serde::{Deserialize, Serialize};
use std::{
    collections::VecDeque,
    ops::{Deref, DerefMut},
    path::Path,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

pub use crate::trainer::away::ClusterReport;

/// Rows on which the first policy is compared with the decoder.
const INITIAL_KL_ROWS: usize = 1024;

/// Training of one algorithm on one experiment.
pub struct Trainer {
    experiment: Experiment,
    threads: usize,
    /// Those of them that learn.
    workers: Workers,
    pub(crate) learner: TrainedLearner,
    collectors: Vec<Collector>,
    /// Worlds of later lessons in other modes, each with the lesson that they begin with.
    later: VecDeque<(usize, Vec<Collector>)>,
    /// The levels that they play.
    plan: LevelPlan,
    /// Agents of each World of the experiment.
    per_world: usize,
    pub(crate) progress: Progress,
    pub(crate) seen: Option<SeenLevels>,
    pub(crate) continued_schedule: Option<ContinuedSchedule>,
    /// Names of the observed values, if networks read them as they are.
    raw: Vec<String>,
    obs_kind: ObsKind,
    /// Memory of the last rollout's observations, reused for the next.
    obs: Observations,
    /// The rivals, in a training against some.
    self_play: Option<SelfPlay>,
    /// The arenas, if they are played in other processes.
    away: Option<Away>,
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
        let learner = Workers::new(threads).bound(|| TrainedLearner::new(game, experiment, skills, demos, device))?;
        let mut seen = experiment.seen_by_training(game);
        if let Some(demos) = skills.filter(|_| experiment.algorithm.needs_skills()).and_then(SkillModel::demos) {
            seen.extend(demos);
        }
        let trainer = Self::with_learner(game, experiment, learner, threads, None)?;
        let is_normalised = normalises_observations(experiment)
            || (experiment.algorithm.needs_skills() && skills.is_some_and(|skills| skills.obs_stats().is_some()));
        let raw = if is_normalised { Vec::new() } else { game.observation().names };
        Ok(Self { seen: Some(seen), raw, ..trainer })
    }

    /// Makes a trainer around an existing learner, for a checked experiment, with the levels of a checkpoint.
    pub(crate) fn with_learner(
        game: &dyn Game,
        experiment: &Experiment,
        learner: TrainedLearner,
        threads: usize,
        levels: Option<LevelState>,
    ) -> Result<Self, TrainError> {
        let prior = learner.skills().as_ref().map(SkillPrior::from);
        let self_play = SelfPlay::new(game, experiment, threads)?;
        let opposed = self_play.as_ref().map(|it| it.game_of(0).clone());
        let game: &dyn Game = opposed.as_deref().map_or(game, |it| it);
        let of_experiment = experiment.arrangement(game);
        let arrangement = match experiment.observation {
            // A graphics card draws for few Worlds sooner.
            ObservationKind::Camera => of_experiment,
            _ => of_experiment.for_threads(game, threads),
        };
        let (share, per_world) = (arrangement.arenas, of_experiment.arenas as usize);
        let (observation_config, seed) = (experiment.observation_config(), experiment.seed);
        let sharing = game.tools().host.agents_per_arena() as usize;
        let plan = LevelPlan::new(experiment, arrangement.total() as usize, sharing).restored(levels);
        let mut later = VecDeque::new();
        for lesson in plan.changes_of_mode() {
            let mut collectors = Vec::new();
            for first in arrangement.first_agents() {
                for (agents, levels) in plan.parts_by_mode(first as usize..(first + share) as usize, lesson) {
                    let (first, count) = (agents.start as u32, agents.len() as u32);
                    let prior = prior.clone();
                    let opposed = self_play.as_ref().map(|it| it.game_of(first).clone());
                    let game: &dyn Game = opposed.as_deref().map_or(game, |it| it);
                    let mut collector = Collector::new(game, levels, &observation_config, seed, first, count, prior)?;
                    check_spaces(game, levels, &collector)?;
                    if let Some(rivals) = &self_play {
                        collector.set_rivals(rivals.seats_of(first));
                    }
                    experiment.randomise.install(collector.world_mut());
                    collectors.push(collector);
                }
            }
            later.push_back((lesson, collectors));
        }
        let (_, collectors) = later.pop_front().unwrap_or_default();
        let experiment = experiment.clone();
        let obs_kind = observation_config.obs_kind(game);
        let (progress, obs) = (Progress::default(), Observations::empty(&obs_kind));
        let (seen, continued_schedule, raw, workers) = (None, None, Vec::new(), Workers::new(threads));
        let mut trainer = Self {
            experiment,
            threads,
            workers,
            learner,
            collectors,
            later,
            plan,
            per_world,
            progress,
            seen,
            continued_schedule,
            raw,
            obs_kind,
            obs,
            self_play,
            away: None,
        };
        trainer.renew_queues();
        Ok(trainer)
    }

    /// Plays one rollout in every arena and learns from it, on at most as many threads as it was made for. The result
    /// does not depend on their number.
    ///
    /// # Errors
    ///
    /// [`TrainError`]; the learner stays as it was.
    pub fn update(&mut self) -> Result<UpdateReport, TrainError> {
        self.workers.clone().bound(|| self.update_here())
    }

    fn update_here(&mut self) -> Result<UpdateReport, TrainError> {
        let start = Instant::now();
        let (policy, latent) = (self.learner.policy(), self.learner.rollout_latent());
        self.renew_skills();
        self.renew_rivals();
        let steps = self.experiment.rollout_steps();
        let before = self.learner.times();
        let Collected { rollout, finished, played, alone } = self.collect(&policy, latent, steps)?;
        let (collected, shared) = (start.elapsed(), shared_time());
        if self.progress.updates == 0 {
            let strange = strange_scales(&self.experiment, &self.raw, &rollout);
            strange.iter().for_each(|warning| tracing::warn!("{warning}"));
        }
        let initial_kl = self.initial_kl(&rollout)?;
        let learner = self.learner.learn(&rollout)?;
        self.note_levels(&rollout, &finished);
        self.obs = rollout.obs;
        let finished: Vec<EpisodeEnded> = finished.into_iter().map(|(_, ended)| ended.episode).collect();
        self.progress.note(&finished);
        self.progress.updates += 1;
        let before_update = self.progress.steps;
        self.progress.steps += self.experiment.steps_per_update();
        self.rate_rivals(before_update)?;
        let times = self.learner.times().since(before);
        let whole = start.elapsed();
        // All but the loops of networks runs on one thread, once the Worlds have played.
        let alone = alone + whole.saturating_sub(played + (shared_time() - shared));
        let timing = Timing {
            collect_s: collected.as_secs_f64(),
            learn_s: (whole - collected).as_secs_f64(),
            join_s: collected.saturating_sub(played).as_secs_f64(),
            gather_s: times.gather.as_secs_f64(),
            products_s: times.products().as_secs_f64(),
            optimise_s: times.optimise.as_secs_f64(),
            alone_s: alone.as_secs_f64(),
        };
        let mut report = self.progress.report(learner, initial_kl, timing);
        report.levels = self.plan.scalars();
        report.levels.extend(self.self_play.iter().flat_map(SelfPlay::scalars));
        report.clipped_share =
            report.clipped_share.filter(|_| matches!(policy.action_space(), ActionSpace::Continuous(_)));
        Ok(report)
    }

    /// Decides which levels are played next, from the episodes of a rollout, each with its agent.
    fn note_levels(&mut self, rollout: &Rollout, finished: &[(usize, Ended)]) {
        if !self.plan.decides() {
            return;
        }
        let ended = finished.iter().map(|(agent, Ended { tick, episode, .. })| EndedEpisode {
            agent: *agent,
            tick: *tick,
            level: episode.level,
            success: episode.success,
        });
        let ended: Vec<EndedEpisode> = ended.collect();
        if self.plan.note(&ended, self.learner.advantage_sizes(), &rollout.done()) {
            let (lesson, lessons) = self.plan.lesson();
            tracing::info!("lesson {} of {lessons} begins after {} episodes", lesson + 1, self.progress.episodes);
            self.change_worlds(lesson);
        }
        self.renew_queues();
    }

    /// Goes on in the Worlds of a lesson in another mode. Episodes that still run are left: the rollout ended with the
    /// values of their states, as each does.
    fn change_worlds(&mut self, lesson: usize) {
        self.change_shares();
        let Some((_, collectors)) = self.later.pop_front_if(|(first, _)| *first == lesson) else { return };
        let streams: Vec<_> = self.collectors.iter().flat_map(Collector::streams).collect();
        let rivals = self.arena_rivals();
        self.collectors = collectors;
        self.set_arena_rivals(rivals);
        let mut rest = streams.as_slice();
        for collector in &mut self.collectors {
            let (own, others) = rest.split_at(collector.agents().len().min(rest.len()));
            collector.set_streams(own);
            rest = others;
        }
        self.plan.begin_anew();
    }

    /// Gives all agents the queues of their next levels.
    fn renew_queues(&mut self) {
        if !self.plan.decides() {
            return;
        }
        let queues = self.plan.queues();
        let mut rest = queues.as_slice();
        for collector in &mut self.collectors {
            let (own, others) = rest.split_at(collector.agents().len().min(rest.len()));
            collector.set_queues(own);
            rest = others;
        }
    }

    /// Returns the state of the levels, for a checkpoint.
    pub(crate) fn level_state(&self) -> Option<LevelState> {
        self.plan.state()
    }

    /// Updates the prior that draws skills, for algorithms that learn it.
    fn renew_skills(&mut self) {
        let Some(prior) = self.skill_prior().filter(|_| self.experiment.algorithm.learns_prior()) else { return };
        for collector in &mut self.collectors {
            collector.world_mut().insert_resource(prior.clone());
        }
    }

    /// Plays `steps` ticks in all Worlds in parallel. Their observations share one buffer, which is reused.
    fn collect(&mut self, policy: &Policy, latent: usize, steps: usize) -> Result<Collected, TrainError> {
        let start = Instant::now();
        let mut obs = std::mem::replace(&mut self.obs, Observations::empty(&self.obs_kind));
        if self.away.is_some() {
            let (shares, collected) = self.collect_away(policy, latent, steps, &mut obs)?;
            return self.joined(obs, shares, collected, start.elapsed(), Duration::ZERO);
        }
        let shares: Vec<usize> = self.collectors.iter().map(|collector| collector.agents().len()).collect();
        let columns = obs.columns(&self.obs_kind, steps, &shares);
        let mut work: Vec<_> = self.collectors.iter_mut().zip(columns).collect();
        let is_bound = work.iter().any(|(collector, _)| is_bound_to_its_thread(collector.world()));
        let (ends, shared) = (Mutex::new(Vec::new()), shared_time());
        let collect = |(collector, columns): &mut (&mut Collector, ObsColumns<'_>)| {
            let collected = collector.collect_into(columns, policy, latent, steps);
            ends.lock().unwrap_or_else(PoisonError::into_inner).push(start.elapsed());
            collected
        };
        let collected = if is_bound {
            one_by_one(&mut work, self.threads, collect)
        } else if work.len() > self.threads || !policy.is_on_host() {
            collect_together(work, self.threads, policy, latent, steps)?
        } else {
            // A World with a core of its own gains nothing from shared passes.
            on_threads(&mut work, self.threads, collect)
        };
        let played = start.elapsed();
        let mut ends = ends.into_inner().unwrap_or_else(PoisonError::into_inner);
        ends.sort_unstable();
        let alone = match ends.as_slice() {
            // Worlds that wait for one another end at the same time.
            [] if self.threads > 1 && self.collectors.len() > 1 => Duration::ZERO,
            [.., last_but_one, last] if !is_bound && self.threads > 1 => *last - *last_but_one,
            _ => played.saturating_sub(shared_time() - shared),
        };
        self.joined(obs, shares, collected, played, alone)
    }

    /// Joins the results of all Worlds, which have these numbers of agents and filled the columns of `obs`.
    fn joined(
        &self,
        obs: Observations,
        shares: Vec<usize>,
        collected: Vec<OfWorld>,
        played: Duration,
        alone: Duration,
    ) -> Result<Collected, TrainError> {
        let (mut rollouts, mut finished, mut agents) = (Vec::new(), Vec::new(), 0);
        for (part, share) in collected.into_iter().zip(shares) {
            let (rollout, ended) = part?;
            rollouts.push(rollout);
            let world = agents / self.per_world.max(1);
            finished.extend(ended.into_iter().map(|ended| (world, agents + ended.agent, ended)));
            agents += share;
        }
        // As if there were no more Worlds than the experiment has.
        finished.sort_by_key(|(world, _, ended)| (*world, ended.tick));
        let finished = finished.into_iter().map(|(_, agent, ended)| (agent, ended)).collect();
        Ok(Collected { rollout: Rollout::join_around(obs, rollouts)?, finished, played, alone })
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

    /// Returns the values from which the learner of a run that was just prolonged goes on, if they change over the run.
    pub fn continued_schedule(&self) -> Option<&ContinuedSchedule> {
        self.continued_schedule.as_ref()
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

    /// Returns the present lesson and the number of all, of which that of `train` is the last; `None` without a curriculum.
    pub fn lesson(&self) -> Option<(usize, usize)> {
        let (lesson, all) = self.plan.lesson();
        (all > 1).then_some((lesson + 1, all))
    }

    /// Returns a copy of the present policy.
    pub fn policy(&self) -> Policy {
        self.learner.policy()
    }

    /// Returns the state of each arena, by the Worlds of the experiment: their number on this machine is not kept.
    pub(crate) fn save_arenas(&mut self) -> Vec<Vec<ArenaState>> {
        let here = |collectors: &mut Vec<Collector>| collectors.iter_mut().flat_map(save_arenas).collect();
        let all: Vec<ArenaState> = self.states_away().unwrap_or_else(|| here(&mut self.collectors));
        all.chunks(self.per_world.max(1)).map(<[_]>::to_vec).collect()
    }

    /// Brings every arena to its saved state, in a fresh trainer.
    ///
    /// # Errors
    ///
    /// [`RestoreError`] if the arenas differ in number or do not replay.
    pub(crate) fn restore_arenas(&mut self, saved: &[Vec<ArenaState>]) -> Result<(), RestoreError> {
        let (saved, wanted) = (saved.concat(), self.collectors.iter().map(|collector| collector.agents().len()).sum());
        if saved.len() != wanted {
            return Err(RestoreError::Count { saved: saved.len(), wanted });
        }
        let mut rest = saved.as_slice();
        for collector in &mut self.collectors {
            let (own, others) = rest.split_at(collector.agents().len());
            restore_arenas(collector, own)?;
            rest = others;
        }
        Ok(())
    }

    /// Iterates over the Worlds that play, for inspection or measurement.
    pub fn worlds_mut(&mut self) -> impl Iterator<Item = &mut World> {
        self.collectors.iter_mut().map(Collector::world_mut)
    }

    /// Sets the folder for reports of the game's panics, instead of the one for temporary files.
    pub fn report_panics_to(&mut self, folder: &Path) {
        let later = self.later.iter_mut().flat_map(|(_, collectors)| collectors);
        for world in self.collectors.iter_mut().chain(later).map(Collector::world_mut) {
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

/// A rollout of all Worlds.
struct Collected {
    rollout: Rollout,
    /// Ended episodes, each with its agent as a column of the rollout.
    finished: Vec<(usize, Ended)>,
    /// Time in which they played.
    played: Duration,
    /// The part of it in which one thread played, at most.
    alone: Duration,
}

/// Result of a World's play.
type OfWorld = Result<(Rollout, Vec<Ended>), Fault>;

/// Plays the Worlds with shared forward passes: the result is the same.
fn collect_together(
    worlds: Vec<(&mut Collector, ObsColumns<'_>)>,
    threads: usize,
    policy: &Policy,
    latent: usize,
    steps: usize,
) -> Result<Vec<OfWorld>, TrainError> {
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

/// Checks that the agents of a mode have the actions and the observation of the game.
fn check_spaces(game: &dyn Game, levels: &LevelSplit, collector: &Collector) -> Result<(), TrainError> {
    let refuse = |what: &str, found: String, wanted: String| {
        let why = format!(
            "agents of the mode `{}` have {found}, but one policy learns all lessons, and it has {wanted}: name lessons of \
             modes with the same {what}",
            levels.mode
        );
        let (key, value) = ("curriculum.lessons", levels.to_string());
        Err(ExperimentError::Value { key, value, why }.into())
    };
    let (actions, seen) = (game.actions(), game.observation().len());
    for &agent in collector.agents() {
        let agent = collector.world().entity(agent);
        if let Some(own) = agent.get::<Agent>().map(|agent| agent.actions).filter(|own| *own != actions) {
            return refuse("actions", own.to_string(), actions.to_string());
        }
        let values = agent.get::<VectorSensor>().map(|sensor| sensor.space().len());
        if let Some(own) = values.filter(|own| *own != seen) {
            return refuse("observation", counted(own as u64, "observed value"), counted(seen as u64, "value"));
        }
    }
    Ok(())
}

/// Checks that the experiment can be run on this game.
pub(crate) fn check(game: &dyn Game, experiment: &Experiment) -> Result<(), TrainError> {
    if let Some(problem) = game.problem() {
        return Err(Fault(problem).into());
    }
    experiment.check()?;
    experiment.check_game(game)?;
    experiment.observation_config().check(game)?;
    experiment.check_memory(game)?;
    let train = &experiment.train;
    Ok(check_randomised(&experiment.randomise, game, &train.mode, train.first)?)
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
            elo: None,
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
            levels: Vec::new(),
            learner,
            timing,
        }
    }
}

// The learner of an algorithm.

/// Learner of any algorithm.
#[derive(Debug)]
pub struct TrainedLearner(Box<dyn Learner>);

impl Deref for TrainedLearner {
    type Target = dyn Learner;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

impl DerefMut for TrainedLearner {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut *self.0
    }
}

impl TrainedLearner {
    /// Makes a learner with fresh weights, tied to `skills` if the experiment's algorithm needs them. `demos` are the
    /// rollouts for algorithms that train on recordings too.
    ///
    /// # Errors
    ///
    /// [`TrainError`] if settings, game and skill model do not fit one another.
    pub fn new(
        game: &dyn Game,
        experiment: &Experiment,
        skills: Option<&SkillModel>,
        demos: &[Rollout],
        device: DeviceKind,
    ) -> Result<Self, TrainError> {
        let (experiment, algorithm) = (&experiment.with_sets(game), experiment.algorithm);
        let (seed, score) = (experiment.seed, experiment.score.clone());
        let spec =
            PolicySpec { obs: experiment.observation_config().obs_kind(game), latent: 0, action_space: game.actions() };
        let (ppo, sac, spirl) = (experiment.ppo_config(), experiment.sac.clone(), experiment.spirl.clone());
        let skills = skills.filter(|_| algorithm.needs_skills());
        match algorithm.learner() {
            LearnerKind::Ppo => {}
            LearnerKind::Sac => warn_of_large_buffer(experiment, spec, skills.map_or(0, SkillModel::latent)),
        }
        if algorithm.trains_on_demos() && demos.is_empty() {
            return Err(TrainError::NoDemos(algorithm));
        }
        let model = || fitting(game, experiment, skills);
        Ok(match algorithm {
            Algorithm::BehaviourCloning | Algorithm::Imitation => return Err(TrainError::NotTrained(algorithm)),
            Algorithm::Ppo => Self::of(PpoLearner::new(ppo, spec, seed, device)?),
            Algorithm::Sac => Self::of(SacLearner::new(sac, spec, seed, device)?),
            Algorithm::Rlpd => Self::of(SacLearner::with_demos(sac, &experiment.rlpd, demos, spec, seed, device)?),
            Algorithm::ScorePpo => Self::of(PpoLearner::with_skill(ppo, score, model()?, seed, device)?),
            Algorithm::ScoreSac => Self::of(SacLearner::with_skill(sac, score, model()?, seed, device)?),
            Algorithm::SpirlPpo => Self::of(SpirlLearner::ppo(spirl, ppo, &score, model()?, seed, device)?),
            Algorithm::SpirlSac => Self::of(SpirlLearner::sac(spirl, sac, &ppo, &score, model()?, seed, device)?),
        })
    }

    fn of(learner: impl Learner + 'static) -> Self {
        Self(Box::new(learner))
    }

    /// Takes over the settings that may change while training is stopped: the length, over which a learning rate
    /// falls. Returns the values from which a run of another length goes on.
    pub(crate) fn set_length(&mut self, experiment: &Experiment) -> Option<ContinuedSchedule> {
        self.set_total_updates(experiment.ppo_config().total_updates)
    }

    /// Loads a learner of this algorithm.
    ///
    /// # Errors
    ///
    /// [`FileError`] with the error of the file.
    pub fn load(algorithm: Algorithm, path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        if algorithm.learns_prior() {
            return Ok(Self::of(SpirlLearner::load(path, device)?));
        }
        Ok(match algorithm.learner() {
            LearnerKind::Ppo => Self::of(PpoLearner::load(path, device)?),
            LearnerKind::Sac => Self::of(SacLearner::load(path, device)?),
        })
    }
}

/// Returns the skill model, if it exists and was learned for this game.
fn fitting<'a>(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<&'a SkillModel>,
) -> Result<&'a SkillModel, TrainError> {
    let skills = skills.ok_or(TrainError::NoSkills(experiment.algorithm))?;
    let (model, observation_config) =
        (ObservationConfig::from_metadata(skills.picture(), &skills.observation())?, experiment.observation_config());
    if model.is_image() != observation_config.is_image()
        || (observation_config.is_image() && model != observation_config)
    {
        return Err(TrainError::SkillObservation { model, experiment: observation_config });
    }
    let (observation, action_space) = (observation_config.obs_kind(game), game.actions());
    if (skills.observation(), skills.action_space()) != (observation, action_space) {
        return Err(TrainError::ForeignSkills {
            game: game.name().to_owned(),
            model_obs: skills.observation(),
            model_actions: skills.action_space().into(),
            game_obs: observation,
            game_actions: action_space.into(),
        });
    }
    let sets: Vec<_> = game.observation().sets().into_iter().map(|set| set.block).collect();
    let theirs = skills.config().entities.blocks();
    if !theirs.is_empty() && theirs != sets {
        return Err(TrainError::OtherSets { game: game.name().to_owned() });
    }
    match HeldOut::new(game, &experiment.test).shown_by(skills.demos()) {
        Some(seen) => Err(TrainError::SeenSkills { seen, test: experiment.test.clone() }),
        None => Ok(skills),
    }
}
