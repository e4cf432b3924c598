//! The things that an agent can do by themselves: one action, one option of a choice, or one number at an end.

use crate::game::{Game, idle_action, is_named_idle};
use playbot_learner::ActionValue;

/// One thing that an agent can do, while all else of its action is idle.
#[derive(Clone, Debug, PartialEq)]
pub struct SingleAction {
    /// Its name, if the game has one for it.
    pub name: Option<String>,
    /// Its place: the number of a discrete action; else among the options of all choices and then the numbers.
    pub number: u32,
    /// The actions that do it: one, or the two ends of a number.
    pub ways: Vec<ActionValue>,
    /// Whether it does nothing: it is the idle action, or has the name of one.
    pub is_idle: bool,
}

/// Returns all that an agent of the game can do by itself.
///
/// ```
/// use bevy::prelude::*;
/// use playbot_harness::{foreign::ForeignGame, prelude::*, single_actions::single_actions};
///
/// let walk = vec![vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]];
/// let jump = vec![vec![], vec![KeyCode::Space]];
/// let game = ForeignGame::new("hop", 1, |_: &mut App| {}).choices([walk, jump]).separately();
/// let all = single_actions(&game);
/// let doing = all.iter().filter(|single| !single.is_idle);
/// assert_eq!(doing.filter_map(|single| single.name.as_deref()).collect::<Vec<_>>(), ["ArrowLeft", "ArrowRight", "Space"]);
/// assert_eq!(all[4].ways, [ActionValue::Mixed { choices: vec![0, 1], numbers: vec![] }]);
/// ```
pub fn single_actions(game: &dyn Game) -> Vec<SingleAction> {
    let (space, names, idle) = (game.actions(), game.tools().input.action_names(), idle_action(game));
    let name = |number: usize| names.get(number).cloned();
    let choices = space.choices();
    let of_choice = |choice: usize, option: u32| {
        let mut action = idle.clone();
        match &mut action {
            ActionValue::Discrete(taken) => *taken = option,
            ActionValue::Mixed { choices, .. } => choices[choice] = option,
            ActionValue::Continuous(_) => {}
        }
        action
    };
    let options = choices.ranges().enumerate().flat_map(|(choice, at)| {
        let first = at.start;
        at.map(move |number| (number, choice, (number - first) as u32))
    });
    let options = options.map(|(number, choice, option)| {
        let action = of_choice(choice, option);
        let is_idle = action == idle || is_named_idle(&names, number as u32);
        SingleAction { name: name(number), number: number as u32, ways: vec![action], is_idle }
    });
    let numbers = (0..space.numbers()).map(|at| {
        let way = |value: f32| {
            let mut action = idle.clone();
            if let ActionValue::Continuous(numbers) | ActionValue::Mixed { numbers, .. } = &mut action {
                numbers[at] = value;
            }
            action
        };
        let number = space.options() + at;
        SingleAction { name: name(number), number: number as u32, ways: vec![way(1.0), way(-1.0)], is_idle: false }
    });
    options.chain(numbers).collect()
}
