//! Tests of the planting of defects.

use crate::bugs::make::*;
use bevy::prelude::*;
use playbot_harness::{
    game::{BotTools, LevelTools, TestTools},
    inspect::{InspectError, LevelRequest, LevelView},
    level_files::{LevelDesign, LevelTextError},
    prelude::*,
};
use std::{fs, path::Path};

/// A game whose levels are the distance to the goal. Its own bot runs there, and each third level is too far for it.
struct Dash;

/// Steps to the goal.
#[derive(Component, Default)]
struct Left(u64);

/// The game's own bot.
#[derive(Component)]
struct Runner;

fn distance(level: u64) -> u64 {
    if level.is_multiple_of(3) { 90 } else { 2 + level % 4 }
}

impl Game for Dash {
    fn name(&self) -> &'static str {
        "dash"
    }

    fn version(&self) -> u32 {
        3
    }

    fn modes(&self) -> &'static [&'static str] {
        &["default"]
    }

    fn tick_hz(&self) -> f64 {
        60.0
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(2)
    }

    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: vec!["left".into()] }
    }

    fn build(&self, app: &mut App, _mode: &str) {
        app.add_observer(|event: On<StartEpisode>, mut lefts: Query<&mut Left>| {
            if let Ok(mut left) = lefts.get_mut(event.entity) {
                left.0 = distance(event.level);
            }
        })
        .add_systems(ObserveSchedule, |mut agents: Query<(&Left, &mut Observation)>| {
            agents.iter_mut().for_each(|(left, mut seen)| seen.set([left.0 as f32]));
        })
        .add_systems(
            FixedPreUpdate,
            (|mut bots: Query<&mut Action, With<Runner>>| {
                bots.iter_mut().for_each(|mut action| action.0 = ActionValue::Discrete(1));
            })
            .in_set(PlaybotSystems::Decide),
        )
        .add_systems(FixedUpdate, |mut agents: Query<(&Control, &Action, &mut Left, &mut Episode)>| {
            for (control, action, mut left, mut episode) in &mut agents {
                if !control.is_active() || !episode.is_running() {
                    continue;
                }
                left.0 = left.0.saturating_sub(u64::from(action.discrete() == Some(1)));
                if left.0 == 0 {
                    episode.terminate(true);
                } else if episode.tick >= 8 {
                    episode.truncate();
                }
            }
        });
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        world.spawn((Agent::new(index, self.actions()), VectorSensor::new(["left"]), Left::default())).id()
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { levels: self, bots: self, tests: self, ..GameTools::default() }
    }
}

impl LevelTools for Dash {
    fn show(&self, request: &LevelRequest) -> Option<Result<LevelView, InspectError>> {
        let json = distance(request.level.unwrap_or(0)).to_string();
        Some(Ok(LevelView { text: json.clone(), json, lacks_plan: false, picture: None }))
    }

    fn parse(&self, text: &str) -> Option<Result<LevelDesign, LevelTextError>> {
        let number = text.trim().parse::<u64>();
        let design = number.map(|number| LevelDesign::new(number, &number.to_string()));
        Some(design.map_err(|_| LevelTextError { line: Some(1), what: "no number".into() }))
    }
}

impl BotTools for Dash {
    fn demonstrator(&self) -> Option<&'static str> {
        Some("runner")
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, _noise: f64) {
        world.entity_mut(agent).insert(Runner);
    }
}

impl TestTools for Dash {
    fn defects(&self) -> Vec<DefectKind> {
        vec![
            DefectKind::level("too-far", "the goal is too far", |text, rng| {
                let number = text.trim().parse::<u64>().ok()?;
                (number > 2).then(|| (number + 100 + below(rng, 1000)).to_string())
            }),
            DefectKind::level("no-place", "there is no place for it", |_, _| None),
            DefectKind::level("the-same", "nothing is changed", |text, _| Some(format!(" {text}"))),
            DefectKind::rules("seldom", "some levels end before they begin, in variant 0 none", 3, |app, variant| {
                app.add_systems(FixedUpdate, move |mut agents: Query<(&Control, &mut Episode)>| {
                    for (control, mut episode) in &mut agents {
                        let is_here = variant > 0 && episode.level % 4 == u64::from(variant);
                        if is_here && control.is_active() && episode.is_running() && episode.end().is_none() {
                            episode.truncate();
                        }
                    }
                });
            }),
        ]
    }
}

fn source() -> Source<'static> {
    let split = |text: &str| text.parse::<LevelSplit>().expect("a split");
    Source { game: &Dash, levels: split("default:1000..1999"), trained: Some(split("default:0..63")) }
}

fn plan(seed: u64) -> MakePlan {
    MakePlan { seed, per_kind: 3, sound: 10, threads: 2 }
}

fn make(plan: &MakePlan) -> Made {
    make_bugs(&[source()], plan, &|_| {}).expect("there are levels")
}

fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    for at in [folder.to_owned(), folder.join("levels")] {
        for entry in fs::read_dir(at).expect("a folder").map(|entry| entry.expect("readable").path()) {
            if entry.is_file() {
                let name = entry.file_name().expect("a name").to_string_lossy().into_owned();
                found.push((name, fs::read(&entry).expect("readable")));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_kind_is_planted_into_levels_that_the_bot_solves() {
    let Made { set, levels, without_place } = make(&plan(7));
    assert_eq!(set.games, [BugGame { name: "dash".to_owned(), version: 3 }]);
    let kinds = defect_kinds(&Dash).len();
    assert_eq!(set.mutants.len(), 3 * (kinds - 2) - 1);
    let missing = |class: &str, planted, without_effect: &[u32]| MissingMutants {
        game: "dash".into(),
        class: class.into(),
        planted,
        wanted: 3,
        without_effect: without_effect.iter().copied().collect(),
    };
    let few = [missing("no-place", 0, &[]), missing("the-same", 0, &[]), missing("seldom", 2, &[0])];
    assert_eq!(without_place, few);
    assert!(
        few[0]
            .describe()
            .ends_with("only 0 of 3 mutants with the defect no-place were made: no other level has a place for it")
    );
    assert!(few[2].describe().ends_with("no bot notices its variant 0 on any of 20 levels"));
    let seldom: Vec<_> = set.mutants.iter().filter(|bug| bug.class == "seldom").collect();
    assert_eq!(seldom.iter().map(|bug| bug.id.as_str()).collect::<Vec<_>>(), ["dash-seldom-00", "dash-seldom-01"]);
    assert_eq!(seldom[0].planted, PlantedPart::Rules { variant: 1 });
    assert!(seldom[0].level % 4 == 1 && seldom[1].level % 4 == 2, "it changes nothing elsewhere: {seldom:?}");
    assert_eq!(levels.len(), 3);
    let beside: Vec<u64> = set.sound.iter().flat_map(|sound| sound.range.levels()).collect();
    assert_eq!(beside.len(), 10);
    let bases = set.mutants.iter().map(|bug| bug.level);
    for level in bases.clone().chain(beside.iter().copied()) {
        assert!((1000..2000).contains(&level) && !level.is_multiple_of(3), "{level} is not solved");
    }
    assert!(bases.into_iter().all(|base| !beside.contains(&base)), "sound levels are others");
    let variants: Vec<_> = set.mutants.iter().filter(|bug| bug.class == "panic").map(|bug| &bug.planted).collect();
    let expected = [0, 1, 2].map(|variant| PlantedPart::Rules { variant });
    assert!(variants.into_iter().eq(&expected));
}

#[test]
fn variants_that_no_bot_notices_are_named() {
    let levels = |text: &str| text.parse::<LevelSplit>().expect("a split");
    // Level 1001 is one after a multiple of 4, and level 1002 two.
    for threads in [1, 3] {
        assert_eq!(without_effect(&Dash, &levels("default:1001..1002"), threads), [("seldom", 0)]);
    }
    assert_eq!(without_effect(&Dash, &levels("default:1002..1002"), 1), [("seldom", 0), ("seldom", 1)]);
}

#[test]
fn the_same_seed_makes_the_same_files_and_another_one_others() {
    let write = |plan: &MakePlan| {
        let folder = tempfile::tempdir().expect("a folder");
        let made = make(plan);
        made.set.write(folder.path(), &made.levels, false).expect("written");
        assert_eq!(BugSet::read(folder.path()).expect("read back"), made.set);
        made.set.check(folder.path(), &Dash).expect("sound");
        let files = files(folder.path());
        fs::write(folder.path().join("levels/dash-too-far-00.json"), "7").expect("writable");
        let words = made.set.check(folder.path(), &Dash).expect_err("another level").to_string();
        assert!(
            words.contains("dash-too-far-00.json") && words.contains("was changed after it was planted"),
            "{words}"
        );
        files
    };
    let first = write(&plan(7));
    assert_eq!(first, write(&MakePlan { threads: 1, ..plan(7) }));
    assert_ne!(first, write(&plan(8)));
}

#[test]
fn too_few_levels_are_named() {
    let few = Source { levels: "default:1000..1009".parse().expect("a split"), ..source() };
    let words = make_bugs(&[few], &plan(0), &|_| {}).expect_err("ten levels").to_string();
    assert!(words.contains("default:1000..1009 has") && words.contains("--levels dash=MODE:first..last"), "{words}");
    let trained = Some("default:1000..1999".parse().expect("a split"));
    let words = make_bugs(&[Source { trained, ..source() }], &plan(0), &|_| {}).expect_err("all trained").to_string();
    assert!(words.contains("none of the levels"), "{words}");
}
