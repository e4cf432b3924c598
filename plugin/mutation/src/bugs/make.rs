//! The planting of defects into the games of a program.

#[cfg(test)]
mod tests;

use crate::bugs::{
    BugError, defect_kinds,
    mutant::{Mutant, plant_level},
    set::{BugGame, BugSet, PlantedBug, PlantedPart, UnmutatedLevels, level_path},
};
use bevy_playbot::{bot::BlindBot, episode::EpisodeEnd, level::LevelFile};
use playbot_harness::{
    defect::{DefectKind, Plant},
    eval::{EpisodeResult, EvalPlan, Player, blind_bots, evaluate, scripted_bots},
    game::Game,
    held_out::HeldOut,
    parallel::on_threads,
    split::LevelSplit,
};
use playbot_learner::{
    Streams,
    rng::{ChaCha8Rng, below, shuffle},
};
use playbot_report::counted;
use playbot_test::findings::{Replayed, course_of, keeps_course};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, PoisonError},
};

/// Unmutated levels that defects are planted into, for each mutant of a kind; also the least number of them.
const BASES_PER_MUTANT: u64 = 4;

const FEWEST_BASES: u64 = 24;

/// Plants every kind of defect into every game. The same seed gives the same set, for any number of threads. Each
/// mutant depends on the seed, its game, class and number alone.
///
/// A defect of a game's own rules is planted on a level where it changes some bot's episode. That is the episode of a
/// scripted bot of the game, of a bot that holds an action, of chaos or of random actions. `progress` receives how many more
/// unmutated levels were found, and how many of those mutants have their level.
///
/// # Errors
///
/// A game has too few levels that its demonstrator solves, panics in one, or cannot print them.
pub fn make_bugs(sources: &[Source], plan: &MakePlan, progress: &(dyn Fn(u64) + Sync)) -> Result<Made, BugError> {
    let set = BugSet { seed: plan.seed, games: Vec::new(), mutants: Vec::new(), sound: Vec::new() };
    let mut made = Made { set, levels: Vec::new(), without_place: Vec::new() };
    for (n, source) in sources.iter().enumerate() {
        let (game, mode) = (source.game, source.levels.mode.as_str());
        game.check_mode(mode)?;
        let share = plan.share(n, sources.len());
        let wanted = share + plan.bases();
        let levels = sound_levels(source, start(source, plan, wanted), wanted, plan.threads, progress)?;
        let (beside, bases) = levels.split_at(usize::try_from(share).unwrap_or(usize::MAX).min(levels.len()));
        made.set.games.push(BugGame { name: game.name().to_owned(), version: game.version() });
        made.set.sound.extend(ranges(game.name(), mode, beside));
        let noticed = bases_with_effect(game, (mode, bases), &game.tools().tests.defects(), plan, progress);
        for kind in defect_kinds(game) {
            plant(&mut made, game, (mode, bases), &kind, &noticed, plan)?;
        }
    }
    Ok(made)
}

/// A game that defects are planted into.
#[derive(Clone)]
pub struct Source<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Its levels.
    pub levels: LevelSplit,
    /// Levels that are left out, since bots train on them.
    pub trained: Option<LevelSplit>,
}

/// The number of defects, and the random seed.
#[derive(Clone, Copy, Debug)]
pub struct MakePlan {
    /// Random seed of everything.
    pub seed: u64,
    /// Mutants of each kind and game.
    pub per_kind: u32,
    /// Unmutated levels of all games together.
    pub sound: u64,
    /// Threads. They change no result.
    pub threads: usize,
}

/// The result of planting.
#[derive(Clone, Debug)]
pub struct Made {
    /// The set.
    pub set: BugSet,
    /// Texts of the levels that a defect was planted into, by the names of their mutants.
    pub levels: Vec<(String, String)>,
    /// Kinds of defects that no level, or not enough levels, have a place for, and those without an effect.
    pub without_place: Vec<MissingMutants>,
}

/// A kind of defect that not enough levels have a place for, or with a variant that changes nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingMutants {
    /// The game.
    pub game: String,
    /// The class of the defect.
    pub class: String,
    /// Number of planted ones.
    pub planted: u32,
    /// Number of requested ones.
    pub wanted: u32,
    /// Variants, of a defect of rules, that change nothing on any level that was tried.
    pub without_effect: BTreeSet<u32>,
}

impl MissingMutants {
    /// Returns a message that says how many are missing, and why.
    pub fn describe(&self) -> String {
        let Self { game, class, planted, wanted, without_effect } = self;
        let start = format!(
            "{game}: only {planted} of {} with the defect {class} were made",
            counted(u64::from(*wanted), "mutant")
        );
        if without_effect.is_empty() {
            return format!("{start}: no other level has a place for it");
        }
        let variants: Vec<String> = without_effect.iter().map(u32::to_string).collect();
        format!("{start}: no bot notices its variant {} on any of {MOST_TRIED} levels", variants.join(", "))
    }
}

impl MakePlan {
    /// Returns the steps for a progress bar: unmutated levels to find, and mutants to find a level for, in all of these
    /// games.
    pub fn steps(&self, sources: &[Source]) -> u64 {
        let rules = |source: &Source| {
            let kinds = source.game.tools().tests.defects();
            kinds.iter().filter(|kind| matches!(kind.plant, Plant::Rules { .. })).count() as u64
        };
        let mutants: u64 = sources.iter().map(|source| rules(source) * u64::from(self.per_kind)).sum();
        self.sound + sources.len() as u64 * self.bases() + mutants
    }

    fn bases(&self) -> u64 {
        (BASES_PER_MUTANT * u64::from(self.per_kind)).max(FEWEST_BASES)
    }

    /// Returns the number of unmutated levels of the n-th game.
    fn share(&self, n: usize, games: usize) -> u64 {
        let (games, n) = (games.max(1) as u64, n as u64);
        self.sound / games + u64::from(n < self.sound % games)
    }
}

/// Returns the number of the first level to try.
fn start(source: &Source, plan: &MakePlan, wanted: u64) -> u64 {
    let LevelSplit { first, last, .. } = source.levels;
    let mut rng = Streams::new(plan.seed).stream(&format!("{}/levels", source.game.name()), 0);
    // Some of the levels that follow are not solved.
    first + below(&mut rng, (last - first + 1).saturating_sub(4 * wanted))
}

/// Plants all mutants of a kind. Mutants of rules in `noticed` have their levels already.
fn plant(
    made: &mut Made,
    game: &dyn Game,
    (mode, bases): (&str, &[u64]),
    kind: &DefectKind,
    noticed: &Bases,
    plan: &MakePlan,
) -> Result<(), BugError> {
    let (mut taken, mut without_effect) = (BTreeSet::new(), BTreeSet::new());
    let mut planted = 0;
    for number in 0..plan.per_kind {
        let id = format!("{}-{}-{planted:02}", game.name(), kind.class);
        let mut rng = stream(plan.seed, game, kind, number);
        let (level, part) = match &kind.plant {
            Plant::Rules { variants, .. } => {
                let variant = number % (*variants).max(1);
                let base = match noticed.get(&(kind.class, number)) {
                    Some(Some(base)) => *base,
                    Some(None) => {
                        without_effect.insert(variant);
                        continue;
                    }
                    None => bases[below(&mut rng, bases.len() as u64) as usize],
                };
                (base, PlantedPart::Rules { variant })
            }
            Plant::Level(change) => {
                match plant_level(game, kind.class, (mode, bases), &**change, &mut rng, &mut taken)? {
                    None => continue,
                    Some(broken) => {
                        let file = LevelFile { path: level_path(&id), hash: broken.hash };
                        made.levels.push((id.clone(), broken.text));
                        (broken.base, PlantedPart::Level(file))
                    }
                }
            }
        };
        planted += 1;
        made.set.mutants.push(PlantedBug {
            id,
            game: game.name().to_owned(),
            class: kind.class.to_owned(),
            about: kind.about.to_owned(),
            mode: mode.to_owned(),
            level,
            planted: part,
        });
    }
    if planted < plan.per_kind {
        let (game, class) = (game.name().to_owned(), kind.class.to_owned());
        made.without_place.push(MissingMutants { game, class, planted, wanted: plan.per_kind, without_effect });
    }
    Ok(())
}

// Levels on which a defect of rules has an effect.

/// Unmutated levels that are tried for each mutant.
pub(super) const MOST_TRIED: usize = 20;

/// Episodes of each bot that draws random numbers.
const SEEDS: u64 = 3;

/// The unmutated level of each mutant, by class and number; `None` if its variant changes nothing on any level that was
/// tried.
pub(super) type Bases = BTreeMap<(&'static str, u32), Option<u64>>;

/// Finds an unmutated level on which a bot notices each mutant of the rules among these kinds. A broken wall that no
/// bot walks into is no defect of that level. The levels are tried in a random order of the mutant's own. `progress` is
/// called for each mutant.
pub(super) fn bases_with_effect(
    game: &dyn Game,
    (mode, bases): (&str, &[u64]),
    kinds: &[DefectKind],
    plan: &MakePlan,
    progress: &(dyn Fn(u64) + Sync),
) -> Bases {
    let mut jobs: Vec<(&DefectKind, u32, u32)> = Vec::new();
    for kind in kinds {
        if let Plant::Rules { variants, .. } = &kind.plant {
            let variants = (*variants).max(1);
            jobs.extend((0..variants.min(plan.per_kind)).map(|variant| (kind, variant, variants)));
        }
    }
    let sound = SoundCourses::of(game, mode);
    let found = on_threads(&mut jobs, plan.threads, |job| {
        let (kind, variant, variants) = *job;
        let mut known = BTreeMap::new();
        let mut found = Vec::new();
        for number in (variant..plan.per_kind).step_by(variants as usize) {
            let mut order = bases.to_vec();
            shuffle(&mut order, &mut stream(plan.seed, game, kind, number));
            let is_noticed = |base: &u64| *known.entry(*base).or_insert_with(|| sound.are_left(kind, variant, *base));
            found.push(((kind.class, number), order.into_iter().take(MOST_TRIED).find(is_noticed)));
            progress(1);
        }
        found
    });
    found.into_iter().flatten().collect()
}

/// Returns the variants of a game's own defects of rules that change no bot's episode on any of these levels, by their
/// class and number. A test of own defects expects that there are no such variants. The bots are those of [`make_bugs`].
pub fn without_effect(game: &dyn Game, levels: &LevelSplit, threads: usize) -> Vec<(&'static str, u32)> {
    let sound = SoundCourses::of(game, &levels.mode);
    let mut jobs: Vec<(DefectKind, u32)> = Vec::new();
    for kind in game.tools().tests.defects() {
        if let Plant::Rules { variants, .. } = kind.plant {
            jobs.extend((0..variants).map(|variant| (kind.clone(), variant)));
        }
    }
    let are_silent = on_threads(&mut jobs, threads, |(kind, variant)| {
        let mutant = Mutant::new(game, kind, *variant);
        // The most sensitive bot plays all levels before the next one does.
        let mut bots = 0..sound.bots.len();
        !bots.any(|bot| levels.levels().any(|level| sound.is_left(&mutant, bot, level)))
    });
    let silent = jobs.into_iter().zip(are_silent).filter(|(_, is_silent)| *is_silent);
    silent.map(|((kind, variant), _)| (kind.class, variant)).collect()
}

/// Returns the random numbers of a mutant.
pub(super) fn stream(seed: u64, game: &dyn Game, kind: &DefectKind, number: u32) -> ChaCha8Rng {
    Streams::new(seed).stream(&format!("{}/{}", game.name(), kind.class), u64::from(number))
}

/// The episodes of some bots in the unmutated game.
struct SoundCourses<'a> {
    game: &'a dyn Game,
    mode: &'a str,
    /// Bots with the seeds of their episodes, the most sensitive first.
    bots: Vec<(Player, u64)>,
    /// Episodes that were played, by level and bot.
    played: Mutex<BTreeMap<(u64, usize), Arc<Replayed>>>,
}

impl<'a> SoundCourses<'a> {
    fn of(game: &'a dyn Game, mode: &'a str) -> Self {
        let is_constant = |bot: &BlindBot| matches!(bot, BlindBot::Constant(_));
        let constant = blind_bots(game).into_iter().map(|(_, bot)| bot).find(is_constant);
        let mut bots: Vec<(Player, u64)> = Vec::new();
        bots.extend(scripted_bots(game).into_iter().map(|(_, player)| (player, 0)));
        bots.extend(constant.map(|bot| (Player::Blind(bot), 0)));
        for seed in 0..SEEDS {
            bots.extend([BlindBot::Chaos, BlindBot::Uniform].map(|bot| (Player::Blind(bot), seed)));
        }
        Self { game, mode, bots, played: Mutex::default() }
    }

    /// Returns whether some bot's episode differs with the defect.
    fn are_left(&self, kind: &DefectKind, variant: u32, level: u64) -> bool {
        let mutant = Mutant::new(self.game, kind, variant);
        (0..self.bots.len()).any(|bot| self.is_left(&mutant, bot, level))
    }

    /// Returns whether the episode of this bot differs in the mutant.
    fn is_left(&self, mutant: &Mutant<&dyn Game>, bot: usize, level: u64) -> bool {
        let (player, seed) = &self.bots[bot];
        !keeps_course(mutant, (self.mode, level), *seed, player, &self.course(bot, level))
    }

    fn course(&self, number: usize, level: u64) -> Arc<Replayed> {
        let known = self.played.lock().unwrap_or_else(PoisonError::into_inner).get(&(level, number)).cloned();
        if let Some(course) = known {
            return course;
        }
        // Two threads may play the same episode; the result is equal.
        let (bot, seed) = &self.bots[number];
        let course = Arc::new(course_of(self.game, (self.mode, level), *seed, bot));
        self.played.lock().unwrap_or_else(PoisonError::into_inner).insert((level, number), Arc::clone(&course));
        course
    }
}

// The search for unmutated levels: to plant defects into, and to compare with.

/// Most levels and most arenas that are played at a time. They do not depend on the number of threads, so that it
/// changes no result.
const CHUNK: u64 = 128;

const ARENAS: u32 = 32;

/// The search gives up after this many times the levels that are needed.
const MOST_TRIES: u64 = 8;

/// The best end that a demonstrator can reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GoodEnd {
    /// The level is solved.
    Won,
    /// The time limit was reached, in a game that cannot be won.
    Lasted,
    /// Any end, in a game that always ends by losing.
    Any,
}

impl GoodEnd {
    /// Returns the best end among some episodes.
    fn of(results: &[EpisodeResult]) -> Self {
        if results.iter().any(|result| result.success) {
            Self::Won
        } else if results.iter().any(|result| result.end == EpisodeEnd::Truncated) {
            Self::Lasted
        } else {
            Self::Any
        }
    }

    fn is(self, result: &EpisodeResult) -> bool {
        match self {
            Self::Won => result.success,
            Self::Lasted => result.end == EpisodeEnd::Truncated,
            Self::Any => true,
        }
    }
}

/// Returns `wanted` levels from this number on, in their order. They are held out from training, and the game's
/// demonstrator, if there is one, plays them to a good end.
pub(super) fn sound_levels(
    source: &Source,
    start: u64,
    wanted: u64,
    threads: usize,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Vec<u64>, BugError> {
    let game = source.game;
    let trained = source.trained.as_ref().map(|trained| HeldOut::new(game, trained));
    let is_new = |level: &u64| trained.as_ref().is_none_or(|trained| !trained.contains(&source.levels.mode, *level));
    let (mut found, mut good_end) = (Vec::new(), None);
    let (mut next, mut tried) = (start, 0);
    while (found.len() as u64) < wanted && next <= source.levels.last && tried < MOST_TRIES * wanted.max(CHUNK) {
        let missing = wanted - found.len() as u64;
        let count = (missing + missing / 4 + 4).min(CHUNK).min(source.levels.last - next + 1);
        let chunk = LevelSplit { mode: source.levels.mode.clone(), first: next, last: next + count - 1 };
        let good: Vec<u64> = match game.tools().bots.demonstrator() {
            None => chunk.levels().filter(is_new).collect(),
            Some(_) => {
                let results = play(source, &chunk, threads)?;
                let end = *good_end.get_or_insert_with(|| GoodEnd::of(&results));
                results.iter().filter(|result| end.is(result)).map(|result| result.level).filter(is_new).collect()
            }
        };
        let before = found.len();
        found.extend(good);
        found.truncate(usize::try_from(wanted).unwrap_or(usize::MAX));
        progress((found.len() - before) as u64);
        next += count;
        tried += count;
    }
    if found.is_empty() {
        let bot = game.tools().bots.demonstrator().unwrap_or("none").to_owned();
        return Err(BugError::NoBase { game: game.name().to_owned(), levels: source.levels.to_string(), bot });
    }
    if (found.len() as u64) < wanted {
        let (levels, count) = (source.levels.to_string(), found.len() as u64);
        return Err(BugError::TooFewLevels { game: game.name().to_owned(), levels, count, wanted });
    }
    Ok(found)
}

fn play(source: &Source, chunk: &LevelSplit, threads: usize) -> Result<Vec<EpisodeResult>, BugError> {
    let plan = EvalPlan::of_bot(chunk.clone(), ARENAS, threads);
    Ok(evaluate(source.game, &Player::Demonstrator, &plan, |_| {})?)
}

/// Groups ordered numbers into ranges without gaps.
pub(super) fn ranges(game: &str, mode: &str, numbers: &[u64]) -> Vec<UnmutatedLevels> {
    let ranges = LevelSplit::ranges(mode, numbers).into_iter();
    ranges.map(|range| UnmutatedLevels { game: game.to_owned(), range }).collect()
}

#[cfg(test)]
mod effect_tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use bevy::prelude::*;
    use bevy_playbot::{agent::Control, episode::Episode};
    use playbot_harness::foreign::ForeignGame;

    use super::*;
    use crate::bugs::general::testing::Track;

    /// Variant 0 changes nothing. Variant 1 ends episodes on even levels after ten ticks, variant 2 behind the end.
    fn late() -> DefectKind {
        DefectKind::rules("late", "episodes end on even levels", 3, |app, variant| {
            let Some(last) = [None, Some(10), Some(1000)][variant as usize] else { return };
            app.add_systems(FixedUpdate, move |mut agents: Query<(&Control, &mut Episode)>| {
                for (control, mut episode) in &mut agents {
                    let is_playing = control.is_active() && episode.is_running() && episode.end().is_none();
                    if is_playing && episode.level.is_multiple_of(2) && episode.tick >= last {
                        episode.truncate();
                    }
                }
            });
        })
    }

    #[test]
    fn each_mutant_has_a_level_on_which_it_changes_something_or_none() {
        let plan = |threads| MakePlan { seed: 3, per_kind: 6, sound: 0, threads };
        let levels: Vec<u64> = (100..112).collect();
        let heard = AtomicU64::new(0);
        let find = |threads| {
            let progress = |count: u64| {
                heard.fetch_add(count, Ordering::Relaxed);
            };
            bases_with_effect(&Track, ("plain", &levels), &[late()], &plan(threads), &progress)
        };
        let found = find(1);
        assert_eq!(heard.load(Ordering::Relaxed), 6);
        assert_eq!(found, find(3), "on any number of threads");
        let of = |number: u32| found[&("late", number)];
        assert_eq!([0, 2, 3, 5].map(of), [None; 4], "nothing changes");
        for number in [1, 4] {
            assert!(of(number).is_some_and(|base| base.is_multiple_of(2)), "{found:?}");
        }
        let none = DefectKind::level("nowhere", "no defect of rules", |_, _| None);
        assert!(bases_with_effect(&Track, ("plain", &levels), &[none], &plan(1), &|_| {}).is_empty());
    }

    /// Turns of a lock, which A and B open by turns. Other keys lock it again.
    #[derive(Resource, Default)]
    struct Lock(u32);

    #[test]
    fn a_defect_that_only_a_scripted_bot_of_the_game_notices_has_a_level() {
        let turn = |keys: Res<ButtonInput<KeyCode>>, mut lock: ResMut<Lock>| {
            let next = [KeyCode::KeyA, KeyCode::KeyB][lock.0 as usize % 2];
            lock.0 = if keys.pressed(next) { lock.0 + 1 } else { 0 };
        };
        let game =
            ForeignGame::new("lock", 1, move |app: &mut App| _ = app.init_resource::<Lock>().add_systems(Update, turn))
                .keys([vec![], vec![KeyCode::KeyA], vec![KeyCode::KeyB]])
                .observe(["turns"], |lock: Res<Lock>| [lock.0 as f32])
                .time_limit(30)
                .level(|mut lock: ResMut<Lock>| lock.0 = 0);
        // No other bot comes so far.
        let jammed = DefectKind::rules("jammed", "the lock jams", 1, |app, _| {
            app.add_systems(PostUpdate, |mut lock: ResMut<Lock>| lock.0 = lock.0.min(25));
        });
        let plan = MakePlan { seed: 3, per_kind: 1, sound: 0, threads: 2 };
        let base = |game: &ForeignGame| {
            bases_with_effect(game, ("default", &[7, 8]), std::slice::from_ref(&jammed), &plan, &|_| {})[&("jammed", 0)]
        };
        assert_eq!(base(&game), None);
        assert!(base(&game.bot("opener", |lock: Res<Lock>| 1 + lock.0 % 2)).is_some());
    }
}

#[cfg(test)]
mod sound_tests {
    use super::*;

    #[test]
    fn numbers_become_ranges_without_gaps() {
        let ranges: Vec<_> =
            ranges("a", "hard", &[3, 4, 5, 7, 9, 10]).iter().map(|sound| sound.range.to_string()).collect();
        assert_eq!(ranges, ["hard:3..5", "hard:7..7", "hard:9..10"]);
        assert!(super::ranges("a", "hard", &[]).is_empty());
    }

    #[test]
    fn a_good_end_is_the_best_that_there_is() {
        let result = |end: EpisodeEnd| EpisodeResult {
            level: 0,
            end,
            success: end.is_success(),
            ticks: 9,
            clipped: 0,
            total_reward: 0.0,
        };
        let [won, lost, out] = [EpisodeEnd::WON, EpisodeEnd::LOST, EpisodeEnd::Truncated].map(result);
        assert_eq!(GoodEnd::of(&[won, lost, out]), GoodEnd::Won);
        assert_eq!(GoodEnd::of(&[lost, out]), GoodEnd::Lasted);
        assert_eq!(GoodEnd::of(&[lost]), GoodEnd::Any);
        assert!(GoodEnd::Lasted.is(&out) && !GoodEnd::Lasted.is(&lost) && GoodEnd::Any.is(&lost));
    }
}
