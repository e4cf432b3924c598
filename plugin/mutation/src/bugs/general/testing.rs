//! A small game for tests, played with planted defects.

use crate::bugs::Mutant;
use bevy::prelude::*;
use bevy_playbot::engine::{panics::PanicReports, tick_world};
use playbot_harness::{
    defect::DefectKind,
    foreign::ForeignGame,
    game::{BotTools, InputTools},
    prelude::*,
    worlds::{EndedEpisodes, build_world},
};

/// Steps to the goal.
const GOAL: i32 = 30;

/// Ticks until time is up.
const LIMIT: u32 = 100;

/// A track: action 1 steps forward, action 2 steps back, action 0 stays.
#[derive(Clone, Copy, Debug)]
pub(in crate::bugs) struct Track;

#[derive(Component, Default)]
struct Steps(i32);

#[derive(Resource, Default)]
struct Place(i32);

fn next(place: i32, action: u32) -> i32 {
    (place + [0, 1, -1][action as usize]).max(0)
}

impl Game for Track {
    fn name(&self) -> &'static str {
        "track"
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
        app.add_observer(|event: On<StartEpisode>, mut steps: Query<&mut Steps>| {
            if let Ok(mut steps) = steps.get_mut(event.entity) {
                steps.0 = 0;
            }
        })
        .add_systems(ObserveSchedule, |mut agents: Query<(&Steps, &mut Observation)>| {
            agents.iter_mut().for_each(|(steps, mut seen)| seen.set([steps.0 as f32 / GOAL as f32]));
        })
        .add_systems(FixedUpdate, |mut agents: Query<(&Control, &Action, &mut Steps, &mut Episode)>| {
            for (control, action, mut steps, mut episode) in &mut agents {
                if !control.is_active() || !episode.is_running() {
                    continue;
                }
                steps.0 = next(steps.0, action.discrete().unwrap_or(0));
                if steps.0 >= GOAL {
                    episode.terminate(true);
                } else if episode.tick + 1 >= LIMIT {
                    episode.truncate();
                }
            }
        });
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        world.spawn((Agent::new(index, self.actions()), VectorSensor::new(["place"]), Steps::default())).id()
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { input: self, bots: self, ..GameTools::default() }
    }
}

impl InputTools for Track {
    fn action_names(&self) -> Vec<String> {
        ["stay", "on", "back"].map(str::to_owned).to_vec()
    }
}

impl BotTools for Track {
    fn blind_bots(&self) -> Vec<(&'static str, BlindBot)> {
        vec![("on", BlindBot::Constant(ActionValue::Discrete(1))), ("random", BlindBot::Uniform)]
    }
}

/// The same game without the plugin's agents, whose ticks are frames.
fn framed_track() -> ForeignGame {
    let track = |app: &mut App| {
        app.init_resource::<Place>().add_systems(
            Update,
            |keys: Res<ButtonInput<KeyCode>>, mut place: ResMut<Place>| {
                let held = [KeyCode::ArrowRight, KeyCode::ArrowLeft].iter().position(|key| keys.pressed(*key));
                place.0 = next(place.0, held.map_or(0, |at| at as u32 + 1));
            },
        );
    };
    ForeignGame::new("framed-track", 1, track)
        .keys([vec![], vec![KeyCode::ArrowRight], vec![KeyCode::ArrowLeft]])
        .observe(["place"], |place: Res<Place>| [place.0 as f32 / GOAL as f32])
        .end(|place: Res<Place>| (place.0 >= GOAL).then_some(EpisodeEnd::WON))
        .time_limit(LIMIT)
        .level(|mut place: ResMut<Place>| place.0 = 0)
        .state_hash(|place: Res<Place>| place.0 as u64)
}

/// The result of playing a track.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Played {
    /// Results of the ended episodes: true if won, and the ticks.
    pub(super) episodes: Vec<(bool, u32)>,
    pub(super) ends: Vec<EpisodeEnd>,
    /// The agent's last position.
    pub(super) place: i32,
    /// The agent's position after each tick.
    pub(super) places: Vec<i32>,
    /// The actions, as recorded.
    pub(super) actions: Vec<u32>,
    /// Sum of the rewards.
    pub(super) reward: f64,
    /// Entities at the end.
    pub(super) entities: u32,
    pub(super) fault: Option<String>,
}

/// Plays this many ticks of both games with a defect; `act` returns the action of each tick. Both games must have the
/// same result.
pub(super) fn play(kind: &DefectKind, variant: u32, ticks: u32, act: impl Fn(u32) -> u32 + Copy) -> Played {
    let fixed = play_in(&Mutant::new(&Track as &dyn Game, kind, variant), ticks, act);
    let framed = framed_track();
    let framed = play_in(&Mutant::new(&framed as &dyn Game, kind, variant), ticks, act);
    if kind.class != "unseeded-randomness" {
        let outcome = |played: &Played| (played.episodes.clone(), played.ends.clone(), played.places.clone());
        assert_eq!(outcome(&fixed), outcome(&framed), "where ticks are frames it is another game");
        assert_eq!((fixed.reward, fixed.fault.is_some()), (framed.reward, framed.fault.is_some()));
    }
    fixed
}

/// Plays the unmutated game.
pub(super) fn play_sound(ticks: u32, act: impl Fn(u32) -> u32) -> Played {
    play_in(&Track, ticks, act)
}

fn play_in(game: &dyn Game, ticks: u32, act: impl Fn(u32) -> u32) -> Played {
    let (mut world, agents) = build_world(game, game.modes()[0], 0, 0, 1);
    let agent = agents[0];
    EndedEpisodes::note_in(&mut world);
    world.resource_mut::<PanicReports>().keep_no_files();
    // A bot without a script leaves the action unchanged.
    world.entity_mut(agent).insert(Control::Bot);
    let mut played = Played::default();
    for tick in 0..ticks {
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(act(tick))));
        if let Err(fault) = tick_world(&mut world) {
            played.fault = Some(fault.to_string());
            break;
        }
        let steps = world.get::<Steps>(agent).map(|steps| steps.0);
        played.place = steps.or_else(|| world.get_resource::<Place>().map(|place| place.0)).expect("one of them");
        played.places.push(played.place);
        played.actions.extend(world.get::<Action>(agent).and_then(Action::discrete));
        played.reward += f64::from(world.get::<Reward>(agent).expect("agents have one").get());
        for (_, result) in EndedEpisodes::take(&mut world) {
            played.episodes.push((result.success, result.ticks));
            played.ends.push(result.end);
        }
    }
    played.entities = world.entity_count();
    played
}
