//! Action masks: the actions that are legal in a tick; and decisions that hold for several.
//!
//! A game keeps the [`LegalActions`] of its agents up to date in [`ObserveSchedule`](crate::systems::ObserveSchedule).
//! Random bots, the noise of demonstrators and explorers then draw among legal actions. Policies give illegal actions
//! probability 0, in play and in training. Whatever else acts under [`Control::Bot`] and wants an illegal action plays
//! the game's [`IdleAction`], or the lowest legal action if that is illegal too. Of several choices at once, an illegal
//! one becomes its lowest legal option. A person may press anything, so the game
//! has to ignore illegal actions. A replay plays what was recorded.
//!
//! A [`DecisionPeriod`] lets an agent decide in every so many ticks: in between, what it decided is the only legal action,
//! numbers included.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{legal::LegalActions, prelude::*};
//!
//! let mut app = headless_app();
//! let mask = LegalActions::new([false, true, false]);
//! let agent = (Agent::new(0, ActionSpace::Discrete(3)), mask, Control::Bot, BlindBot::Uniform);
//! let agent = app.world_mut().spawn(agent).id();
//! app.ticks(5).expect("one action is legal");
//! assert_eq!(app.world().get::<Action>(agent).and_then(Action::discrete), Some(1));
//! ```

use crate::{
    action::{Action, ActionSpace, ActionValue},
    agent::{Agent, Control},
    carry_over::ReflectCarryComponent,
    episode::Episode,
    fault::Faults,
};
use bevy::prelude::*;

/// The legal actions of an agent in this tick. An agent without it may take any action.
///
/// Each discrete action has an entry. Of several choices at once, each option of each choice has one. At least one must
/// be legal in each choice, in each tick. Numbers have no entries: either the agent chooses all of them, or none.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, CarryComponent, Clone, Debug, Default, PartialEq)]
pub struct LegalActions {
    mask: Vec<bool>,
    /// The number of entries of each choice.
    sizes: Vec<usize>,
    /// The only legal numbers, if the agent cannot choose them.
    numbers: Option<Vec<f32>>,
}

impl LegalActions {
    /// Creates the mask from an entry for each action: true if it is legal.
    pub fn new(mask: impl IntoIterator<Item = bool>) -> Self {
        Self::of_choices([mask])
    }

    /// Creates the mask of several choices at once from an entry for each option of each choice.
    ///
    /// ```
    /// use bevy_playbot::{legal::LegalActions, prelude::*};
    ///
    /// // Right is blocked, and the agent cannot jump.
    /// let legal = LegalActions::of_choices([vec![true, true, false], vec![true, false]]);
    /// assert!(legal.allows(&ActionValue::Mixed { choices: vec![1, 0], numbers: vec![] }));
    /// assert!(!legal.allows(&ActionValue::Mixed { choices: vec![1, 1], numbers: vec![] }));
    /// ```
    pub fn of_choices(masks: impl IntoIterator<Item = impl IntoIterator<Item = bool>>) -> Self {
        let mut all = Self::default();
        for mask in masks {
            let before = all.mask.len();
            all.mask.extend(mask);
            all.sizes.push(all.mask.len() - before);
        }
        all
    }

    /// Creates the mask of the choices of `space` from an entry for each option, choice after choice. A mask that does
    /// not fit is a fault of the tick in which it is used.
    pub fn of_space(space: &ActionSpace, mask: impl IntoIterator<Item = bool>) -> Self {
        let mask: Vec<bool> = mask.into_iter().collect();
        let sizes: Vec<usize> = space.choices().sizes().iter().map(|&size| size as usize).collect();
        match sizes.iter().sum::<usize>() == mask.len() {
            true => Self { mask, sizes, numbers: None },
            false => Self::new(mask),
        }
    }

    /// Creates the mask that allows every action of `space`.
    pub fn all(space: &ActionSpace) -> Self {
        Self::of_space(space, std::iter::repeat_n(true, space.options()))
    }

    /// Creates the mask that allows this action of `space` alone.
    ///
    /// ```
    /// use bevy_playbot::{legal::LegalActions, prelude::*};
    ///
    /// let steer = |angle| ActionValue::Continuous(vec![angle]);
    /// let legal = LegalActions::only(&ActionSpace::Continuous(1), &steer(0.5));
    /// assert!(legal.allows(&steer(0.5)) && !legal.allows(&steer(0.2)));
    /// ```
    pub fn only(space: &ActionSpace, action: &ActionValue) -> Self {
        let sizes = space.choices();
        let choices = sizes.sizes().iter().enumerate();
        let taken = |choice: usize| action.options().get(choice).copied();
        let one = choices.map(|(choice, &size)| (0..size).map(move |option| taken(choice) == Some(option)));
        let numbers = (space.numbers() > 0).then(|| action.numbers().to_vec());
        Self { numbers, ..Self::of_choices(one) }
    }

    /// Returns the entries, choice after choice.
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Returns the entries as learners read them, `space.mask_width()` of them: in a space with numbers the last one is
    /// true if the agent chooses the numbers.
    pub fn entries(&self, space: &ActionSpace) -> impl Iterator<Item = bool> {
        let of_numbers = (space.numbers() > 0).then_some(self.numbers.is_none());
        self.mask.iter().copied().chain(of_numbers)
    }

    /// Returns the entries of one choice; none if there is no such choice.
    fn of_choice(&self, choice: usize) -> &[bool] {
        let first: usize = self.sizes.iter().take(choice).sum();
        self.sizes.get(choice).and_then(|size| self.mask.get(first..first + size)).unwrap_or_default()
    }

    /// Returns the legal options of one choice, lowest first. A discrete action is choice 0.
    pub fn options(&self, choice: usize) -> Vec<u32> {
        let options = (0..).zip(self.of_choice(choice));
        options.filter_map(|(option, &is_legal)| is_legal.then_some(option)).collect()
    }

    /// Returns whether an action is legal.
    pub fn allows(&self, action: &ActionValue) -> bool {
        let allows = |choice, option: u32| self.of_choice(choice).get(option as usize).copied().unwrap_or(false);
        match action {
            ActionValue::Discrete(index) => allows(0, *index),
            ActionValue::Continuous(numbers) => self.allows_numbers(numbers),
            ActionValue::Mixed { choices, numbers } => {
                self.allows_numbers(numbers)
                    && choices.iter().enumerate().all(|(choice, &option)| allows(choice, option))
            }
        }
    }

    /// Returns whether these numbers are legal.
    pub fn allows_numbers(&self, numbers: &[f32]) -> bool {
        self.numbers.as_deref().is_none_or(|only| only == numbers)
    }

    /// Replaces the numbers of an action by the only legal ones, if the agent cannot choose them.
    pub fn set_numbers(&self, action: &mut ActionValue) {
        if let (Some(only), ActionValue::Continuous(numbers) | ActionValue::Mixed { numbers, .. }) =
            (&self.numbers, action)
        {
            numbers.clone_from(only);
        }
    }

    /// Returns the number of legal actions: of several choices, the product of their legal options.
    pub fn count(&self) -> usize {
        (0..self.sizes.len()).map(|choice| self.options(choice).len()).product()
    }

    /// Returns the action to play instead of an illegal one: the idle action, or the lowest legal one if that is illegal
    /// too; `None` if no action is legal.
    pub fn instead(&self, idle: Option<&IdleAction>) -> Option<ActionValue> {
        let idle = idle.map(|IdleAction(choice)| ActionValue::Discrete(*choice));
        idle.filter(|idle| self.allows(idle)).or_else(|| self.pick(0))
    }

    /// Returns the legal discrete action that `number` falls on, counted round and round; `None` if no action is legal.
    pub(crate) fn pick(&self, number: u32) -> Option<ActionValue> {
        self.pick_of(0, number).map(ActionValue::Discrete)
    }

    fn pick_of(&self, choice: usize, number: u32) -> Option<u32> {
        let legal = self.options(choice);
        legal.get(number as usize % legal.len().max(1)).copied()
    }

    /// Returns the choices with each illegal option replaced by the legal one that `number` falls on.
    fn corrected(&self, choices: &[u32], number: u32) -> Vec<u32> {
        let correct = |(choice, &option): (usize, &u32)| match self.of_choice(choice).get(option as usize) {
            Some(true) => option,
            _ => self.pick_of(choice, number).unwrap_or(option),
        };
        choices.iter().enumerate().map(correct).collect()
    }

    /// Returns why the mask does not fit an agent's actions.
    fn misfit(&self, space: &ActionSpace) -> Option<String> {
        let choices = space.choices();
        let sizes = choices.sizes().iter().map(|&size| size as usize);
        if choices.sizes().is_empty() && !self.mask.is_empty() {
            let text = "its `LegalActions` have entries, and it has continuous actions: entries are for discrete ones";
            return Some(text.to_owned());
        }
        if let Some(numbers) = self.numbers.as_ref().filter(|numbers| numbers.len() != space.numbers()) {
            return Some(format!("its `LegalActions` allow {} numbers alone, and it has {space}", numbers.len()));
        }
        if !sizes.eq(self.sizes.iter().copied()) {
            let entries = match &self.sizes[..] {
                [] => "0".to_owned(),
                sizes => sizes.iter().map(usize::to_string).collect::<Vec<_>>().join(" and "),
            };
            let each =
                if self.sizes.len() > 1 { "give each option of each choice one" } else { "give each action one" };
            return Some(format!("its `LegalActions` have {entries} entries, and it has {space}: {each}"));
        }
        let forbidden = (0..self.sizes.len()).find(|&choice| !self.of_choice(choice).contains(&true))?;
        let what = if self.sizes.len() > 1 { format!("option of choice {forbidden}") } else { "action".to_owned() };
        Some(format!("its `LegalActions` forbid every {what}: allow one that does nothing, or end the episode"))
    }
}

/// The discrete action of a game that does nothing: bots without another choice play it instead of an illegal one.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Resource, Clone, Debug, PartialEq)]
pub struct IdleAction(pub u32);

/// Replaces an illegal action by a drawn one instead of the idle one, for random actions that are drawn before the tick,
/// when its mask is not known yet. It works under [`Control::Replay`] too. Has no effect without [`LegalActions`].
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, CarryComponent, Clone, Debug, PartialEq)]
pub struct RedrawsIllegal {
    /// A random number, which decides between the legal actions.
    pub random: u32,
}

/// Lets an agent decide in every so many ticks of its episode, the first one included. In between, what it decided is its
/// only [legal](LegalActions) action: bots, explorers and policies repeat it, and learners learn from the decisions alone.
/// Observations, rewards, recordings, time limits and skill intervals count ticks, as ever. People may press something
/// else.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::{legal::DecisionPeriod, prelude::*};
///
/// let mut app = headless_app();
/// let agent = (Agent::new(0, ActionSpace::Continuous(1)), DecisionPeriod::new(4), Control::Bot, BlindBot::Uniform);
/// let agent = app.world_mut().spawn(agent).id();
/// let mut steered = Vec::new();
/// for _ in 0..8 {
///     app.ticks(1).expect("it acts");
///     steered.push(app.world().get::<Action>(agent).expect("an agent").0.clone());
/// }
/// assert_eq!((&steered[0], &steered[4]), (&steered[3], &steered[7]));
/// assert_ne!(steered[3], steered[4]);
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, CarryComponent, Clone, Debug, PartialEq)]
pub struct DecisionPeriod {
    ticks: u32,
    /// The last decision.
    decided: Option<Action>,
    /// What the game itself allows in a tick in which the decision holds.
    game: Option<LegalActions>,
}

impl DecisionPeriod {
    /// Creates the period: 1 for a decision in each tick. 0 is a fault.
    pub fn new(ticks: u32) -> Self {
        Self { ticks, decided: None, game: None }
    }

    /// Returns the ticks of a decision.
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Returns whether the agent decides in this tick of an episode, counted from 0.
    pub fn decides_in(&self, tick: u32) -> bool {
        self.ticks < 2 || tick.is_multiple_of(self.ticks)
    }
}

/// Gives the game its own masks back, to be kept up to date.
pub(crate) fn return_masks(mut agents: Query<(&mut DecisionPeriod, &mut LegalActions)>) {
    for (mut period, mut legal) in &mut agents {
        if let Some(game) = period.game.take() {
            *legal = game;
        }
    }
}

/// Allows the last decision alone, in the ticks in which it holds.
pub(crate) fn hold_decisions(
    mut agents: Query<(Entity, &Agent, &Episode, &mut DecisionPeriod, Option<&mut LegalActions>)>,
    mut commands: Commands,
) {
    for (entity, agent, episode, mut period, legal) in &mut agents {
        let is_held = episode.is_running() && !period.decides_in(episode.tick);
        let Some(decided) = period.decided.as_ref().filter(|_| is_held) else { continue };
        let only = LegalActions::only(&agent.actions, &decided.0);
        match legal {
            Some(mut legal) => period.game = Some(std::mem::replace(&mut legal, only)),
            None => {
                period.game = Some(LegalActions::all(&agent.actions));
                commands.entity(entity).insert(only);
            }
        }
    }
}

/// Notes the actions of the ticks in which agents decide.
pub(crate) fn note_decisions(mut agents: Query<(&Action, &Episode, &mut DecisionPeriod)>) {
    for (action, episode, mut period) in &mut agents {
        if episode.is_running() && period.ticks > 1 && period.decides_in(episode.tick) {
            period.decided = Some(action.clone());
        }
    }
}

/// Reports masks and periods that do not fit their agents, with agent and tick, and stops those agents.
pub(crate) fn check_legal_actions(
    mut agents: Query<(&Agent, Option<&LegalActions>, Option<&DecisionPeriod>, &Episode, &mut Control)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, legal, period, episode, mut control) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let no_ticks = || "its `DecisionPeriod` has 0 ticks: a decision holds for at least 1".to_owned();
        let wrong = period.filter(|period| period.ticks == 0).map(|_| no_ticks());
        if let Some(why) = wrong.or_else(|| legal?.misfit(&agent.actions)) {
            faults.report(format!("{}: {why}", episode.moment(agent)));
            *control = Control::Idle;
        }
    }
}

/// Replaces the illegal actions of bots, whichever system has chosen them. An action outside the space stays, and is a
/// fault.
pub(crate) fn keep_legal(
    mut agents: Query<(&Control, &Episode, &LegalActions, Option<&RedrawsIllegal>, &mut Action)>,
    idle: Option<Res<IdleAction>>,
) {
    for (control, episode, legal, redraw, mut action) in &mut agents {
        let is_outside = (0..)
            .map_while(|choice| Some((choice, action.option(choice)?)))
            .any(|(choice, option)| option as usize >= legal.sizes.get(choice).copied().unwrap_or_default());
        let is_bot = *control == Control::Bot || (*control == Control::Replay && redraw.is_some());
        if !is_bot || !episode.is_running() || is_outside || legal.allows(&action.0) {
            continue;
        }
        legal.set_numbers(&mut action.0);
        if legal.allows(&action.0) {
            continue;
        }
        let random = redraw.map(|RedrawsIllegal { random }| *random);
        if let ActionValue::Mixed { choices, .. } = &mut action.0 {
            *choices = legal.corrected(choices, random.unwrap_or(0));
            continue;
        }
        let instead = match random {
            Some(random) => legal.pick(random),
            None => legal.instead(idle.as_deref()),
        };
        if let Some(instead) = instead {
            action.0 = instead;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;

    /// Returns an app with a bot that has this mask.
    fn masked(bot: BlindBot, mask: &[bool]) -> (App, Entity) {
        let mut app = headless_app();
        let legal = LegalActions::new(mask.iter().copied());
        let agent = (Agent::new(0, ActionSpace::Discrete(4)), legal, Control::Bot, bot);
        let agent = app.world_mut().spawn(agent).id();
        (app, agent)
    }

    /// Returns the actions of a bot with this mask.
    fn drawn(bot: BlindBot, mask: [bool; 4]) -> Vec<u32> {
        let (mut app, agent) = masked(bot, &mask);
        let mut next = || {
            app.tick().expect("some action is legal");
            app.world().get::<Action>(agent).and_then(Action::discrete)
        };
        let mut seen: Vec<u32> = (0..200).filter_map(|_| next()).collect();
        seen.sort_unstable();
        seen.dedup();
        seen
    }

    #[test]
    fn random_bots_draw_among_all_legal_actions_and_no_others() {
        for bot in [BlindBot::Uniform, BlindBot::Chaos] {
            assert_eq!(drawn(bot.clone(), [false, true, false, true]), [1, 3], "{bot:?}");
        }
    }

    #[test]
    fn chaos_lets_go_of_an_action_that_becomes_illegal() {
        let (mut app, agent) = masked(BlindBot::Chaos, &[true, false, false, false]);
        app.tick().expect("one is legal");
        app.world_mut().entity_mut(agent).insert(LegalActions::new([false, false, true, false]));
        app.tick().expect("one is legal");
        assert_eq!(app.world().get::<Action>(agent).and_then(Action::discrete), Some(2));
    }

    #[test]
    fn a_mask_that_forbids_everything_is_a_fault_with_agent_and_tick() {
        let (mut app, agent) = masked(BlindBot::Uniform, &[true; 4]);
        app.ticks(2).expect("all are legal");
        app.world_mut().entity_mut(agent).insert(LegalActions::new([false; 4]));
        let text = app.tick().expect_err("none is legal").to_string();
        assert!(text.contains("agent 0") && text.contains("tick 2") && text.contains("forbid every action"), "{text}");
        assert_eq!(app.world().get::<Control>(agent), Some(&Control::Idle));
    }

    #[test]
    fn a_mask_of_another_length_is_a_fault_with_both_numbers() {
        let (mut app, _) = masked(BlindBot::Uniform, &[true; 3]);
        let text = app.tick().expect_err("too short").to_string();
        assert!(text.contains("3 entries") && text.contains("give each action one"), "{text}");
    }

    #[test]
    fn a_bot_that_wants_an_illegal_action_plays_the_idle_one_or_else_the_lowest_legal_one() {
        let played = |wanted: u32, idle: Option<u32>| {
            let (mut app, agent) =
                masked(BlindBot::Constant(ActionValue::Discrete(wanted)), &[false, true, true, false]);
            if let Some(idle) = idle {
                app.insert_resource(IdleAction(idle));
            }
            app.tick().expect("some action is legal");
            app.world().get::<Action>(agent).and_then(Action::discrete)
        };
        assert_eq!(played(2, Some(1)), Some(2), "it is legal");
        assert_eq!(played(3, Some(2)), Some(2));
        assert_eq!(played(0, Some(3)), Some(1), "the idle action is illegal too");
        assert_eq!(played(3, None), Some(1));
        assert_eq!(played(0, Some(9)), Some(1), "there is no such action");
    }

    #[test]
    fn an_action_outside_the_space_is_a_fault_under_a_mask_too() {
        let (mut app, _) = masked(BlindBot::Constant(ActionValue::Discrete(4)), &[true; 4]);
        let text = app.tick().expect_err("there are four").to_string();
        assert!(text.contains("discrete action 4 is outside of the numbers from 0 to 3"), "{text}");
    }

    #[test]
    fn people_and_replays_keep_illegal_actions() {
        for control in [Control::Human, Control::Replay] {
            let mut app = headless_app();
            let action = Action(ActionValue::Discrete(2));
            let agent =
                (Agent::new(0, ActionSpace::Discrete(3)), LegalActions::new([true, true, false]), control, action);
            let agent = app.world_mut().spawn(agent).id();
            app.tick().expect("the game ignores it");
            assert_eq!(app.world().get::<Action>(agent).and_then(Action::discrete), Some(2), "{control:?}");
        }
    }

    #[test]
    fn illegal_actions_are_redrawn_and_legal_ones_are_kept() {
        let mask = [false, true, false, true];
        for (planned, random, expected) in [(1, 7, 1), (3, 0, 3), (0, 0, 1), (2, 1, 3), (2, 2, 1)] {
            let mut app = headless_app();
            let legal = LegalActions::new(mask);
            let action = Action(ActionValue::Discrete(planned));
            let agent =
                (Agent::new(0, ActionSpace::Discrete(4)), legal, Control::Bot, action, RedrawsIllegal { random });
            let agent = app.world_mut().spawn(agent).id();
            app.tick().expect("some action is legal");
            let played = app.world().get::<Action>(agent).and_then(Action::discrete);
            assert_eq!(played, Some(expected), "{planned} with {random}");
        }
    }

    #[test]
    fn each_of_several_choices_keeps_to_its_own_mask() {
        let app_with = |mask: LegalActions, bot: BlindBot| {
            let mut app = headless_app();
            let space = ActionSpace::mixed([3, 2], 1);
            let agent = app.world_mut().spawn((Agent::new(0, space), mask, Control::Bot, bot)).id();
            (app, agent)
        };
        let mask = || LegalActions::of_choices([vec![false, true, true], vec![true, false]]);
        for bot in [BlindBot::Uniform, BlindBot::Chaos] {
            let (mut app, agent) = app_with(mask(), bot);
            let mut seen = std::collections::BTreeSet::new();
            for _ in 0..300 {
                app.tick().expect("something is legal");
                let action = app.world().get::<Action>(agent).expect("an agent has one");
                seen.insert([0, 1].map(|choice| action.option(choice)));
                assert!(action.continuous().is_some_and(|numbers| numbers.len() == 1));
            }
            assert_eq!(Vec::from_iter(seen), [[Some(1), Some(0)], [Some(2), Some(0)]]);
        }
        let wanted = ActionValue::Mixed { choices: vec![2, 1], numbers: vec![0.5] };
        let (mut app, agent) = app_with(mask(), BlindBot::Constant(wanted));
        app.tick().expect("something is legal");
        let played = ActionValue::Mixed { choices: vec![2, 0], numbers: vec![0.5] };
        assert_eq!(app.world().get::<Action>(agent), Some(&Action(played)), "the legal choice stays");
        let blocked = LegalActions::of_choices([vec![true; 3], vec![false; 2]]);
        let text = app_with(blocked, BlindBot::Uniform).0.tick().expect_err("no option").to_string();
        assert!(text.contains("agent 0") && text.contains("tick 0") && text.contains("option of choice 1"), "{text}");
        let short = LegalActions::new([true; 3]);
        let text = app_with(short, BlindBot::Uniform).0.tick().expect_err("one choice").to_string();
        assert!(text.contains("have 3 entries") && text.contains("2 choices (3 x 2)"), "{text}");
    }
}
