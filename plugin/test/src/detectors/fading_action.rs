//! Actions that lose their effect in the course of an episode.

use crate::detectors::{
    LevelDefect, LevelDetector, TestedLevel,
    dead_action::tried,
    determinism::{LedEpisodes, Script, SeenState},
};
use bevy_playbot::{action::ActionValue, fault::Fault, vision::ObservationConfig};
use playbot_harness::{detector::DetectorSetting, game::idle_action};

/// Most ticks for which an action is tried.
const MOST_TICKS: usize = 100_000;

/// Largest difference of numbers that count as equal.
const TOLERANCE: f32 = 0.01;

/// A finding for actions that work at the start of a level and, after many tries there, no longer do.
///
/// Each action is tried again and again from the level's start: held for some ticks, then released for others. A try
/// has an effect if doing nothing in its place leads to another state hash, observation or reward. The action has faded
/// if its first tries have an effect and its last ones have none.
///
/// An agent that came to a wall, or fell, would show that too. So the last try must begin at the position of the first
/// one, with the same observation. Numbers that change while nothing is done, such as a clock, may differ. Another action
/// must still have an effect there, because no action works after a pause.
///
/// An action that is illegal in one of its last tries has not faded.
///
/// It is opt-in: ammunition that is not observed is a finding too.
pub struct FadingAction {
    every: f64,
    tries: f64,
    first: f64,
    last: f64,
    ticks: f64,
    rest: f64,
}

impl Default for FadingAction {
    fn default() -> Self {
        Self { every: 10.0, tries: 40.0, first: 3.0, last: 5.0, ticks: 5.0, rest: 40.0 }
    }
}

impl LevelDetector for FadingAction {
    fn name(&self) -> &'static str {
        "fading-action"
    }

    fn describe(&self) -> &'static str {
        "an action that has an effect at the start and, tried there again and again, no longer has one"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("every", &mut self.every, "look at every n-th level of the range").at_least(1.0),
            DetectorSetting::new("tries", &mut self.tries, "tries of each action").at_least(2.0),
            DetectorSetting::new("first", &mut self.first, "tries up to the last one with an effect, at least")
                .at_least(1.0),
            DetectorSetting::new("last", &mut self.last, "tries at the end that must be without effect").at_least(1.0),
            DetectorSetting::new("ticks", &mut self.ticks, "ticks for which it is held").at_least(1.0),
            DetectorSetting::new("rest", &mut self.rest, "ticks between two tries").at_least(1.0),
        ]
    }

    fn depends_on_testers(&self) -> bool {
        false
    }

    /// So many tries with an effect, and so many without.
    fn least_ticks(&self) -> u32 {
        (self.rest + (self.first + self.last) * (self.ticks + self.rest)) as u32
    }

    /// It plays an episode of its own, up to the game's time limit.
    fn most_ticks(&self, level: &TestedLevel<'_>) -> Option<u32> {
        level.game.tools().host.time_limit()
    }

    fn setting_for(&self, ticks: u32) -> Option<String> {
        let tries = self.first + self.last;
        let rest = ((f64::from(ticks) - tries * self.ticks) / (tries + 1.0)).floor();
        (rest >= 1.0).then(|| format!("rest={rest}"))
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let Some(tester) = level.testers.first().filter(|_| level.is_sample(self.every)) else { return Vec::new() };
        // The actions are given, so the player decides nothing, and neither its seed nor what it sees may matter: the
        // finding is that of every tester.
        let observation_config = ObservationConfig::default();
        let script = Script { observation_config, seed: 0, ..Script::new(level, tester) };
        // Other detectors report a panic.
        let faded = self.faded(&script).unwrap_or_default();
        faded.into_iter().map(|message| LevelDefect { message, ..LevelDefect::default() }).collect()
    }
}

/// An action that is tried again and again.
struct Tried<'a, 'b> {
    led: &'a LedEpisodes<'b>,
    idle: &'a ActionValue,
    /// All ticks: a rest, then the tries.
    actions: Vec<ActionValue>,
    /// The states after them, as far as the episode goes.
    states: Vec<SeenState>,
    /// Ticks of the first rest, and of each try.
    rest: usize,
    length: usize,
}

impl Tried<'_, '_> {
    /// Returns the number of tries that are played to their end.
    fn count(&self) -> usize {
        self.states.len().saturating_sub(self.rest) / self.length
    }

    /// Returns the first tick of a try.
    fn begin(&self, number: usize) -> usize {
        self.rest + number * self.length
    }

    /// Returns whether doing nothing from the begin of a try to the end of another one changes anything.
    fn has_effect(&self, from: usize, to: usize) -> Result<bool, Fault> {
        let (begin, end) = (self.begin(from), self.begin(to));
        let nothing = self.led.play(&self.actions[..begin], self.idle, end - begin)?;
        Ok(nothing.hashes.iter().ne(self.states[begin..end].iter().map(|state| &state.hash)))
    }

    /// Returns whether the action was played in each try from this one on: it is not where it is illegal.
    fn is_played_from(&self, number: usize, way: &ActionValue) -> bool {
        let states = |number| &self.states[self.begin(number)..self.begin(number + 1)];
        (number..self.count()).all(|number| states(number).iter().any(|state| state.action == *way))
    }

    /// Returns the number of tries after which no further one has an effect, of `count` in all, of which the last
    /// `last` ones have none.
    fn works_for(&self, count: usize, last: usize) -> Result<usize, Fault> {
        // The first try has an effect. If none from a try on has one, none from a later try on has.
        let (mut with, mut without) = (0, count - last);
        while without - with > 1 {
            let middle = with.midpoint(without);
            if self.has_effect(middle, count)? {
                with = middle;
            } else {
                without = middle;
            }
        }
        Ok(without)
    }
}

impl FadingAction {
    /// Returns a message for each action that has faded.
    fn faded(&self, script: &Script<'_>) -> Result<Vec<String>, Fault> {
        let [tries, last, ticks, rest] = [self.tries, self.last, self.ticks, self.rest].map(|number| number as usize);
        let (length, idle, actions) = (ticks.saturating_add(rest), idle_action(script.game), tried(script.game));
        let most = rest.saturating_add(tries.saturating_mul(length)).min(MOST_TICKS);
        let led = script.led_episodes();
        let resting = led.states(&vec![idle.clone(); most])?;
        let mut found = Vec::new();
        for (name, ways) in &actions {
            for way in ways {
                let one = std::iter::repeat_n(way, ticks).chain(std::iter::repeat_n(&idle, rest));
                let all = std::iter::repeat_n(&idle, rest).chain(one.cycle()).take(most);
                let actions: Vec<ActionValue> = all.cloned().collect();
                let states = led.states(&actions)?;
                let tried = Tried { led: &led, idle: &idle, actions, states, rest, length };
                let count = tried.count();
                if count <= last {
                    continue;
                }
                let (first, end) = (rest - 1, tried.begin(count - 1) - 1);
                let is_same = is_same(&tried.states[first], &tried.states[end], &resting);
                if !is_same
                    || !tried.is_played_from(count - last, way)
                    || !tried.has_effect(0, 1)?
                    || tried.has_effect(count - last, count)?
                {
                    continue;
                }
                let works = tried.works_for(count, last)?;
                if works < self.first as usize {
                    continue;
                }
                if let Some(other) = self.working(&tried, &actions_besides(name, script), count - 1)? {
                    let (works, further) = (times(works), times(count - works));
                    found.push(format!(
                        "{name} had an effect {works} at the start of the level, and then none {further} from the same \
                         position, where {other} still has one"
                    ));
                    break;
                }
            }
        }
        Ok(found)
    }

    /// Returns the name of an action that still has an effect at the begin of this try.
    fn working(
        &self,
        tried: &Tried<'_, '_>,
        others: &[(String, Vec<ActionValue>)],
        number: usize,
    ) -> Result<Option<String>, Fault> {
        let begin = tried.begin(number);
        let nothing: Vec<u64> =
            tried.states[begin..].iter().map(|state| state.hash).take(self.ticks as usize).collect();
        for (name, ways) in others {
            for way in ways {
                if tried.led.play(&tried.actions[..begin], way, nothing.len())?.hashes != nothing {
                    return Ok(Some(name.clone()));
                }
            }
        }
        Ok(None)
    }
}

/// Returns all actions but the one with this name.
fn actions_besides(name: &str, script: &Script<'_>) -> Vec<(String, Vec<ActionValue>)> {
    tried(script.game).into_iter().filter(|(other, _)| other != name).collect()
}

/// Returns a number of times in words.
fn times(count: usize) -> String {
    if count == 1 { "once".to_owned() } else { format!("{count} times") }
}

/// Returns whether two states look the same, but for numbers that change while nothing is done.
fn is_same(one: &SeenState, other: &SeenState, resting: &[SeenState]) -> bool {
    let is_near = |one: f32, other: f32| (one - other).abs() <= TOLERANCE;
    let is_placed = match (one.position, other.position) {
        (Some(one), Some(other)) => one.distance(other) <= TOLERANCE,
        (None, None) => true,
        _ => false,
    };
    let moves = |number: usize| {
        let mut values = resting.iter().filter_map(|state| state.observation.get(number));
        let first = values.next().copied().unwrap_or_default();
        values.any(|value| !is_near(first, *value))
    };
    let numbers = one.observation.iter().zip(&other.observation).enumerate();
    let mut differing = numbers.filter(|(_, (one, other))| !is_near(**one, **other));
    is_placed && one.observation.len() == other.observation.len() && differing.all(|(number, _)| moves(number))
}

#[cfg(test)]
mod tests {
    use bevy::prelude::*;
    use playbot_harness::{eval::Player, foreign::ForeignGame};

    use super::*;

    #[derive(Component)]
    struct Jumper {
        jumps: u32,
    }

    /// A game with a run to the right, up to a wall at 3, and so many jumps. It observes its place, and how many jumps
    /// are left if `shows`.
    fn game(jumps: u32, shows: bool) -> ForeignGame {
        let game = move |app: &mut App| {
            app.add_systems(Startup, move |mut commands: Commands| {
                commands.spawn((Jumper { jumps }, Transform::default()));
            })
            .add_systems(
                Update,
                |keys: Res<ButtonInput<KeyCode>>, jumper: Single<(&mut Transform, &mut Jumper)>| {
                    let (mut at, mut jumper) = jumper.into_inner();
                    let right = f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
                    at.translation.x = (at.translation.x + right).min(3.0);
                    if keys.pressed(KeyCode::Space) && at.translation.y <= 0.0 && jumper.jumps > 0 {
                        jumper.jumps -= 1;
                        at.translation.y = 3.0;
                    } else {
                        at.translation.y = (at.translation.y - 1.0).max(0.0);
                    }
                },
            );
        };
        ForeignGame::new("jumper", 1, game)
            .keys([vec![], vec![KeyCode::ArrowRight], vec![KeyCode::Space]])
            .observe(["x", "y", "jumps"], move |jumper: Single<(&Transform, &Jumper)>| {
                let (at, jumper) = *jumper;
                [at.translation.x, at.translation.y, if shows { jumper.jumps as f32 } else { 0.0 }]
            })
            .time_limit(200)
    }

    fn faded(game: &ForeignGame) -> Vec<String> {
        let (player, stop) = (&Player::Demonstrator, &|| false);
        let observation_config = ObservationConfig::default();
        let script = Script { game, mode: "default", level: 0, player, observation_config, seed: 3, stop };
        let detector = FadingAction { tries: 8.0, last: 2.0, ticks: 2.0, rest: 8.0, ..FadingAction::default() };
        detector.faded(&script).expect("sound")
    }

    #[test]
    fn a_jump_that_stops_working_is_found_with_the_number_of_jumps() {
        let words = "`Space` had an effect 3 times at the start of the level, and then none 5 times from the same position, \
                     where `ArrowRight` still has one";
        assert_eq!(faded(&game(3, false)), [words]);
    }

    #[test]
    fn an_action_that_goes_on_working_or_leads_to_a_wall_is_not_found() {
        assert!(faded(&game(100, false)).is_empty());
        assert!(faded(&game(7, false)).is_empty(), "a single try without effect is too few");
        assert!(faded(&game(0, false)).is_empty(), "it never worked, which another detector finds");
        assert!(faded(&game(2, false)).is_empty(), "a switch may work once or twice");
    }

    #[test]
    fn an_action_that_becomes_illegal_has_not_faded() {
        let masked = game(3, false).legal(|jumper: Single<&Jumper>| [true, true, jumper.jumps > 0]);
        assert!(faded(&masked).is_empty());
    }

    #[test]
    fn a_shown_number_of_jumps_is_no_surprise() {
        assert!(faded(&game(3, true)).is_empty());
    }

    #[test]
    fn an_episode_that_is_too_short_shows_nothing() {
        // A rest of 8 ticks and two tries of 10.
        assert!(faded(&game(3, false).time_limit(29)).is_empty());
    }

    #[test]
    fn numbers_that_change_by_themselves_may_differ() {
        let state = |observation: [f32; 2]| {
            let (observation, action) = (observation.to_vec(), ActionValue::Discrete(0));
            SeenState { hash: 0, observation, position: None, action }
        };
        let ticking = [state([0.0, 1.0]), state([1.0, 1.0])];
        assert!(is_same(&state([0.0, 1.0]), &state([9.0, 1.0]), &ticking));
        assert!(!is_same(&state([0.0, 1.0]), &state([0.0, 2.0]), &ticking));
        let placed = SeenState { position: Some(bevy::math::Vec2::ONE), ..state([0.0, 1.0]) };
        assert!(!is_same(&placed, &state([0.0, 1.0]), &ticking));
    }
}
