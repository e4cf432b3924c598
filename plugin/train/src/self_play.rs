//! Training against rivals: snapshots of the policy and scripted bots, drawn for each episode, and their ratings.
//!
//! One agent of each arena learns, on a seat that the arena keeps: arena n has seat n modulo the number of seats, so each
//! seat learns equally often. The others play along by the rivals of a pool, as
//! [`rivals`](playbot_harness::rivals) describes. The rival of an episode is drawn from a stream of the run's seed, the
//! arena and the number of its episode, so the number of threads changes nothing. All that later
//! draws and ratings depend on is in `SelfPlayState` and in the policies of snapshots, which a checkpoint keeps.
//!
//! The folder:
//!
//! - `ladder`: the table of all rivals by their ratings, and its file in a run.

pub mod ladder;

use crate::{
    error::TrainError,
    experiment::{Experiment, SelfPlayConfig},
    metrics_log::RECENT,
    rival_seats::{ArenaRivals, RivalPool, RivalSeats},
    self_play::ladder::{Ladder, ladder_of},
};
use bevy_playbot::{policy::ActionDraw, skill_prior::SkillPrior, vision::ObservationConfig};
use playbot_harness::{
    eval::Player,
    game::Game,
    rivals::{
        Opposed, RivalError,
        matches::{MatchOutcome, MatchPlan, play_matches},
        scripted_rival,
    },
};
use playbot_learner::{DeviceKind, FileError, Learner, Observations, Policy, PolicyFile, PolicyMetadata, SkillSource};
use playbot_report::ratings::{Encounter, Rating};
use serde::{Deserialize, Serialize};
use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Tag of the share of wins among the last 100 training episodes, against all rivals.
pub const WIN_RATE: &str = "self_play/win_rate";

/// Tag of the share of draws among them.
pub const DRAW_RATE: &str = "self_play/draw_rate";

/// Tag of the newest snapshot's rating.
pub const ELO: &str = "self_play/elo";

/// What a training against rivals is decided from, besides the policies of its snapshots.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SelfPlayState {
    /// Environment steps at which each snapshot was taken.
    steps: Vec<u64>,
    /// Results of rating matches. Numbers are those of the ladder: bots, then snapshots.
    encounters: Vec<Encounter>,
    /// Results of the last training episodes, the oldest first.
    recent: VecDeque<MatchOutcome>,
    /// The rivals of each arena.
    arenas: Vec<ArenaRivals>,
}

/// What a run has learned by some moment, as a rival.
#[derive(Clone)]
pub(crate) struct Snapshot {
    pub(crate) policy: Policy,
    /// The source of its skills, which SPiRL goes on learning; `None` without skills.
    pub(crate) skills: Option<SkillSource>,
}

impl Snapshot {
    /// Takes a snapshot of a learner.
    pub(crate) fn of(learner: &dyn Learner) -> Self {
        Self { policy: learner.policy(), skills: learner.skills() }
    }

    fn player(&self) -> Player {
        let prior = self.skills.as_ref().map(SkillPrior::from);
        Player::Policy { policy: self.policy.clone(), prior, draw: ActionDraw::Sample }
    }
}

/// A training against rivals.
pub(crate) struct SelfPlay {
    config: SelfPlayConfig,
    /// The game with its first agent on each seat.
    seats: Vec<Arc<Opposed>>,
    /// The matches by which a snapshot is rated against another player.
    rating: MatchPlan,
    seed: u64,
    bots: Vec<(String, Player)>,
    /// Snapshots that play, each with its number among all, the oldest first.
    snapshots: Vec<(usize, Snapshot)>,
    state: SelfPlayState,
}

impl SelfPlay {
    /// Prepares a training against rivals, without a snapshot yet; `None` for one without rivals. The experiment was
    /// checked with the game.
    pub(crate) fn new(game: &dyn Game, experiment: &Experiment, threads: usize) -> Result<Option<Self>, TrainError> {
        let config = experiment.self_play.clone();
        if config.every.is_none() {
            return Ok(None);
        }
        experiment.check_rivals_of(game)?;
        let count = game.tools().host.seats().len();
        let seats = (0..count).map(|seat| Ok(Arc::new(Opposed::new(game, seat)?))).collect::<Result<Vec<_>, _>>();
        let bots = config.bots().filter_map(|name| {
            let player = scripted_rival(game, name).ok()?;
            Some((name.clone(), player))
        });
        let most = usize::try_from(config.matches).unwrap_or(usize::MAX);
        let rating = MatchPlan {
            mode: experiment.test.mode.clone(),
            levels: experiment.test.levels().take(most).collect(),
            seats: Vec::new(),
            seed: experiment.seed,
            threads,
            randomise: experiment.randomise.clone(),
        };
        let bots = bots.collect();
        let (snapshots, state) = (Vec::new(), SelfPlayState::default());
        let seats = seats.map_err(|error: RivalError| TrainError::Rivals(Box::new(error.into())))?;
        Ok(Some(Self { config, seats, rating, seed: experiment.seed, bots, snapshots, state }))
    }

    /// Returns the game as the agent of this number meets it.
    pub(crate) fn game_of(&self, agent: u32) -> &Arc<Opposed> {
        &self.seats[agent as usize % self.seats.len()]
    }

    /// Returns the rivals of the arena of this agent, before its first episode.
    pub(crate) fn seats_of(&self, agent: u32) -> RivalSeats {
        RivalSeats::new(self.game_of(agent).clone(), u64::from(agent))
    }

    /// Returns the number of a snapshot on the ladder.
    fn number(&self, snapshot: usize) -> usize {
        self.bots.len() + snapshot
    }

    /// Returns the snapshots that are drawn: the newest of them.
    fn drawn(&self) -> &[(usize, Snapshot)] {
        &self.snapshots[self.snapshots.len().saturating_sub(pool_of(&self.config))..]
    }

    /// Returns the rivals of the next episodes; `None` before the first snapshot.
    pub(crate) fn pool(&self) -> Option<RivalPool> {
        let (newest, snapshot) = self.snapshots.last()?;
        let newest = (self.number(*newest), snapshot.player());
        let bots = self.bots.iter().take(self.config.rivals.len()).enumerate();
        let bots = bots.map(|(number, (_, player))| (number, player.clone()));
        let snapshots = self.drawn().iter().map(|(it, snapshot)| (self.number(*it), snapshot.player()));
        let has_snapshots = !self.drawn().is_empty();
        let latest = if has_snapshots { self.config.latest } else { 0.0 };
        Some(RivalPool { seed: self.seed, latest, newest, all: bots.chain(snapshots).collect() })
    }

    /// Returns the player of this number on the ladder, if it is a bot or a snapshot that is kept.
    pub(crate) fn find(&self, number: usize) -> Option<Player> {
        if let Some((_, player)) = self.bots.get(number) {
            return Some(player.clone());
        }
        let kept = self.snapshots.iter().find(|(snapshot, _)| self.number(*snapshot) == number);
        kept.map(|(_, snapshot)| snapshot.player())
    }

    /// Takes the first snapshot, if there is none yet.
    pub(crate) fn begin(&mut self, learner: &dyn Learner) {
        if self.state.steps.is_empty() {
            self.add(0, Snapshot::of(learner));
        }
    }

    fn add(&mut self, step: u64, snapshot: Snapshot) {
        self.snapshots.push((self.state.steps.len(), snapshot));
        self.state.steps.push(step);
    }

    /// Notes the results of the training episodes of a rollout, in order.
    pub(crate) fn note(&mut self, outcomes: impl IntoIterator<Item = MatchOutcome>) {
        self.state.recent.extend(outcomes);
        let surplus = self.state.recent.len().saturating_sub(RECENT);
        self.state.recent.drain(..surplus);
    }

    /// Takes a snapshot of the policy if one is due after so many steps, `playing` being the numbers of those that play in
    /// episodes that still run, and rates it.
    ///
    /// # Errors
    ///
    /// [`TrainError`]: the game broke its contract in a match.
    pub(crate) fn after_update(
        &mut self,
        [before, step]: [u64; 2],
        is_done: bool,
        learner: &dyn Learner,
        playing: &[ArenaRivals],
    ) -> Result<(), TrainError> {
        let every = self.config.every.unwrap_or(u64::MAX);
        if before / every == step / every && !is_done {
            return Ok(());
        }
        self.add(step, Snapshot::of(learner));
        self.rate_newest()?;
        let all = self.state.steps.len();
        let config = &self.config;
        self.snapshots.retain(|(snapshot, _)| is_kept(*snapshot, all, config, playing));
        Ok(())
    }

    /// Plays the newest snapshot against all bots, and against those before it that are rivals.
    fn rate_newest(&mut self) -> Result<(), TrainError> {
        let Some((newest, snapshot)) = self.snapshots.last() else { return Ok(()) };
        let (one, player) = (self.number(*newest), snapshot.player());
        if self.rating.levels.is_empty() {
            return Ok(());
        }
        let first = newest.saturating_sub(pool_of(&self.config).max(1));
        let earlier = self.snapshots.iter().filter(|(number, _)| (first..*newest).contains(number));
        let earlier = earlier.map(|(number, snapshot)| (self.number(*number), snapshot.player()));
        let bots = self.bots.iter().enumerate().map(|(number, (_, player))| (number, player.clone()));
        let mut met = Vec::new();
        for (other, rival) in bots.chain(earlier) {
            let played = play_matches(&*self.seats[0], &player, &rival, &self.rating, |_| {});
            let played = played.map_err(|error| TrainError::Rivals(Box::new(error)))?;
            let count = |outcome| played.iter().filter(|it| it.outcome == outcome).count() as u64;
            let [wins, draws, losses] = [MatchOutcome::Win, MatchOutcome::Draw, MatchOutcome::Loss].map(count);
            met.push(Encounter { one, other, wins, draws, losses });
        }
        self.state.encounters.extend(met);
        Ok(())
    }

    /// Returns the steps at which the newest snapshot was taken.
    pub(crate) fn newest_step(&self) -> Option<u64> {
        self.state.steps.last().copied()
    }

    /// Returns the rating of the newest snapshot, if it has played a match.
    fn newest_rating(&self) -> Option<Rating> {
        self.ladder().members.into_iter().rfind(|member| member.step.is_some())?.rating
    }

    /// Returns the rating of the newest snapshot, if it was taken at this step and has played a match.
    pub(crate) fn rating_at(&self, step: u64) -> Option<f64> {
        if self.newest_step() == Some(step) { self.newest_rating().map(|rating| rating.elo) } else { None }
    }

    /// Returns the table of all rivals by their ratings.
    pub(crate) fn ladder(&self) -> Ladder {
        let bots: Vec<String> = self.bots.iter().map(|(name, _)| name.clone()).collect();
        let drawn = self.drawn().iter().map(|(snapshot, _)| *snapshot).collect::<Vec<_>>();
        ladder_of(&bots, self.config.rivals.len(), &self.state.steps, &drawn, &self.state.encounters)
    }

    /// Returns the metrics by their tags.
    pub(crate) fn scalars(&self) -> Vec<(&'static str, f64)> {
        let recent = &self.state.recent;
        let share = |outcome| recent.iter().filter(|it| **it == outcome).count() as f64 / recent.len() as f64;
        let mut scalars = vec![("self_play/snapshots", self.state.steps.len() as f64)];
        if !recent.is_empty() {
            scalars.push((WIN_RATE, share(MatchOutcome::Win)));
            scalars.push((DRAW_RATE, share(MatchOutcome::Draw)));
        }
        // The first snapshot is not rated before there is another one.
        if let Some(Rating { elo, error }) = self.newest_rating().filter(|it| it.error > 0.0) {
            scalars.extend([(ELO, elo), ("self_play/elo_error", error)]);
        }
        scalars
    }

    // Checkpoints.

    /// Returns what a checkpoint keeps besides policies, `arenas` being the rivals of each arena.
    pub(crate) fn state(&self, arenas: Vec<ArenaRivals>) -> SelfPlayState {
        SelfPlayState { arenas, ..self.state.clone() }
    }

    /// Writes the policies of all snapshots that a checkpoint of this state needs into its folder.
    ///
    /// # Errors
    ///
    /// [`FileError`].
    pub(crate) fn save(
        &self,
        folder: &Path,
        state: Option<&SelfPlayState>,
        observation_config: &ObservationConfig,
        algorithm: &str,
    ) -> Result<(), FileError> {
        let (all, playing) = (self.state.steps.len(), state.map_or(&[][..], |state| &state.arenas));
        let kept = self.snapshots.iter().filter(|(it, _)| is_kept(*it, all, &self.config, playing));
        for (number, snapshot) in kept {
            let step = self.state.steps.get(*number).copied().unwrap_or_default();
            let (game, seen) = (&*self.seats[0], observation_config);
            let metadata = PolicyMetadata {
                game: game.name().to_owned(),
                game_version: game.version(),
                observations: game.observation().names,
                picture: seen.picture_metadata(),
                actions: game.tools().input.action_names(),
                algorithm: algorithm.to_owned(),
                training: format!("snapshot of a training by self-play, at step {step}"),
                seen: None,
                code: format!("playbot {}", env!("CARGO_PKG_VERSION")),
            };
            let Snapshot { policy, skills } = snapshot.clone();
            let file = PolicyFile { metadata, policy, skills };
            let obs = Observations::zeros(&file.policy.observation(), 1);
            file.save(&snapshot_file(folder, *number), &obs, &vec![0.0; file.policy.latent()], 1)?;
        }
        Ok(())
    }

    /// Goes on from a checkpoint, whose policies were read by [`read_snapshots`]. Returns the rivals of each arena.
    pub(crate) fn restore(&mut self, mut state: SelfPlayState, snapshots: Vec<(usize, Snapshot)>) -> Vec<ArenaRivals> {
        let arenas = std::mem::take(&mut state.arenas);
        (self.state, self.snapshots) = (state, snapshots);
        arenas
    }
}

/// Returns the file of a snapshot in the folder of a checkpoint.
fn snapshot_file(folder: &Path, snapshot: usize) -> PathBuf {
    folder.join(format!("snapshot-{snapshot:04}.policy"))
}

/// Reads the policies of the snapshots that a checkpoint of this state needs: those that may be drawn, and those that
/// play in episodes that still run.
///
/// # Errors
///
/// [`FileError`]: one of them is missing or damaged.
pub(crate) fn read_snapshots(
    folder: &Path,
    config: &SelfPlayConfig,
    state: &SelfPlayState,
    device: DeviceKind,
) -> Result<Vec<(usize, Snapshot)>, FileError> {
    let all = state.steps.len();
    let read = |number| {
        let PolicyFile { policy, skills, .. } = PolicyFile::load(&snapshot_file(folder, number), device)?;
        Ok((number, Snapshot { policy, skills }))
    };
    (0..all).filter(|number| is_kept(*number, all, config, &state.arenas)).map(read).collect()
}

/// Returns the number of snapshots that are drawn.
fn pool_of(config: &SelfPlayConfig) -> usize {
    usize::try_from(config.pool).unwrap_or(usize::MAX)
}

/// Returns whether a snapshot, of so many, may be drawn or is the newest one, or plays in an episode that still runs.
fn is_kept(snapshot: usize, all: usize, config: &SelfPlayConfig, arenas: &[ArenaRivals]) -> bool {
    let number = config.bots().count() + snapshot;
    snapshot.saturating_add(pool_of(config).max(1)) >= all || arenas.iter().any(|arena| arena.needs(number))
}
