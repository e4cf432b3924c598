//! Maps and visits of a level from the walks of all episodes.

use crate::verdict::{
    Finding, Places,
    maps::{EpisodePath, LevelMaps, PlanRows, SkillTicks, TesterEvents},
    played::{Played, PlayedEnd},
    walk::{LevelSquares, SkillName, Walk},
};
use bevy_playbot::{episode::EpisodeEnd, skill_prior::NamedSkill};
use playbot_harness::floor_plan::FloorPlan;
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
};

/// Visits and maps of a level.
pub(super) struct LevelVisits {
    /// Open squares that each tester visited, if known.
    pub testers: Vec<Option<Places>>,
    /// Events in the episodes of each tester.
    pub events: Vec<TesterEvents>,
    /// Open squares that any tester visited.
    pub places: Option<Places>,
    /// Maps of where they were.
    pub maps: LevelMaps,
}

/// Ticks in a square.
#[derive(Default)]
struct Sum {
    ticks: u64,
    lost: u64,
    skills: BTreeMap<SkillName, u64>,
}

impl LevelVisits {
    /// Sums up the walks in a level with this plan. `played` has the episodes of each tester, `names` the testers'
    /// names, and `regions` the named regions of their skills. `None` if positions are unknown.
    pub fn of(
        plan: &FloorPlan,
        names: &[&str],
        regions: &[&[NamedSkill]],
        played: &[&[Played]],
        findings: &[Finding],
    ) -> Option<Self> {
        let squares = LevelSquares::of(plan)?;
        let is_known = played.iter().any(|episodes| episodes.iter().any(|episode| episode.walk.is_some()));
        if !is_known {
            return None;
        }
        let open = squares.open(plan);
        let places = |visited: &BTreeSet<usize>| {
            open.as_ref()
                .map(|open| Places { visited: open.intersection(visited).count() as u64, open: open.len() as u64 })
        };
        let mut sums: BTreeMap<usize, Sum> = BTreeMap::new();
        let (mut testers, mut events) = (Vec::new(), Vec::new());
        for (tester, episodes) in played.iter().enumerate() {
            let regions = regions.get(tester).copied().unwrap_or_default();
            let (mut visited, mut lost) = (BTreeSet::new(), BTreeMap::<usize, u64>::new());
            let walks = episodes.iter().filter_map(|episode| episode.walk.as_ref());
            for walk in walks.filter(|walk| walk.squares == squares) {
                for count in &walk.counts {
                    visited.insert(count.square);
                    if count.lost > 0 {
                        *lost.entry(count.square).or_default() += u64::from(count.lost);
                    }
                    let sum = sums.entry(count.square).or_default();
                    sum.ticks += u64::from(count.ticks);
                    sum.lost += u64::from(count.lost);
                    for (skill, ticks) in &count.skills {
                        *sum.skills.entry(SkillName::of(regions, *skill)).or_default() += u64::from(*ticks);
                    }
                }
            }
            testers.push(places(&visited));
            events.push(TesterEvents {
                ends: ends(&squares, episodes),
                lost: lost.into_iter().map(|(square, ticks)| [square as u64, ticks]).collect(),
                visited: runs(&visited),
            });
        }
        let all = places(&sums.keys().copied().collect());
        let mut maps = maps(&squares, &sums);
        maps.failure = failure(names, played, findings);
        maps.best = best(names, played);
        maps.plan = Some(PlanRows::of(plan));
        Some(Self { testers, events, places: all, maps })
    }
}

/// Returns the squares in which episodes ended without the goal, with those that were lost and those whose time was up.
fn ends(squares: &LevelSquares, episodes: &[Played]) -> Vec<[u64; 3]> {
    let mut counts: BTreeMap<usize, [u64; 2]> = BTreeMap::new();
    for episode in episodes {
        let PlayedEnd::Ended { result, position: Some(position), .. } = &episode.end else { continue };
        if let Some(square) = squares.nearest(*position).filter(|_| !result.success) {
            counts.entry(square).or_default()[usize::from(result.end == EpisodeEnd::Truncated)] += 1;
        }
    }
    counts.into_iter().map(|(square, [lost, timed_out])| [square as u64, lost, timed_out]).collect()
}

/// Returns squares as runs of consecutive ones.
fn runs(squares: &BTreeSet<usize>) -> Vec<[u64; 2]> {
    let mut runs: Vec<[u64; 2]> = Vec::new();
    for square in squares.iter().map(|square| *square as u64) {
        match runs.last_mut() {
            Some([first, count]) if *first + *count == square => *count += 1,
            _ => runs.push([square, 1]),
        }
    }
    runs
}

/// Returns the path of the episode that reached the goal in the fewest ticks, the first of several.
fn best(names: &[&str], played: &[&[Played]]) -> Option<EpisodePath> {
    let mut best: Option<(u32, EpisodePath)> = None;
    for (tester, episodes) in names.iter().zip(played) {
        for (number, episode) in (0..).zip(episodes.iter()) {
            let PlayedEnd::Ended { result, .. } = &episode.end else { continue };
            let is_better = result.success && best.as_ref().is_none_or(|(least, _)| result.ticks < *least);
            if let Some(walk) = episode.walk.as_ref().filter(|_| is_better) {
                let path = EpisodePath { tester: (*tester).to_owned(), episode: number, path: walk.trail.clone() };
                best = Some((result.ticks, path));
            }
        }
    }
    best.map(|(_, path)| path)
}

fn maps(squares: &LevelSquares, sums: &BTreeMap<usize, Sum>) -> LevelMaps {
    let mut totals: BTreeMap<&SkillName, u64> = BTreeMap::new();
    for (skill, ticks) in sums.values().flat_map(|sum| &sum.skills) {
        *totals.entry(skill).or_default() += ticks;
    }
    let mut order: Vec<(&SkillName, u64)> = totals.into_iter().collect();
    // Of equally frequent ones the first stays first.
    order.sort_by_key(|(_, ticks)| Reverse(*ticks));
    let rank = |skill: &SkillName| order.iter().position(|(known, _)| *known == skill);
    let most = |sum: &Sum| {
        let most = sum.skills.iter().max_by_key(|(skill, ticks)| (**ticks, Reverse(*skill)));
        most.and_then(|(skill, _)| rank(skill))
    };
    let skill_at = sums.iter().filter_map(|(square, sum)| Some([*square as u64, most(sum)? as u64]));
    LevelMaps {
        x: squares.grid.origin.x,
        y: squares.grid.origin.y,
        side: squares.grid.size,
        columns: squares.columns as u64,
        rows: squares.rows as u64,
        visits: sums.iter().map(|(square, sum)| [*square as u64, sum.ticks]).collect(),
        lost: sums.iter().filter(|(_, sum)| sum.lost > 0).map(|(square, sum)| [*square as u64, sum.lost]).collect(),
        skill_at: skill_at.collect(),
        skills: order.iter().map(|(skill, ticks)| SkillTicks { skill: skill.to_string(), ticks: *ticks }).collect(),
        failure: None,
        best: None,
        plan: None,
    }
}

/// Returns the path to the first finding from play, or else the path of the first episode that failed.
fn failure(names: &[&str], played: &[&[Played]], findings: &[Finding]) -> Option<EpisodePath> {
    let path = |tester: usize, episode: usize| {
        let Walk { trail, .. } = played.get(tester)?.get(episode)?.walk.as_ref()?;
        let tester = (*names.get(tester)?).to_owned();
        Some(EpisodePath { tester, episode: u32::try_from(episode).ok()?, path: trail.clone() })
    };
    let found = findings.iter().find_map(|finding| {
        let tester = names.iter().position(|name| Some(*name) == finding.tester.as_deref())?;
        path(tester, finding.episode? as usize)
    });
    found.or_else(|| {
        let all = played.iter().enumerate().flat_map(|(tester, episodes)| {
            episodes.iter().enumerate().map(move |(number, episode)| (tester, number, episode))
        });
        all.filter(|(.., episode)| has_failed(episode)).find_map(|(tester, number, _)| path(tester, number))
    })
}

fn has_failed(episode: &Played) -> bool {
    match &episode.end {
        PlayedEnd::Ended { result, .. } => !result.success,
        PlayedEnd::Broken { .. } => true,
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::{Rect, Vec2};
    use bevy_playbot::episode::EpisodeResult;

    use super::*;
    use crate::verdict::{played::Track, walk::SquareCount};

    /// Makes a plan of four squares in a row and a wall.
    fn plan() -> FloorPlan {
        FloorPlan {
            bounds: Rect::new(0.0, 0.0, 5.0, 1.0),
            walls: vec![Rect::new(4.0, 0.0, 5.0, 1.0)],
            start: Vec2::splat(0.5),
            ..FloorPlan::default()
        }
    }

    /// Makes an episode with these squares, and the lost ticks and the skills of each.
    fn episode(success: bool, counts: &[(usize, u32, u32, &[(usize, u32)])]) -> Played {
        let end = EpisodeEnd::Terminated { success };
        let result = EpisodeResult { level: 0, end, success, ticks: 9, clipped: 0, total_reward: 0.0 };
        let squares = LevelSquares::of(&plan()).expect("it has an extent");
        let trail = counts.iter().map(|(square, ticks, ..)| [*square as u64, u64::from(*ticks)]).collect();
        let count = |(square, ticks, lost, skills): &(usize, u32, u32, &[(usize, u32)])| SquareCount {
            square: *square,
            ticks: *ticks,
            lost: *lost,
            skills: skills.to_vec(),
        };
        let walk = Some(Walk { squares, counts: counts.iter().map(count).collect(), trail });
        let end = PlayedEnd::Ended { result, position: None, cause: None };
        Played { end, exact: true, found: Vec::new(), walk, track: Track::default() }
    }

    #[test]
    fn walks_of_all_testers_are_added_up() {
        let one = [episode(true, &[(0, 2, 0, &[(3, 2)]), (1, 5, 1, &[(0, 2), (3, 3)])])];
        let other = [episode(false, &[(1, 1, 0, &[]), (2, 1, 1, &[(0, 1)]), (4, 1, 0, &[])])];
        let walked = LevelVisits::of(&plan(), &["a", "b"], &[], &[&one, &other], &[]).expect("walks are known");
        let places = |visited| Some(Places { visited, open: 4 });
        // Square 4 lies in the wall, so it is not an open square.
        assert_eq!((walked.testers, walked.places), (vec![places(2), places(2)], places(3)));
        let maps = walked.maps;
        assert_eq!(maps.visits, [[0, 2], [1, 6], [2, 1], [4, 1]]);
        assert_eq!(maps.lost, [[1, 1], [2, 1]]);
        assert_eq!((maps.columns, maps.rows, maps.side), (5, 1, 1.0));
        let skill = |skill: &str, ticks| SkillTicks { skill: skill.to_owned(), ticks };
        assert_eq!(maps.skills, [skill("z2-", 5), skill("z1+", 3)]);
        assert_eq!(maps.skill_at, [[0, 0], [1, 0], [2, 1]]);
        let failure = maps.failure.expect("one has failed");
        assert_eq!((failure.tester.as_str(), failure.episode), ("b", 0));
        assert_eq!(failure.path, [[1, 1], [2, 1], [4, 1]]);
        let best = maps.best.expect("one has solved it");
        assert_eq!((best.tester.as_str(), best.path), ("a", vec![[0, 2], [1, 5]]));
        assert_eq!(maps.plan.map(|plan| plan.rows).as_deref(), Some("G3.#"), "the goal is at 0, as is the start");
        let events = |ends, lost, visited| TesterEvents { ends, lost, visited };
        let none = Vec::new;
        assert_eq!(walked.events[0], events(none(), vec![[1, 1]], vec![[0, 2]]));
        assert_eq!(walked.events[1], events(none(), vec![[2, 1]], vec![[1, 2], [4, 1]]));
    }

    #[test]
    fn skills_of_one_name_are_added_up_whatever_their_numbers() {
        let region = |name: &str| NamedSkill { name: name.to_owned(), z: vec![0.0], radius: 0.5 };
        let (one, other) = ([region("jump")], [region("walk"), region("jump")]);
        let episodes =
            [[episode(true, &[(0, 3, 0, &[(0, 2), (1, 1)])])], [episode(true, &[(0, 9, 0, &[(1, 4), (2, 5)])])]];
        let played: Vec<&[Played]> = episodes.iter().map(|own| own.as_slice()).collect();
        let walked = LevelVisits::of(&plan(), &["a", "b"], &[&one, &other], &played, &[]).expect("walks are known");
        let skill = |skill: &str| SkillTicks { skill: skill.to_owned(), ticks: 6 };
        assert_eq!(walked.maps.skills, [skill("jump"), skill("z1+")]);
        assert_eq!(walked.maps.skill_at, [[0, 0]]);
    }

    #[test]
    fn events_are_those_of_each_tester_and_the_best_path_is_the_shortest() {
        let ended = |end: EpisodeEnd, success: bool, ticks: u32, at: f32, square: usize| {
            let result = EpisodeResult { level: 0, end, success, ticks, clipped: 0, total_reward: 0.0 };
            let end = PlayedEnd::Ended { result, position: Some(Vec2::new(at, 0.5)), cause: None };
            Played { end, ..episode(success, &[(square, 1, 0, &[])]) }
        };
        let dead = EpisodeEnd::Terminated { success: false };
        let one = [
            ended(dead, false, 3, 2.5, 2),
            ended(EpisodeEnd::Truncated, false, 9, 2.5, 2),
            ended(dead, false, 3, 1e9, 2),
            ended(EpisodeEnd::WON, true, 7, 3.5, 3),
        ];
        let other = [ended(EpisodeEnd::WON, true, 5, 3.5, 1), ended(EpisodeEnd::WON, true, 5, 3.5, 0)];
        let walked = LevelVisits::of(&plan(), &["a", "b"], &[], &[&one, &other], &[]).expect("walks are known");
        assert_eq!(walked.events[0].ends, [[2, 1, 1], [4, 1, 0]], "far away is at the border");
        assert!(walked.events[1].ends.is_empty(), "it has solved the level");
        let best = walked.maps.best.expect("it was solved");
        assert_eq!((best.tester.as_str(), best.episode, best.path), ("b", 0, vec![[1, 1]]));
        let lost = LevelVisits::of(&plan(), &["a"], &[], &[&one[..2]], &[]).expect("walks are known");
        assert_eq!(lost.maps.best, None);
    }

    #[test]
    fn the_way_to_a_finding_comes_before_that_of_a_failure() {
        let episodes = [episode(false, &[(0, 1, 0, &[])]), episode(true, &[(3, 1, 0, &[])])];
        let finding = Finding {
            detector: "stuck".to_owned(),
            tester: Some("a".to_owned()),
            episode: Some(1),
            tick: Some(3),
            message: String::new(),
            file: None,
            settings: Vec::new(),
        };
        let found =
            LevelVisits::of(&plan(), &["a"], &[], &[&episodes], &[finding]).and_then(|walked| walked.maps.failure);
        assert_eq!(found.map(|failure| (failure.episode, failure.path)), Some((1, vec![[3, 1]])));
        let solved = LevelVisits::of(&plan(), &["a"], &[], &[&episodes[1..]], &[]).expect("walks are known");
        assert_eq!(solved.maps.failure, None);
        let unknown = [Played { walk: None, ..episodes[0].clone() }];
        assert!(LevelVisits::of(&plan(), &["a"], &[], &[&unknown], &[]).is_none());
    }
}
