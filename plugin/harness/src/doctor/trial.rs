//! One comparison: copies of the game that play the same actions, tick by tick.

use crate::{
    doctor::{
        ComparisonReport, DifferenceKind, DoctorComparison, DoctorDifference,
        cause::likelihood,
        compare::{Comparer, rank},
        game_copy::{Detour, GameCopy, KnownTypes, Outcome, Plan, VARIANTS, add_archetypes, add_wall_clock},
        observed::ObservationMonitor,
    },
    game::Game,
    parallel::on_threads,
    saved_episode::SavedEpisode,
    worlds::is_bound_to_its_thread,
};
use std::collections::BTreeSet;

/// Most differences of a comparison that are kept, one for each field.
const MOST_DIFFERENCES: usize = 24;

/// Times that the ticks of a comparison are multiplied with, at most, to end an episode in which state differs and no
/// agent has noticed it yet.
const LONGER: u32 = 4;

/// Least ticks that a copy plays on with other actions, before it returns by a snapshot.
const DETOUR: u32 = 40;

/// Ticks after which a game that has saved no snapshot is taken to have none.
const WITHOUT_SNAPSHOT: u32 = 64;

/// Copies of a game that are compared.
pub(super) struct Trial<'a> {
    /// The report without results.
    planned: ComparisonReport,
    game: &'a dyn Game,
    /// The copies. The observations of the first one are monitored.
    pub copies: Vec<GameCopy>,
    /// Indices of the copies that are compared with each other.
    pairs: Vec<(usize, usize)>,
    /// Number of the last copies that are ticked on threads of their own.
    on_threads: usize,
    /// Returns by a snapshot, of the second copy.
    returns: u32,
    /// The tick whose snapshot could not be loaded.
    not_loaded: Option<u32>,
}

impl<'a> Trial<'a> {
    /// Builds the copies.
    pub fn new(planned: ComparisonReport, game: &'a dyn Game, plan: &Plan, ticks: u32) -> Self {
        let comparison = planned.comparison;
        // Agents that share an arena play together.
        let together = game.tools().host.agents_per_arena().max(1);
        let one = |number: u32| GameCopy::new(game, plan, number, together);
        let (mut copies, pairs) = match comparison {
            DoctorComparison::Repeat
            | DoctorComparison::Clock
            | DoctorComparison::Restart
            | DoctorComparison::Snapshots
            | DoctorComparison::OtherLevel => (vec![one(0), one(0)], vec![(0, 1)]),
            DoctorComparison::Archetypes => {
                ((0..=VARIANTS).map(|_| one(0)).collect(), (1..=VARIANTS as usize).map(|right| (0, right)).collect())
            }
            DoctorComparison::Threads => (vec![one(0), one(0), one(0)], vec![(0, 1), (0, 2)]),
            DoctorComparison::Arenas => (vec![one(0), one(1), GameCopy::new(game, plan, 0, 2)], vec![(0, 2), (1, 2)]),
        };
        match comparison {
            // Both get the same resource and systems, so that they differ in the clock alone.
            DoctorComparison::Clock => {
                copies.iter_mut().zip([false, true]).for_each(|(copy, slow)| add_wall_clock(&mut copy.world, slow));
            }
            DoctorComparison::Archetypes => {
                copies.iter_mut().zip(0..).for_each(|(copy, count)| add_archetypes(&mut copy.world, count));
            }
            DoctorComparison::Snapshots => {
                copies.iter_mut().for_each(|copy| SavedEpisode::prepare(game, &mut copy.world));
            }
            DoctorComparison::Restart | DoctorComparison::OtherLevel => copies[1].play_prelude(plan, ticks),
            _ => {}
        }
        let on_threads = if comparison == DoctorComparison::Threads { 2 } else { 0 };
        Self { planned, game, copies, pairs, on_threads, returns: 0, not_loaded: None }
    }

    /// Plays, and compares after every tick. State is compared until an agent notices a difference, and if none does,
    /// to the end of the episode.
    pub fn run(
        &mut self,
        ticks: u32,
        known_types: &mut KnownTypes,
        left_out: &LeftOut,
        monitors: &mut [ObservationMonitor],
    ) -> TrialResult {
        let mut report = self.planned.clone();
        let mut incomparable = Default::default();
        if self.on_threads > 0 && is_bound_to_its_thread(&self.copies[0].world) {
            let why = "the game has data for one thread alone (Bevy's non-send data), so its Worlds are not shared out";
            report.skipped = Some(why.to_owned());
            return TrialResult { report, incomparable };
        }
        let mut is_over = true;
        let mut all: Vec<DoctorDifference> = Vec::new();
        for tick in 0..ticks.saturating_mul(LONGER) {
            let is_undecided = !all.is_empty() && report.effect.is_none() && !is_over;
            if tick >= ticks && !is_undecided {
                break;
            }
            if self.planned.comparison == DoctorComparison::Snapshots && !self.return_by_snapshot(tick) {
                break;
            }
            self.tick();
            for (agent, monitor) in monitors.iter_mut().enumerate().filter(|_| tick < ticks) {
                let seen = self.copies[0].outcome(agent);
                // A copy with a fault may have ended before it observed anything in this tick.
                if self.copies[0].fault.is_none() || !seen.observation.is_empty() {
                    monitor.note(tick, &seen);
                }
            }
            report.fault = self.copies.iter().find_map(|copy| copy.fault.clone());
            if report.fault.is_some() {
                break;
            }
            report.ticks += 1;
            report.episodes += u32::from(is_over);
            is_over = self.copies[0].end(0).is_some();
            self.copies.iter().for_each(|copy| known_types.learn(&copy.world));
            if report.effect.is_none() && all.len() < MOST_DIFFERENCES {
                let (comparison, ignored) = (self.planned.comparison, left_out.ignored);
                let mut comparer = Comparer { known_types, comparison, ignored, incomparable };
                self.compare(tick, &mut comparer, left_out, &mut report, &mut all);
                incomparable = comparer.incomparable;
            }
            if report.effect.is_none() {
                let mut pairs = self.pairs.iter();
                report.effect = pairs.find_map(|&(left, right)| effect(&self.copies[left], &self.copies[right], tick));
            }
        }
        if self.planned.comparison == DoctorComparison::Archetypes && report.effect.is_none() {
            all.clear();
        }
        if self.planned.comparison == DoctorComparison::Snapshots && report.same() == Some(true) {
            report.skipped = self.reason_without_snapshots(report.ticks);
            if report.skipped.is_some() {
                all.clear();
            }
        }
        // A later difference is not the cause of an earlier one.
        all.sort_by_key(|of| (of.tick, likelihood(self.planned.comparison, of), rank(self.planned.comparison, of)));
        let mut all = all.into_iter();
        (report.first, report.others) = (all.next(), all.collect());
        TrialResult { report, incomparable }
    }

    /// Lets the second copy leave the episode and return to it by a snapshot, in ticks that are powers of two. Returns
    /// false if nothing is left to compare, because the game saves no snapshot or cannot load one.
    fn return_by_snapshot(&mut self, tick: u32) -> bool {
        if tick.is_power_of_two() {
            // Later detours are longer, so that some of them go on to the end of the episode.
            match self.copies[1].make_detour(self.game, tick.max(DETOUR)) {
                Detour::Made => self.returns += 1,
                Detour::NotSaved => {}
                Detour::NotLoaded => self.not_loaded = Some(tick),
            }
        }
        self.not_loaded.is_none() && (self.returns > 0 || tick < WITHOUT_SNAPSHOT)
    }

    /// Returns why no snapshot was compared, if none was.
    fn reason_without_snapshots(&self, ticks: u32) -> Option<String> {
        let why = match self.not_loaded {
            Some(tick) => format!("the snapshot before tick {tick} could not be loaded"),
            None => format!("no snapshot was saved in {ticks} ticks"),
        };
        let obstacle = self.game.tools().snapshots.obstacle(&self.copies[1].world);
        let why = obstacle.map_or_else(|| why.clone(), |obstacle| format!("{why} ({obstacle})"));
        (self.returns == 0).then(|| format!("{why}, so explorers return by replays"))
    }

    fn tick(&mut self) {
        let here = self.copies.len() - self.on_threads;
        let (here, threaded) = self.copies.split_at_mut(here);
        here.iter_mut().for_each(GameCopy::tick);
        on_threads(threaded, self.on_threads, GameCopy::tick);
    }

    /// Adds the differences of this tick in fields that did not differ before.
    fn compare(
        &self,
        tick: u32,
        comparer: &mut Comparer,
        left_out: &LeftOut,
        report: &mut ComparisonReport,
        all: &mut Vec<DoctorDifference>,
    ) {
        for &(left, right) in &self.pairs {
            let found = comparer.compare(&self.copies[left], &self.copies[right], tick);
            report.unmatched = report.unmatched.max(found.unmatched);
            for difference in found.differences {
                let is_known = all.iter().any(|known| known.has_field_of(&difference));
                if !is_known && !left_out.noted.contains(&difference.name) && all.len() < MOST_DIFFERENCES {
                    all.push(difference);
                }
            }
        }
    }
}

/// State that a comparison leaves out.
pub(super) struct LeftOut<'a> {
    /// Parts of type paths that the user ignores.
    pub ignored: &'a [String],
    /// Types that differ in two equal copies already, and that no agent noticed there.
    pub noted: BTreeSet<String>,
}

impl DoctorDifference {
    /// Returns whether both are in the same field of the same type.
    pub(super) fn has_field_of(&self, other: &Self) -> bool {
        (self.kind, &self.name, &self.field) == (other.kind, &other.name, &other.field)
    }
}

/// The result of a trial.
pub(super) struct TrialResult {
    pub report: ComparisonReport,
    /// Types of fields that could not be compared.
    pub incomparable: BTreeSet<String>,
}

/// Returns the first difference in the observation, reward or end of one of the left copy's agents and its double on the
/// right.
fn effect(left: &GameCopy, right: &GameCopy, tick: u32) -> Option<DoctorDifference> {
    (0..left.agents.len()).find_map(|agent| effect_on(agent, left, right, tick))
}

fn effect_on(agent: usize, left: &GameCopy, right: &GameCopy, tick: u32) -> Option<DoctorDifference> {
    let number = left.number(agent);
    let double = (0..right.agents.len()).find(|&agent| right.number(agent) == number)?;
    let differs = |kind, name: &str, left: String, right: String| {
        let (name, entity, field) = (name.to_owned(), Some(format!("agent {number}")), String::new());
        DoctorDifference { tick, kind, name, entity, field, left, right, value_type: String::new() }
    };
    first_of_outcomes(&left.outcome(agent), &right.outcome(double), &left.observed_names(), differs)
}

/// Returns the first difference of two outcomes, made with `differs`.
fn first_of_outcomes(
    a: &Outcome,
    b: &Outcome,
    names: &[String],
    differs: impl Fn(DifferenceKind, &str, String, String) -> DoctorDifference,
) -> Option<DoctorDifference> {
    let differs = |kind, name: &str, left, right| Some(differs(kind, name, left, right));
    let same = |a: &f32, b: &f32| a.to_bits() == b.to_bits();
    if let Some(at) = a.observation.iter().zip(&b.observation).position(|(a, b)| !same(a, b)) {
        let name = names.get(at).cloned().unwrap_or_else(|| format!("value {at}"));
        let (left, right) = (a.observation[at].to_string(), b.observation[at].to_string());
        return differs(DifferenceKind::Observation, &name, left, right);
    }
    let (left, right) = (a.observation.len(), b.observation.len());
    if left != right {
        return differs(DifferenceKind::Observation, "number of values", left.to_string(), right.to_string());
    }
    if let Some(at) = (a.image != b.image).then(|| a.image.iter().zip(&b.image).position(|(a, b)| a != b)) {
        let byte = |image: &[u8]| at.and_then(|at| image.get(at)).map_or("none".to_owned(), u8::to_string);
        return differs(DifferenceKind::Observation, "image", byte(&a.image), byte(&b.image));
    }
    if !same(&a.reward, &b.reward) {
        return differs(DifferenceKind::Reward, "reward", a.reward.to_string(), b.reward.to_string());
    }
    if a.end != b.end {
        return differs(DifferenceKind::End, "end of the episode", format!("{:?}", a.end), format!("{:?}", b.end));
    }
    let hash = |hash: u64| format!("{hash:016x}");
    if a.hash == b.hash { None } else { differs(DifferenceKind::StateHash, "state hash", hash(a.hash), hash(b.hash)) }
}
