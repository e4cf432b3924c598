//! A corridor with planted defects, for tests of detectors.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_harness::{
    detector::{Detector, DetectorTick, EachTick},
    eval::Player,
    floor_plan::FloorPlan,
    game::{LevelTools, StateTools, TestTools},
};
use playbot_test::{
    detectors::{DetectorChoice, Detectors},
    verdict::{Finding, LevelVerdict, TestError, TestObserver, TestPlan, Tester, TesterRecord, run_tests},
};
use playbot_tests::{Cell, as_corridor, corridor_plugin};

/// The defect of a copy of the corridor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Resource)]
pub enum Defect {
    /// No defect.
    None,
    /// In the second tick of level 2 a body flies away.
    FlyingBody,
    /// An error is logged in the second tick of level 2.
    LoggedError,
    /// Staying is paid.
    PaidRest,
    /// After five ticks every running episode is lost.
    LostByClock,
    /// For an agent that rests then, time is up after five ticks.
    ShortTime,
    /// The plan of the level goes on where walking is impossible.
    ClosedWing,
}

#[derive(Component)]
struct Body;

fn go_wrong(
    defect: Res<Defect>,
    mut agents: Query<(&Control, &mut Episode, &Action, &mut Reward)>,
    mut bodies: Query<&mut Transform, With<Body>>,
) {
    for (control, mut episode, action, mut reward) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let is_moment = episode.level == 2 && episode.tick == 1;
        match *defect {
            Defect::FlyingBody if is_moment => bodies.iter_mut().for_each(|mut body| body.translation.x = f32::NAN),
            Defect::LoggedError if is_moment => tracing::error!("the door has no key"),
            Defect::PaidRest if action.discrete() == Some(2) => reward.add(0.5),
            Defect::LostByClock if episode.tick == 4 => episode.terminate(false),
            Defect::ShortTime if episode.tick == 4 && action.discrete() == Some(2) => episode.truncate(),
            _ => {}
        }
    }
}

impl Game for Defect {
    as_corridor!(but build);

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
        app.insert_resource(*self).add_systems(FixedPostUpdate, go_wrong.before(PlaybotSystems::Judge));
        app.world_mut().spawn((Body, Name::new("Crate"), Transform::default()));
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { levels: self, state: self, tests: self, ..GameTools::default() }
    }
}

impl LevelTools for Defect {
    fn floor_plan(&self, _mode: &str, _level: u64) -> Option<FloorPlan> {
        let columns = if *self == Self::ClosedWing { 17 } else { 7 };
        let square = |row: usize, column: usize| {
            let corner = Vec2::new(column as f32, row as f32);
            Rect::from_corners(corner, corner + 1.0)
        };
        let ends = [Vec2::new(3.5, 1.5), Vec2::new(6.5, 1.5)];
        Some(FloorPlan::of_tiles([3, columns], |row, _| row != 1, square, ends))
    }
}

impl StateTools for Defect {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        world.get::<Cell>(agent).map(|cell| Vec2::new(cell.0 as f32 + 0.5, 1.5))
    }
}

impl TestTools for Defect {
    fn detectors(&self) -> Vec<Box<dyn Detector>> {
        vec![Box::new(EachTick::new("late", "somebody is still there after ten ticks", |moment: &DetectorTick<'_>| {
            (moment.tick == 10).then(|| "it takes too long".to_owned())
        }))]
    }
}

pub fn tester(name: &str, player: Player) -> Tester {
    Tester { record: TesterRecord::bot(name), player, observation_config: ObservationConfig::default() }
}

pub fn random() -> Tester {
    tester("random", Player::Blind(BlindBot::Uniform))
}

/// Always the same action: 1 is to the right, and 2 stays.
pub fn always(action: u32) -> Tester {
    let name = format!("always {action}");
    tester(&name, Player::Blind(BlindBot::Constant(ActionValue::Discrete(action))))
}

/// Returns only these detectors, with these settings.
pub fn only(game: &dyn Game, names: &[&str], settings: &[&str]) -> Detectors {
    let words = |list: &[&str]| list.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
    let choice = DetectorChoice { with: words(names), without: words(&["all"]), settings: words(settings) };
    Detectors::choose(game, &choice).expect("there are such detectors")
}

pub fn verdicts(
    game: &dyn Game,
    levels: &str,
    testers: Vec<Tester>,
    detectors: Detectors,
    threads: usize,
) -> Vec<LevelVerdict> {
    let split = levels.parse().expect("levels");
    let plan = TestPlan { split, testers, episodes: 2, seed: 1, detectors, shard: None, threads };
    let mut found = Vec::new();
    let mut keep = |verdict: LevelVerdict| -> Result<(), TestError> {
        found.push(verdict);
        Ok(())
    };
    let watch = TestObserver { progress: &|_| {}, stop: &|| false };
    run_tests(game, &plan, &BTreeSet::new(), &mut keep, &watch).expect("it can be played");
    found.sort_by_key(|verdict| verdict.index);
    found
}

/// Returns all findings, with the positions of their levels.
pub fn findings(game: &dyn Game, levels: &str, testers: Vec<Tester>, detectors: Detectors) -> Vec<(u64, Finding)> {
    let of_level = |verdict: LevelVerdict| {
        let index = verdict.index;
        verdict.findings.into_iter().map(move |finding| (index, finding)).collect::<Vec<_>>()
    };
    verdicts(game, levels, testers, detectors, 1).into_iter().flat_map(of_level).collect()
}

pub fn assert_silent(found: &[(u64, Finding)]) {
    assert!(found.is_empty(), "{found:?}");
}
