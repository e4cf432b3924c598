//! Actions that do nothing.

use bevy_playbot::action::{ActionSpace, ActionValue};

use crate::game::Game;

/// Words that begin the names of actions that do nothing.
const NAMES: [&str; 8] = ["none", "nothing", "noop", "no-op", "idle", "stay", "wait", "stand"];

/// Returns whether a discrete choice does nothing, by its name.
pub(crate) fn is_named_idle(names: &[String], choice: u32) -> bool {
    let name = names.get(choice as usize).and_then(|name| name.split_whitespace().next()).unwrap_or("");
    NAMES.contains(&name.to_lowercase().as_str())
}

/// Returns the game's idle action: the first choice with an idle name, else choice 0; zeros for continuous actions.
pub(crate) fn idle_action(game: &dyn Game) -> ActionValue {
    match game.actions() {
        ActionSpace::Discrete(count) => {
            let names = game.tools().input.action_names();
            ActionValue::Discrete((0..count as u32).find(|&choice| is_named_idle(&names, choice)).unwrap_or(0))
        }
        ActionSpace::Continuous(count) => ActionValue::Continuous(vec![0.0; count]),
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::App;

    use super::*;
    use crate::foreign::ForeignGame;

    #[test]
    fn names_say_what_does_nothing() {
        let keys = ForeignGame::new("keys", 1, |_: &mut App| {});
        let named = keys.clone().keys_by_name([vec!["ArrowUp"], vec![], vec!["ArrowLeft"]]);
        assert_eq!(idle_action(&named), ActionValue::Discrete(1));
        let unnamed = keys.keys_by_name([vec!["ArrowUp"], vec!["ArrowLeft"]]);
        assert_eq!(idle_action(&unnamed), ActionValue::Discrete(0));
        assert!(is_named_idle(&["None (D)".to_owned()], 0) && !is_named_idle(&[], 3));
    }
}
