//! Keys of a person that no action holds: reported at once, and counted for the end of a recording.

use crate::window::title::Notice;
use bevy::prelude::*;
use bevy_playbot::{action::Action, engine::TickSchedules, key_bindings::MissingSet};
use playbot_harness::prelude::*;
use playbot_report::counted;
use std::sync::{Arc, Mutex, PoisonError};

/// The sets of keys that a person has held in a window, and that no action of the game holds. It outlives the window.
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

/// A set of keys that no action holds.
#[derive(Debug)]
struct UnboundSet {
    keys: Vec<KeyCode>,
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
    fn count(&self, keys: Vec<KeyCode>, action: u32) -> Option<String> {
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
            let codes: Vec<String> = keys.iter().map(|key| format!("KeyCode::{key:?}")).collect();
            format!(
                "you held {} for {}, which no action of {} does, and the game got {}: add `vec![{}]` to its keys",
                in_words(keys),
                counted(*ticks, "tick"),
                tally.game,
                tally.action(*action),
                codes.join(", ")
            )
        };
        tally.sets.iter().map(note).collect()
    }
}

impl Tally {
    /// Names an action.
    fn action(&self, action: u32) -> String {
        name_action(&self.action_names, action)
    }
}

/// Returns the number of an action with its name, if it has one.
fn name_action(names: &[String], action: u32) -> String {
    names.get(action as usize).map_or(format!("action {action}"), |name| format!("action {action} ({name})"))
}

/// Returns a warning if a person who holds no key gets an action that holds one.
pub fn idle_warning(game: &dyn Game) -> Option<String> {
    let input = game.tools().input;
    let is_fine = input.key_bindings().is_none_or(|keys| keys.has_idle_action());
    (!is_fine).then(|| {
        format!(
            "warning: no action of {} holds nothing: while you hold no key, it gets {}; add `vec![]` to its keys",
            game.name(),
            name_action(&input.action_names(), 0)
        )
    })
}

fn in_words(keys: &[KeyCode]) -> String {
    match keys {
        [] => "no key".to_owned(),
        keys => keys.iter().map(|key| format!("{key:?}")).collect::<Vec<_>>().join("+"),
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
        let chord = || vec![KeyCode::ArrowLeft, KeyCode::Space];
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
    fn a_game_in_which_no_action_holds_nothing_is_warned_of() {
        let warning = idle_warning(&game(&SETS)).expect("both actions hold a key");
        let words = "no action of hop holds nothing: while you hold no key, it gets action 0 (ArrowLeft); add `vec![]`";
        assert!(warning.contains(words), "{warning}");
        assert_eq!(idle_warning(&game(&[&[], &[KeyCode::Space]])), None);
    }

    #[test]
    fn ticks_of_a_person_count_and_those_of_others_do_not() {
        let mut world = World::new();
        let unbound = UnboundKeys::new(&game(&SETS));
        world.insert_resource(unbound.clone());
        world.init_resource::<Notice>();
        let missing = || MissingSet(Some(vec![KeyCode::KeyA]));
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
