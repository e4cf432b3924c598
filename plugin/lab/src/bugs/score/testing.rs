//! A small game and hand-made scores for tests.

use bevy::prelude::*;

use super::{
    clock::ClockKind,
    contestant::ContestantRecord,
    found::{Found, ScoredJob},
    job::JobResult,
    record::{GameRecord, SCORE_FORMAT, ScoreBudget, ScoreRecord, SetRecord},
    subject::{Subject, SubjectKind},
};
use crate::{
    defect::DefectKind,
    game::level_designs,
    level_files::{LevelDesign, LevelDesigns, LevelTextError, is_level_files},
    prelude::*,
    proof::LevelProof,
};

/// Ticks of an episode.
const LIMIT: u32 = 30;
/// Where the corridor ends.
const END: i32 = 6;

/// What is wrong with the corridor.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Rule {
    #[default]
    Sound,
    /// Panics one cell before the exit.
    Panics,
    /// Logs an error there.
    Logs,
    /// The exit leads nowhere.
    NoExit,
}

/// A corridor of 7 cells, from the one in the middle on: action 1 goes right, 0 left, 2 stays. The exit is at the right end,
/// or in the cell that a level file names, which may be out of reach; the left end loses.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Corridor {
    pub rule: Rule,
}

#[derive(Component, Default)]
struct Place(i32);

/// The actions that lead to the exit.
pub(crate) fn to_the_goal() -> Vec<ActionValue> {
    vec![ActionValue::Discrete(1); 3]
}

fn walk(
    mut agents: Query<(&Action, &Control, &mut Place, &mut Reward, &mut Episode, &mut StateHash)>,
    rule: Res<Rule>,
    designs: Option<Res<LevelDesigns>>,
) {
    for (action, control, mut place, mut reward, mut episode, mut hash) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let goal = designs.as_ref().and_then(|it| it.get::<i32>(episode.level).ok()).map_or(END, |goal| *goal);
        place.0 = (place.0 + [-1, 1, 0][action.discrete().unwrap_or(2) as usize]).min(END);
        hash.0 = place.0 as u64;
        match *rule {
            Rule::Panics => assert!(place.0 < END - 1, "the corridor burns"),
            Rule::Logs if place.0 == END - 1 => tracing::error!(target: "corridor", "it is dark"),
            _ => {}
        }
        if place.0 == goal && *rule != Rule::NoExit {
            reward.add(1.0);
            episode.terminate(true);
        } else if place.0 == 0 {
            episode.terminate(false);
        } else if episode.tick + 1 >= LIMIT {
            episode.truncate();
        }
    }
}

impl Game for Corridor {
    fn name(&self) -> &'static str {
        "corridor"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &["plain"]
    }

    fn tick_hz(&self) -> f64 {
        10.0
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(3)
    }

    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: vec!["place".into()] }
    }

    fn parse_level(&self, text: &str) -> Result<LevelDesign, LevelTextError> {
        let goal: i32 = text.trim().parse().map_err(|_| LevelTextError::whole("no number".to_owned()))?;
        Ok(LevelDesign::new(goal, &goal.to_string()))
    }

    fn prove(&self, mode: &str, level: u64) -> LevelProof {
        let designs = is_level_files(mode).then(|| level_designs(self, mode).ok()).flatten();
        let goal = designs.and_then(|designs| designs.get::<i32>(level).ok()).map_or(END, |goal| *goal);
        let why = "the exit is behind the wall".to_owned();
        if goal > END { LevelProof::Unsolvable { why } } else { LevelProof::Unknown }
    }

    fn defects(&self) -> Vec<DefectKind> {
        let rule = |class, rule: Rule| {
            DefectKind::rules(class, "it is broken", 1, move |app, _| {
                app.insert_resource(rule);
            })
        };
        vec![rule("burns", Rule::Panics), rule("no-exit", Rule::NoExit)]
    }

    fn demonstrator(&self) -> Option<&'static str> {
        Some("guide")
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, _noise: f64) {
        world.entity_mut(agent).insert(BlindBot::Constant(ActionValue::Discrete(1)));
    }

    fn build(&self, app: &mut App, _mode: &str) {
        app.insert_resource(self.rule)
            .add_observer(|event: On<StartEpisode>, mut places: Query<&mut Place>| {
                if let Ok(mut place) = places.get_mut(event.entity) {
                    place.0 = END / 2;
                }
            })
            .add_systems(ObserveSchedule, |mut agents: Query<(&Place, &mut Observation)>| {
                agents.iter_mut().for_each(|(place, mut seen)| seen.set([place.0 as f32 / END as f32]));
            })
            .add_systems(FixedUpdate, walk);
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        world.spawn((Agent::new(index, self.actions()), VectorSensor::new(["place"]), Place::default())).id()
    }
}

/// A mutant of a game.
pub(super) fn mutant(game: &str, id: &str, class: &str) -> Subject {
    let kind = SubjectKind::Mutant { class: class.to_owned(), original: format!("{game} bed:0") };
    Subject { id: id.to_owned(), game: game.to_owned(), kind }
}

/// A sound level of a game.
pub(super) fn sound(game: &str, level: u64) -> Subject {
    let id = Subject::id_of_level(game, "bed", level);
    Subject { id, game: game.to_owned(), kind: SubjectKind::Sound }
}

/// A job of one second, in which a detector found something or not.
pub(super) fn job(subject: &str, tester: &str, detected: bool) -> ScoredJob {
    let result = JobResult {
        subject: subject.to_owned(),
        tester: tester.to_owned(),
        episodes: 1,
        seconds: 1.0,
        ..JobResult::default()
    };
    ScoredJob { result, found: Found { detected, ..Found::default() }, first: detected.then_some(0.5) }
}

/// What was scored of a game by these testers; those whose names begin with `skill` have skills.
pub(super) fn record(game: &str, testers: &[&str]) -> ScoreRecord {
    let tester = |name: &&str| ContestantRecord { skilled: name.starts_with("skill"), ..ContestantRecord::bot(*name) };
    let testers = testers.iter().map(tester).collect();
    let (detectors, own_detectors) = (vec!["stuck ticks=9".to_owned()], vec!["weeds".to_owned()]);
    let game = GameRecord { name: game.to_owned(), version: 1, testers, detectors, own_detectors };
    ScoreRecord {
        format: SCORE_FORMAT,
        set: SetRecord { seed: 7, hash: "0f".to_owned() },
        games: vec![game],
        budget: ScoreBudget::default(),
        clock: ClockKind::Wall,
    }
}
