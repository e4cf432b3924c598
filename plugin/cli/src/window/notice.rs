//! Notices for the person in the title, and keys and buttons that no action holds: reported by a notice, and counted for
//! the end of a recording.

use bevy::prelude::*;
use bevy_playbot::{action::Action, engine::TickSchedules, key_bindings::MissingSet, virtual_input::VirtualButton};
use playbot_harness::prelude::*;
use playbot_report::counted;
use std::{
    borrow::Cow,
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

// The notice, which is shown for a while.

/// Time for which a notice is shown.
const NOTICE: Duration = Duration::from_secs(3);

/// A notice for the person.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct Notice {
    words: Option<Cow<'static, str>>,
    age: Duration,
}

impl Notice {
    /// Returns the words, as long as they are shown.
    pub fn words(&self) -> Option<&str> {
        self.words.as_deref()
    }

    /// Shows these words for a while.
    pub fn say(&mut self, words: impl Into<Cow<'static, str>>) {
        *self = Self { words: Some(words.into()), age: Duration::ZERO };
    }
}

/// Takes a notice away after its time.
pub(super) fn age_notice(clock: Res<Time<Real>>, mut notice: ResMut<Notice>) {
    if notice.words.is_some() {
        notice.age += clock.delta();
        if notice.age > NOTICE {
            notice.words = None;
        }
    }
}

// The keys and buttons that no action holds.

/// The sets of keys and buttons that a person has held in a window, and that no action of the game holds. It outlives the window.
#[derive(Resource, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone)]
pub struct UnboundKeys(Arc<Mutex<Tally>>);

/// The sets in the order in which they were held first.
#[derive(Debug)]
struct Tally {
    game: &'static str,
    action_names: Vec<String>,
    sets: Vec<UnboundSet>,
}

/// A set of keys and buttons that no action holds.
#[derive(Debug)]
struct UnboundSet {
    keys: Vec<VirtualButton>,
    /// The action that the game got instead.
    action: u32,
    ticks: u64,
}

impl UnboundKeys {
    /// Starts to count for this game.
    pub(super) fn new(game: &dyn Game) -> Self {
        let action_names = game.tools().input.action_names();
        Self(Arc::new(Mutex::new(Tally { game: game.name(), action_names, sets: Vec::new() })))
    }

    /// Counts a tick in which a person held these keys, and returns a message if they are held for the first time.
    fn count(&self, keys: Vec<VirtualButton>, action: u32) -> Option<String> {
        let mut tally = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = tally.sets.iter_mut().find(|set| set.keys == keys) {
            known.ticks += 1;
            return None;
        }
        let (held, got) = (in_words(&keys), tally.action(action));
        tally.sets.push(UnboundSet { keys, action, ticks: 1 });
        Some(format!("no action holds {held}: the game gets {got}"))
    }

    /// Returns a note for each set, with the number of its ticks and the remedy.
    pub fn notes(&self) -> Vec<String> {
        let tally = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let note = |UnboundSet { keys, action, ticks }: &UnboundSet| {
            format!(
                "you held {} for {}, which no action of {} does, and the game got {}: add {}",
                in_words(keys),
                counted(*ticks, "tick"),
                tally.game,
                tally.action(*action),
                remedy(keys)
            )
        };
        tally.sets.iter().map(note).collect()
    }
}

impl Tally {
    /// Returns the number of an action with its name, if it has one.
    fn action(&self, action: u32) -> String {
        let name = self.action_names.get(action as usize);
        name.map_or(format!("action {action}"), |name| format!("action {action} ({name})"))
    }
}

fn in_words(keys: &[VirtualButton]) -> String {
    match keys {
        [] => "no key".to_owned(),
        keys => keys.iter().map(VirtualButton::to_string).collect::<Vec<_>>().join("+"),
    }
}

/// Returns the sets to add to the game's actions, for each device.
fn remedy(keys: &[VirtualButton]) -> String {
    let mut sets = [Vec::new(), Vec::new(), Vec::new()];
    for key in keys {
        match key {
            VirtualButton::Key(key) => sets[0].push(format!("KeyCode::{key:?}")),
            VirtualButton::Mouse(button) => sets[1].push(format!("MouseButton::{button:?}")),
            VirtualButton::Gamepad(button) => sets[2].push(format!("GamepadButton::{button:?}")),
        }
    }
    let places = ["keys", "mouse buttons", "gamepad buttons"];
    let parts: Vec<(String, &str)> = sets
        .iter()
        .zip(places)
        .filter(|(set, _)| !set.is_empty())
        .map(|(set, place)| (format!("`vec![{}]`", set.join(", ")), place))
        .collect();
    match parts.as_slice() {
        [] => "`vec![]` to its keys".to_owned(),
        [(set, place)] => format!("{set} to its {place}"),
        parts => {
            let parts: Vec<String> = parts.iter().map(|(set, place)| format!("{set} in its {place}")).collect();
            format!("an action with {}", parts.join(" and "))
        }
    }
}

/// Counts in each tick.
pub(super) fn build(app: &mut App, unbound: UnboundKeys) {
    let judge = TickSchedules::of(app).judge;
    app.insert_resource(unbound).add_systems(judge, count.in_set(PlaybotSystems::Judge));
}

fn count(
    unbound: Res<UnboundKeys>,
    mut notice: ResMut<Notice>,
    mut agents: Query<(&Control, &Action, &mut MissingSet)>,
) {
    for (control, action, mut missing) in &mut agents {
        let Some(keys) = missing.0.take() else { continue };
        let (Control::Human, Some(action)) = (*control, action.discrete()) else { continue };
        // The start of the session has warned of holding nothing.
        let is_known = keys.is_empty();
        if let Some(words) = unbound.count(keys, action).filter(|_| !is_known) {
            report!("{words}");
            notice.say(words);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_harness::foreign::ForeignGame;

    const SETS: [&[KeyCode]; 2] = [&[KeyCode::ArrowLeft], &[KeyCode::Space]];

    fn game(sets: &[&[KeyCode]]) -> ForeignGame {
        let sets = sets.iter().map(|set| set.to_vec());
        ForeignGame::new("hop", 1, |_: &mut App| {}).keys(sets).observe(["x"], || [0.0])
    }

    #[test]
    fn a_set_of_keys_is_reported_once_and_counted_to_the_end() {
        let unbound = UnboundKeys::new(&game(&SETS));
        let chord = || vec![KeyCode::ArrowLeft.into(), KeyCode::Space.into()];
        let first = unbound.count(chord(), 0);
        assert_eq!(first.as_deref(), Some("no action holds ArrowLeft+Space: the game gets action 0 (ArrowLeft)"));
        assert_eq!(unbound.count(chord(), 0), None);
        assert!(unbound.count(vec![], 0).is_some());
        assert_eq!(
            unbound.notes(),
            [
                "you held ArrowLeft+Space for 2 ticks, which no action of hop does, and the game got action 0 (ArrowLeft): add \
                 `vec![KeyCode::ArrowLeft, KeyCode::Space]` to its keys",
                "you held no key for 1 tick, which no action of hop does, and the game got action 0 (ArrowLeft): add `vec![]` \
                 to its keys",
            ]
        );
    }

    #[test]
    fn buttons_of_mouse_and_gamepad_are_named_with_their_places() {
        let unbound = UnboundKeys::new(&game(&SETS));
        let chord = vec![KeyCode::Space.into(), MouseButton::Left.into(), GamepadButton::South.into()];
        let first = unbound.count(chord, 0).expect("it is new");
        assert!(first.starts_with("no action holds Space+MouseLeft+GamepadSouth: the game gets"), "{first}");
        unbound.count(vec![MouseButton::Right.into()], 1);
        let notes = unbound.notes();
        let [whole, single] = notes.as_slice() else { panic!("two sets: {notes:?}") };
        assert!(
            whole.ends_with(
                ": add an action with `vec![KeyCode::Space]` in its keys and `vec![MouseButton::Left]` in its mouse \
                 buttons and `vec![GamepadButton::South]` in its gamepad buttons"
            ),
            "{whole}"
        );
        assert!(single.ends_with(": add `vec![MouseButton::Right]` to its mouse buttons"), "{single}");
    }

    #[test]
    fn ticks_of_a_person_count_and_those_of_others_do_not() {
        let mut world = World::new();
        let unbound = UnboundKeys::new(&game(&SETS));
        world.insert_resource(unbound.clone());
        world.init_resource::<Notice>();
        let missing = || MissingSet(Some(vec![KeyCode::KeyA.into()]));
        let person = world.spawn((Control::Human, Action::default(), missing())).id();
        world.spawn((Control::Policy, Action::default(), missing()));
        let mut schedule = Schedule::default();
        schedule.add_systems(count);
        schedule.run(&mut world);
        schedule.run(&mut world);
        assert_eq!(world.get::<MissingSet>(person), Some(&MissingSet(None)), "each decision counts once");
        let notes = unbound.notes();
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].starts_with("you held KeyA for 1 tick,"), "{notes:?}");
    }
}
