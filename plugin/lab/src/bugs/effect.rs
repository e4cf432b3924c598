//! Levels on which a defect of rules has an effect: a broken wall that no bot walks into is no defect of that level.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use bevy_playbot::bot::BlindBot;
use playbot_learner::{Streams, rng::ChaCha8Rng, rng::shuffle};

use super::{make::MakePlan, mutant::Mutant};
use crate::{
    defect::{DefectKind, Plant},
    eval::{Player, blind_bots},
    findings::{Replayed, course_of, keeps_course},
    game::Game,
    parallel::on_threads,
};

/// Unmutated levels that are tried for each mutant.
pub(super) const MOST_TRIED: usize = 20;
/// Episodes of each bot that draws random numbers.
const SEEDS: u64 = 3;

/// The unmutated level of each mutant, by class and number; `None` if its variant changes nothing on any level that was
/// tried.
pub(super) type Bases = BTreeMap<(&'static str, u32), Option<u64>>;

/// Finds an unmutated level on which a bot notices each mutant of the rules among these kinds. The levels are tried in
/// a random order of the mutant's own. `progress` is called for each mutant.
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
        bots.extend(game.tools().bots.demonstrator().map(|_| (Player::Demonstrator, 0)));
        bots.extend(constant.map(|bot| (Player::Blind(bot), 0)));
        for seed in 0..SEEDS {
            bots.extend([BlindBot::Chaos, BlindBot::Uniform].map(|bot| (Player::Blind(bot), seed)));
        }
        Self { game, mode, bots, played: Mutex::default() }
    }

    /// Returns whether some bot's episode differs with the defect.
    fn are_left(&self, kind: &DefectKind, variant: u32, level: u64) -> bool {
        let mutant = Mutant::new(self.game, kind, variant);
        self.bots.iter().enumerate().any(|(number, (bot, seed))| {
            !keeps_course(&mutant, (self.mode, level), *seed, bot, &self.course(number, level))
        })
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use bevy::prelude::*;
    use bevy_playbot::{control::Control, episode::Episode};

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
}
