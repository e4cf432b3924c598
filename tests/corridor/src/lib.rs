//! A corridor with an exit, as a small game for the tests of several crates.

use bevy::prelude::*;
use playbot_harness::{
    defect::DefectKind,
    detector::LevelProof,
    game::{BotTools, LevelTools, TestTools, level_designs},
    level_files::{LevelDesign, LevelDesigns, LevelTextError, is_level_files},
    prelude::*,
};

/// Ticks of an episode.
const LIMIT: u32 = 30;

/// The exit's cell.
const END: i32 = 6;

/// The defect of the corridor.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// None.
    #[default]
    Sound,
    /// A panic one cell before the exit.
    Panics,
    /// An error in the log, in the same cell.
    Logs,
    /// An exit that leads nowhere.
    NoExit,
}

/// A corridor of 7 cells that starts in the middle: action 1 goes right, 0 left, 2 stays. The exit is at the right end,
/// or in the cell that a level file names, which may be out of reach. The left end loses.
#[derive(Clone, Copy, Debug, Default)]
pub struct Corridor {
    /// The defect.
    pub rule: Rule,
}

#[derive(Component, Default)]
struct Place(i32);

/// Returns the actions that lead to the exit.
pub fn to_the_goal() -> Vec<ActionValue> {
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

    fn tools(&self) -> GameTools<'_> {
        GameTools { levels: self, bots: self, tests: self, ..GameTools::default() }
    }
}

impl LevelTools for Corridor {
    fn parse(&self, text: &str) -> Option<Result<LevelDesign, LevelTextError>> {
        let design = text.trim().parse::<i32>().map(|goal| LevelDesign::new(goal, &goal.to_string()));
        Some(design.map_err(|_| LevelTextError::whole("no number".to_owned())))
    }

    fn prove(&self, mode: &str, level: u64) -> LevelProof {
        let designs = is_level_files(mode).then(|| level_designs(self, mode).ok()).flatten();
        let goal = designs.and_then(|designs| designs.get::<i32>(level).ok()).map_or(END, |goal| *goal);
        let why = "the exit is behind the wall".to_owned();
        if goal > END { LevelProof::Unsolvable { why } } else { LevelProof::Unknown }
    }
}

impl BotTools for Corridor {
    fn demonstrator(&self) -> Option<&'static str> {
        Some("guide")
    }

    fn attach_demonstrator(&self, world: &mut World, agent: Entity, _noise: f64) {
        world.entity_mut(agent).insert(BlindBot::Constant(ActionValue::Discrete(1)));
    }
}

impl TestTools for Corridor {
    fn defects(&self) -> Vec<DefectKind> {
        let rule = |class, rule: Rule| {
            DefectKind::rules(class, "it is broken", 1, move |app, _| {
                app.insert_resource(rule);
            })
        };
        vec![rule("burns", Rule::Panics), rule("no-exit", Rule::NoExit)]
    }
}
