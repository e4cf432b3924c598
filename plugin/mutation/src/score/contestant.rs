//! The testers that are scored, the clocks of their jobs, and the detectors that they share.

use bevy_playbot::{
    action::{ActionSpace, ActionValue, MixedSpace},
    bot::BlindBot,
    episode::EpisodeResult,
    vision::ObservationConfig,
};
use playbot_harness::{
    eval::{CHAOS, Player, blind_bots, scripted_bots},
    game::Game,
};
use playbot_test::{
    detectors::{Detectors, LevelDefect, LevelDetector, ShownBy, TestedLevel},
    explore::Explorer,
};
use serde::{Deserialize, Serialize};
use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Instant,
};

/// Name of the bot with random actions.
pub const RANDOM: &str = "random";

/// Name of the bot that holds an action.
pub const HOLD: &str = "hold";

/// Name of the explorer without skills.
pub const EXPLORE: &str = "explore";

/// Name of the explorer with a skill model or a policy.
pub const EXPLORE_SKILLS: &str = "explore-skills";

/// A tester of one game.
#[derive(Clone)]
pub struct Contestant {
    /// The tester as files store it.
    pub record: ContestantRecord,
    /// The means of testing.
    pub means: Means,
    /// Observation of a policy; bots have vectors.
    pub observation_config: ObservationConfig,
}

/// The means of testing.
#[derive(Clone)]
#[allow(clippy::large_enum_variant, reason = "a few per measurement")]
pub enum Means {
    /// Plays episodes.
    Plays(Player),
    /// Explores. Some of the paths that it finds are replayed under the detectors.
    Explores(Explorer),
}

/// A tester, as files store it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ContestantRecord {
    /// Its name, unique within the game. Testers of several games with the same name are counted together.
    pub name: String,
    /// Checksum of the tester's file, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checksum: Option<String>,
    /// True if a policy takes its most probable action instead of drawing one.
    #[serde(default)]
    pub greedy: bool,
    /// True if it acts with learned skills.
    pub skilled: bool,
}

impl ContestantRecord {
    /// Creates a tester without a file and without skills.
    pub fn bot(name: impl Into<String>) -> Self {
        Self { name: name.into(), checksum: None, greedy: false, skilled: false }
    }
}

impl Contestant {
    /// Returns the game's bots and the explorer without skills: [`RANDOM`], [`HOLD`], [`CHAOS`], [`EXPLORE`] and, under
    /// their own names, the [`scripted_bots`].
    pub fn defaults(game: &dyn Game) -> Vec<Self> {
        let bots = blind_bots(game);
        let is_constant = |bot: &BlindBot| matches!(bot, BlindBot::Constant(_));
        let constant = bots.into_iter().map(|(_, bot)| bot).find(is_constant);
        let hold = constant.unwrap_or_else(|| BlindBot::Constant(last_action(game)));
        let mut all = vec![
            Self::bot(RANDOM, Player::Blind(BlindBot::Uniform)),
            Self::bot(HOLD, Player::Blind(hold)),
            Self::bot(CHAOS, Player::Blind(BlindBot::Chaos)),
            Self::of(ContestantRecord::bot(EXPLORE), Means::Explores(Explorer::Random)),
        ];
        all.extend(scripted_bots(game).into_iter().map(|(name, player)| Self::bot(name, player)));
        all
    }

    /// Creates a tester from a bot of the game.
    pub fn bot(name: &str, player: Player) -> Self {
        Self::of(ContestantRecord::bot(name), Means::Plays(player))
    }

    /// Creates a tester with vectors as observations.
    pub fn of(record: ContestantRecord, means: Means) -> Self {
        Self { record, means, observation_config: ObservationConfig::default() }
    }
}

/// Returns the last of the discrete actions or of the options of each choice, with all numbers at their highest.
fn last_action(game: &dyn Game) -> ActionValue {
    let space = game.actions();
    let highest: Vec<u32> = space.choices().sizes().iter().map(|size| size.saturating_sub(1)).collect();
    match space {
        ActionSpace::Discrete(count) => ActionValue::Discrete(count.saturating_sub(1) as u32),
        ActionSpace::Continuous(count) => ActionValue::Continuous(vec![1.0; count]),
        ActionSpace::Mixed(MixedSpace { numbers, .. }) => {
            ActionValue::Mixed { choices: highest, numbers: vec![1.0; numbers] }
        }
    }
}

// Clocks for the time of jobs.

/// The clock that jobs are timed with. It is no part of the other results.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClockKind {
    /// CPU time of the job's thread, as the system counts it.
    ThreadCpu,
    /// Wall time, which includes whatever else the machine does.
    Wall,
}

impl ClockKind {
    /// Returns CPU time where the system reports it, else wall time.
    pub fn here() -> Self {
        if thread_cpu_seconds().is_some() { Self::ThreadCpu } else { Self::Wall }
    }

    /// Returns the clock's name for reports.
    pub fn describe(self) -> &'static str {
        match self {
            Self::ThreadCpu => "CPU time of the job's thread",
            Self::Wall => "wall time of the job's thread",
        }
    }
}

/// Measures a job from its start, on its own thread.
pub(super) struct JobClock {
    kind: ClockKind,
    cpu: f64,
    begun: Instant,
    charges: Charges,
}

impl JobClock {
    pub fn start(kind: ClockKind, charges: &Charges) -> Self {
        let charges = Arc::clone(charges);
        Self { kind, cpu: thread_cpu_seconds().unwrap_or(0.0), begun: Instant::now(), charges }
    }

    /// Returns the seconds since the start, to the microsecond, with those of work that was taken over.
    pub fn seconds(&self) -> f64 {
        self.own_seconds() + self.charges.load(Ordering::Relaxed) as f64 / 1e6
    }

    fn own_seconds(&self) -> f64 {
        let wall = || self.begun.elapsed().as_secs_f64();
        let seconds = match self.kind {
            ClockKind::ThreadCpu => thread_cpu_seconds().map_or_else(wall, |cpu| cpu - self.cpu),
            ClockKind::Wall => wall(),
        };
        (seconds * 1e6).round() / 1e6
    }
}

// Work that the testers of a subject share.

/// Microseconds of work that a job has taken over from another job.
pub(super) type Charges = Arc<AtomicU64>;

/// The findings of a detector in a subject, once they are known, and the microseconds that they took.
type KnownDefects = Arc<Mutex<Option<(Vec<LevelDefect>, u64)>>>;

/// What is known of a subject, for all of its jobs: an entry for each detector of levels. Findings that do not depend on
/// the tester are computed in the job that needs them first. Each further job takes them over, and is charged with the
/// time that they took, as if it had computed them.
pub(super) struct KnownSubject(Vec<KnownDefects>);

impl KnownSubject {
    pub fn new(detectors: &Detectors) -> Self {
        Self(detectors.levels.iter().map(|_| KnownDefects::default()).collect())
    }
}

/// The detectors of a job.
pub(super) struct JobDetectors {
    /// The detectors.
    pub detectors: Detectors,
    /// The charges for work that was taken over.
    pub charges: Charges,
}

impl JobDetectors {
    pub fn new(detectors: &Detectors, clock: ClockKind, KnownSubject(known): &KnownSubject) -> Self {
        let (mut detectors, charges) = (detectors.clone(), Charges::default());
        for (detector, known) in detectors.levels.iter_mut().zip(known) {
            if !detector.depends_on_testers() {
                let (own, charges, known) = (Arc::clone(detector), Arc::clone(&charges), Arc::clone(known));
                *detector = Arc::new(SharedDetector { own, clock, charges, known });
            }
        }
        Self { detectors, charges }
    }
}

/// A detector that inspects a subject once.
struct SharedDetector {
    own: Arc<dyn LevelDetector>,
    clock: ClockKind,
    charges: Charges,
    known: KnownDefects,
}

impl LevelDetector for SharedDetector {
    fn name(&self) -> &'static str {
        self.own.name()
    }

    fn describe(&self) -> &'static str {
        self.own.describe()
    }

    fn depends_on_testers(&self) -> bool {
        false
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let waiting = JobClock::start(self.clock, &Charges::default());
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((defects, microseconds)) = &*known {
            // The job's clock has counted the time for which another job computed them.
            let waited = microseconds_of(&waiting);
            self.charges.fetch_add(microseconds.saturating_sub(waited), Ordering::Relaxed);
            return defects.clone();
        }
        let clock = JobClock::start(self.clock, &Charges::default());
        let defects = self.own.inspect(level);
        *known = Some((defects.clone(), microseconds_of(&clock)));
        defects
    }

    fn shown_by(&self) -> ShownBy {
        self.own.shown_by()
    }

    fn is_in_level(&self, game: &dyn Game, mode: &str, level: u64) -> bool {
        self.own.is_in_level(game, mode, level)
    }

    fn is_in_episode(&self, result: &EpisodeResult, tick: Option<u32>) -> bool {
        self.own.is_in_episode(result, tick)
    }
}

fn microseconds_of(clock: &JobClock) -> u64 {
    (clock.seconds() * 1e6).round() as u64
}

/// Returns the CPU time of this thread since it started. The first number of the file is in nanoseconds.
#[cfg(target_os = "linux")]
fn thread_cpu_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: u64 = text.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds as f64 / 1e9)
}

#[cfg(not(target_os = "linux"))]
fn thread_cpu_seconds() -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use bevy::prelude::{App, KeyCode};
    use playbot_corridor::Corridor;
    use playbot_harness::foreign::ForeignGame;

    use super::*;

    #[test]
    fn a_game_without_a_bot_that_holds_an_action_holds_its_last() {
        let all = Contestant::defaults(&Corridor::default());
        let names: Vec<&str> = all.iter().map(|contestant| contestant.record.name.as_str()).collect();
        assert_eq!(names, [RANDOM, HOLD, CHAOS, EXPLORE, "guide"]);
        let hold = BlindBot::Constant(ActionValue::Discrete(2));
        assert!(matches!(&all[1].means, Means::Plays(Player::Blind(bot)) if *bot == hold));
        assert!(matches!(all[3].means, Means::Explores(Explorer::Random)));
        assert!(all.iter().all(|contestant| !contestant.record.skilled));
    }

    #[test]
    fn scripted_bots_test_by_names_that_no_other_tester_has() {
        let game = ForeignGame::new("mole", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .demonstrator("digger", || 1)
            .bot("idler", || 0)
            .bot("pacer", |mut ticks: bevy::prelude::Local<u32>| {
                *ticks += 1;
                *ticks % 2
            });
        let all = Contestant::defaults(&game);
        let names: Vec<&str> = all.iter().map(|contestant| contestant.record.name.as_str()).collect();
        assert_eq!(names, [RANDOM, HOLD, CHAOS, EXPLORE, "digger", "idler", "pacer"]);
        assert!(matches!(&all[5].means, Means::Plays(Player::Scripted("idler"))));
        for name in [RANDOM, HOLD, CHAOS, EXPLORE, EXPLORE_SKILLS] {
            assert!(game.clone().bot(name, || 0).problem().is_some(), "{name}");
        }
    }

    #[test]
    fn work_takes_time_by_either_clock() {
        for kind in [ClockKind::here(), ClockKind::Wall] {
            let clock = JobClock::start(kind, &Charges::default());
            let mut number = 1_u64;
            // Longer than the system takes to update its count.
            while clock.begun.elapsed().as_millis() < 50 {
                number = number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            }
            assert!(clock.seconds() > 0.0 && clock.seconds() < 600.0, "{number}");
        }
    }
}
