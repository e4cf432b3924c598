//! The input of a foreign game's agent, the mask of its actions, and the ticks that a decision holds.

use crate::{
    foreign::{
        ForeignGame,
        runtime::{ForeignCell, SystemFactory, note, playing_agents, with_foreign},
    },
    game::InputTools,
};
use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionSpace},
    agent::{Agent, Control},
    bot::with_noise,
    demo::{file::Decider, replay::Replay},
    engine::{TickSchedules, check_actions},
    episode::Episode,
    key_bindings::KeyBindings,
    legal::LegalActions,
    streams::AgentStreams,
    systems::{ObserveSchedule, PlaybotSystems},
    virtual_input::{ActionAxis, HeldInput, PointerPosition, PressSystems, UnknownInput, VirtualButton, VirtualInput},
};

/// Most choices that an agent makes separately in one tick.
const MOST_CHOICES_AT_ONCE: usize = playbot_learner::MOST_CHOICES;

/// Most discrete actions that `.choices` may bring.
const MOST_CHOICES: usize = 4096;

impl ForeignGame {
    /// Declares several choices at once, such as a direction and whether to jump: each combination of them is a
    /// discrete action. It holds the keys and buttons of all that were chosen. The last choice changes first from
    /// action to action. Takes the place of [`keys`](Self::keys).
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// let walk = vec![vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]];
    /// let jump = vec![vec![], vec![KeyCode::Space]];
    /// let game = ForeignGame::new("hop", 1, |_: &mut App| {}).choices([walk, jump]).observe(["x"], || [0.0]);
    /// assert_eq!(Game::actions(&game), ActionSpace::Discrete(6));
    /// let names = game.tools().input.action_names();
    /// assert_eq!(names[..4], ["nothing", "Space", "ArrowLeft", "ArrowLeft+Space"]);
    /// ```
    pub fn choices<B: Into<VirtualButton>>(
        self,
        choices: impl IntoIterator<Item = impl IntoIterator<Item = impl IntoIterator<Item = B>>>,
    ) -> Self {
        let choices = choices.into_iter();
        let choices = choices
            .map(|choice| choice.into_iter().map(|held| held.into_iter().map(Into::into).collect()).collect())
            .collect();
        self.with(|description| description.input.choices = choices)
    }

    /// Keeps the [`choices`](Self::choices) apart instead of combining them: a policy draws each of them by itself, and
    /// so does a bot. [`axes`](Self::axes) may stand beside them, for numbers. Choose it where combinations would be
    /// many.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_playbot::virtual_input::ActionAxis;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// let walk = vec![vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]];
    /// let jump = vec![vec![], vec![KeyCode::Space]];
    /// let game = ForeignGame::new("hop", 1, |_: &mut App| {}).choices([walk, jump]).separately();
    /// let game = game.axes([ActionAxis::stick(GamepadAxis::RightStickX)]).observe(["x"], || [0.0]);
    /// assert_eq!(Game::actions(&game), ActionSpace::mixed([3, 2], 1));
    /// assert_eq!(game.problem(), None);
    /// let names = game.tools().input.action_names();
    /// assert_eq!(names, ["nothing", "ArrowLeft", "ArrowRight", "nothing", "Space"]);
    /// ```
    pub fn separately(self) -> Self {
        self.with(|description| description.input.separate = true)
    }

    /// Adds positions of the mouse cursor to discrete actions, in the order of the actions; `None` leaves the cursor
    /// where it is. Mouse buttons of an action with a position are clicks: each tick presses them anew.
    ///
    /// A position outside of the window is a [`problem`](crate::game::Game::problem), or a fault of the first tick if
    /// only this window is too small.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_playbot::virtual_input::PointerPosition;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// // One action for each cell of a board of 3 by 3, which fills the window.
    /// let cells = |scale: f32| (0..9).map(move |cell| {
    ///     let (column, row) = ((cell % 3) as f32, (cell / 3) as f32);
    ///     Some(PointerPosition::fraction(scale * (column + 0.5), scale * (row + 0.5)))
    /// });
    /// let board = |scale: f32| {
    ///     let game = ForeignGame::new("board", 1, |_: &mut App| {}).observe(["x"], || [0.0]);
    ///     game.cursor(cells(scale)).mouse_buttons([[MouseButton::Left]; 9])
    /// };
    /// assert_eq!(board(1.0 / 3.0).problem(), None);
    /// let problem = board(0.5).problem().expect("the last column lies outside");
    /// assert!(problem.contains("fraction (1.25, 0.25) in action 2"), "{problem}");
    /// ```
    pub fn cursor(self, positions: impl IntoIterator<Item = impl Into<Option<PointerPosition>>>) -> Self {
        self.with(|description| description.input.cursor = positions.into_iter().map(Into::into).collect())
    }

    /// Adds taps on the touch screen to discrete actions, in the order of the actions; `None` taps nowhere. The finger
    /// is down in the tick of the action, and up before the next one. Positions are those of [`cursor`](Self::cursor).
    pub fn taps(self, positions: impl IntoIterator<Item = impl Into<Option<PointerPosition>>>) -> Self {
        self.with(|description| description.input.taps = positions.into_iter().map(Into::into).collect())
    }

    /// Adds turns of the mouse wheel to discrete actions, in the order of the actions and in lines: 1 is a notch upwards,
    /// -1 one downwards, 0 none. Each tick of the action turns it anew.
    pub fn wheel(self, lines: impl IntoIterator<Item = f32>) -> Self {
        self.with(|description| description.input.wheel = lines.into_iter().collect())
    }

    /// Adds discrete actions after those of keys, each of which types a text: in each tick of the action, each character
    /// goes down and up, as `KeyboardInput` with text. A line feed is the Enter key.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// let game = ForeignGame::new("name", 1, |_: &mut App| {}).observe(["x"], || [0.0]);
    /// let game = game.keys([vec![], vec![KeyCode::Escape]]).types(["Ada", "\n"]);
    /// assert_eq!(game.tools().input.action_names(), ["nothing", "Escape", "type \"Ada\"", "type \"\\n\""]);
    /// ```
    pub fn types(self, texts: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.with(|description| description.input.texts = texts.into_iter().map(Into::into).collect())
    }

    /// Adds discrete actions after all others, each of which clicks on a button of Bevy's UI. A button is named by its
    /// text, by its `Name`, or by a path of `Name`s above it, such as `Options/Back`. It needs the feature `ui` of this
    /// crate.
    ///
    /// Buttons are nodes with `Interaction`, and buttons, checkboxes, radio buttons, sliders and items of
    /// `bevy_ui_widgets`. If none of them has the name, nodes with an observer of their own for `Pointer<Click>`,
    /// `Pointer<Press>` or `Pointer<Release>` are searched, and then all nodes that have a `Name`.
    ///
    /// The mouse cursor moves to the middle of the button, and the left mouse button goes down, and up before the next
    /// tick. So `Interaction`, `ButtonInput<MouseButton>` and Bevy's picking see a person's click. Where no camera of a
    /// window lays the button out, the mouse stands still. Then `Interaction` is set, and the events of Bevy's picking
    /// are triggered at the button: `Pointer<Press>` in this tick, `Pointer<Click>` and `Pointer<Release>` in the next.
    ///
    /// A click has no effect if its button does not exist in this tick, is hidden, is disabled, or shares its name with
    /// another one. `ButtonClicks` on the agent counts them. The log has a warning that names the buttons if two share
    /// a name. It has another one if a button never existed in an episode that clicked on it.
    pub fn clicks(self, buttons: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.with(|description| description.input.clicks = buttons.into_iter().map(Into::into).collect())
    }

    /// Declares the legal actions of each tick: one value for each discrete action, true if it is legal. With choices that
    /// are made [`separately`](Self::separately), it is one value for each option of each choice, choice after choice. Random bots,
    /// the noise of demonstrators and explorers then draw among legal actions only, and policies give the others
    /// probability 0. The system may run more than once in a tick, so it must change nothing.
    ///
    /// A mask that forbids every action, or that has another length, is a fault.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// #[derive(Resource)]
    /// struct IsOpen(bool);
    ///
    /// let game = ForeignGame::new("door", 1, |app: &mut App| { app.insert_resource(IsOpen(false)); })
    ///     .keys([vec![], vec![KeyCode::KeyE]])
    ///     .observe(["open"], |open: Res<IsOpen>| [f32::from(u8::from(open.0))])
    ///     .legal(|open: Res<IsOpen>| [true, open.0]);
    /// assert_eq!(game.problem(), None);
    /// ```
    pub fn legal<Mask, M>(self, system: impl IntoSystem<(), Mask, M> + Clone + Send + Sync + 'static) -> Self
    where
        Mask: IntoIterator<Item = bool> + 'static,
        M: 'static,
    {
        self.with(|description| {
            description.legal = Some(SystemFactory::new(system, |mask: Mask| mask.into_iter().collect()));
        })
    }
}

impl ForeignGame {
    /// Lets each decision hold for so many ticks, instead of one. An episode begins with a decision. Until the next
    /// one, bots, explorers and policies repeat it: it is the only legal action. Held keys stay pressed, while clicks
    /// and taps are made in each tick. Rewards, recordings, time limits and skill intervals count ticks, as ever.
    ///
    /// People decide in each tick. SAC cannot learn numbers that are held. Agents without a `ForeignGame` may have a
    /// [`DecisionPeriod`](bevy_playbot::legal::DecisionPeriod), too.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// let walk = || {
    ///     let game = ForeignGame::new("walk", 1, |_: &mut App| {}).observe(["x"], || [0.0]);
    ///     game.keys([vec![], vec![KeyCode::ArrowRight]])
    /// };
    /// // Of 60 ticks a second, 15 are decisions.
    /// assert_eq!(walk().every(4).problem(), None);
    /// let problem = walk().every(0).problem().expect("no tick is a decision");
    /// assert!(problem.contains("`.every(1)`"), "{problem}");
    /// ```
    pub fn every(self, ticks: u32) -> Self {
        self.with(|description| description.input.every = Some(ticks))
    }

    /// Holds the keys of a decision for the first so many of the ticks of [`every`](Self::every), and lets them go for
    /// the rest: so the next decision presses them anew. Clicks, taps, the wheel and texts come in those first ticks
    /// only. The action itself stays that of the decision, also in recordings. People hold what they please, and
    /// replays of their recordings do as they did.
    ///
    /// More ticks than a decision has are a [`problem`](crate::game::Game::problem), and so are
    /// [`actions`](Self::actions) that a system passes on.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, prelude::*};
    ///
    /// let jump = || {
    ///     let game = ForeignGame::new("hop", 1, |_: &mut App| {}).observe(["y"], || [0.0]);
    ///     game.keys([vec![], vec![KeyCode::Space]])
    /// };
    /// // Ten decisions a second, which hold the key for two frames and let it go for four.
    /// assert_eq!(jump().every(6).hold(2).problem(), None);
    /// let problem = jump().every(6).hold(7).problem().expect("too long");
    /// assert!(problem.contains("type `.hold(6)` or less"), "{problem}");
    /// ```
    pub fn hold(self, ticks: u32) -> Self {
        self.with(|description| description.input.hold = Some(ticks))
    }
}

/// The parts of the path from an action into the game, set in any order.
#[derive(Clone, Default)]
pub(super) struct Input {
    /// The keys of each discrete action, and other buttons that were set by name.
    pub(super) keys: Vec<Vec<VirtualButton>>,
    /// The choices whose combinations are the discrete actions, in place of keys.
    pub(super) choices: Vec<Vec<Vec<VirtualButton>>>,
    /// True if each choice is made by itself, and they are not combined.
    pub(super) separate: bool,
    /// The first unknown name of a key, and its action.
    pub(super) unknown_key: Option<(usize, UnknownInput)>,
    /// The mouse buttons of each discrete action.
    pub(super) mouse: Vec<Vec<MouseButton>>,
    /// The gamepad buttons of each discrete action.
    pub(super) pads: Vec<Vec<GamepadButton>>,
    /// The position of the mouse cursor in each discrete action.
    pub(super) cursor: Vec<Option<PointerPosition>>,
    /// The tap on the touch screen in each discrete action.
    pub(super) taps: Vec<Option<PointerPosition>>,
    /// The lines by which each discrete action turns the mouse wheel.
    pub(super) wheel: Vec<f32>,
    /// The texts that further actions type, after those above.
    pub(super) texts: Vec<String>,
    /// The buttons of Bevy's UI that further actions click on, after those above.
    pub(super) clicks: Vec<String>,
    /// The axis that each value of a continuous action moves.
    pub(super) axes: Option<Vec<ActionAxis>>,
    /// The complete input, if it was set as a whole.
    pub(super) whole: Option<VirtualInput>,
    /// The actions of games with a system of their own for them.
    pub(super) space: Option<ActionSpace>,
    /// Names of the actions.
    pub(super) names: Vec<String>,
    /// Ticks that a decision holds; 1 if not set.
    pub(super) every: Option<u32>,
    /// The first ticks of them in which its keys are held; all if not set.
    pub(super) hold: Option<u32>,
}

impl Input {
    /// Sets the keys of each action.
    pub(super) fn set_keys(&mut self, sets: impl IntoIterator<Item = impl IntoIterator<Item = KeyCode>>) {
        self.keys = sets.into_iter().map(|set| set.into_iter().map(VirtualButton::Key).collect()).collect();
        self.unknown_key = None;
    }

    /// Sets the keys of each action by their names. An unknown name becomes the [`problem`](Self::problem).
    pub(super) fn name_keys(&mut self, sets: impl IntoIterator<Item = impl IntoIterator<Item = impl AsRef<str>>>) {
        (self.keys, self.unknown_key) = (Vec::new(), None);
        for (action, names) in sets.into_iter().enumerate() {
            let mut keys = Vec::new();
            for name in names {
                match name.as_ref().parse::<VirtualButton>() {
                    Ok(key) => keys.push(key),
                    Err(unknown) => {
                        self.unknown_key.get_or_insert((action, unknown));
                    }
                }
            }
            self.keys.push(keys);
        }
    }

    pub(super) fn space(&self) -> ActionSpace {
        let pressed = || self.pressed().map(|pressed| pressed.space());
        self.space.or_else(pressed).unwrap_or(ActionSpace::Discrete(0))
    }

    /// Returns the input that the parts press together; `None` for a game in which nothing is pressed. Clicks on the UI
    /// press nothing yet: each tick aims them anew.
    pub(super) fn pressed(&self) -> Option<VirtualInput> {
        let Some(held) = self.held() else {
            let nothing = self.clicks.iter().map(|_| HeldInput::default());
            return (!self.clicks.is_empty()).then(|| VirtualInput::discrete(nothing));
        };
        Some(held.and_actions(self.clicks.iter().map(|_| HeldInput::default())))
    }

    /// Returns the input of all actions but clicks on the UI.
    fn held(&self) -> Option<VirtualInput> {
        let sets = self.sets();
        let is_pointed = !(self.cursor.is_empty() && self.taps.is_empty() && self.wheel.is_empty());
        let is_held = !(sets.is_empty() && self.mouse.is_empty() && self.pads.is_empty());
        let is_discrete = is_pointed || is_held || !self.texts.is_empty();
        let base = match (&self.whole, &self.axes) {
            (Some(whole), _) => whole.clone(),
            (None, axes) if self.is_separate() => {
                let held =
                    |options: &Vec<Vec<VirtualButton>>| options.iter().cloned().map(HeldInput::new).collect::<Vec<_>>();
                VirtualInput::choices(self.choices.iter().map(held), axes.iter().flatten().cloned())
            }
            (None, Some(axes)) => VirtualInput::axes(axes.iter().cloned()),
            (None, None) if is_discrete => VirtualInput::discrete(sets.into_iter().map(HeldInput::new)),
            (None, None) => return None,
        };
        match base.space() {
            ActionSpace::Discrete(_) => {
                let buttons = base.mouse_buttons(self.mouse.clone()).gamepad_buttons(self.pads.clone());
                let pointed = buttons.cursor(self.cursor.clone()).taps(self.taps.clone()).wheel(self.wheel.clone());
                Some(pointed.and_actions(self.texts.iter().map(|text| HeldInput::default().types(text))))
            }
            ActionSpace::Continuous(_) | ActionSpace::Mixed(_) => Some(base),
        }
    }

    /// Returns why a tick cannot be saved, if actions hold more than keys and mouse buttons. Actions that the game's own
    /// system passes on can be saved.
    pub(super) fn unsaved(&self) -> Option<String> {
        let is_pad = |button: &VirtualButton| matches!(button, VirtualButton::Gamepad(_));
        let parts = [
            ("gamepad buttons", !self.pads.is_empty() || self.sets().iter().flatten().any(is_pad)),
            ("`.cursor`", !self.cursor.is_empty()),
            ("`.taps`", !self.taps.is_empty()),
            ("`.wheel`", !self.wheel.is_empty()),
            ("`.types`", !self.texts.is_empty()),
            ("`.clicks`", !self.clicks.is_empty()),
            ("`.axes`", self.axes.is_some()),
            ("`.input`", self.whole.is_some()),
        ];
        let parts: Vec<&str> = parts.into_iter().filter_map(|(name, is_said)| is_said.then_some(name)).collect();
        (!parts.is_empty()).then(|| format!("snapshots do not hold the state of {}", parts.join(" and ")))
    }

    /// Returns the problem of the input: an unknown key, or parts that contradict each other. The text follows the name
    /// of the game.
    pub(super) fn problem(&self) -> Option<String> {
        if let Some((action, unknown)) = &self.unknown_key {
            return Some(format!("names a key that does not exist, in action {action}: {unknown}"));
        }
        if let Some(problem) = self.problem_of_choices() {
            return Some(problem);
        }
        let said = [
            ("`.keys`", !self.keys.is_empty()),
            ("`.choices`", !self.choices.is_empty()),
            ("`.axes`", self.axes.is_some() && !self.is_separate()),
            ("`.input`", self.whole.is_some()),
        ];
        let said: Vec<&str> = said.into_iter().filter_map(|(name, is_said)| is_said.then_some(name)).collect();
        if said.len() > 1 {
            return Some(format!("has {}, and each of them declares every action: keep one", said.join(" and ")));
        }
        let problem = self.problem_of_clicks().or_else(|| self.problem_of_period()).or_else(|| self.problem_of_hold());
        if problem.is_some() {
            return problem;
        }
        let pressed = self.pressed()?;
        if let Some((action, position)) = pressed.impossible_position() {
            return Some(format!(
                "points at {position} in action {action}, outside of any window: positions are logical pixels from the \
                 top left corner, or fractions from 0 to below 1"
            ));
        }
        if let Some(action) = pressed.two_pointers() {
            return Some(format!(
                "moves the mouse cursor and taps on the screen in action {action}, and games expect one pointer: give \
                 each an action of its own in `.cursor` and `.taps`, and `None` in the other one"
            ));
        }
        let discrete = [
            ("`.mouse_buttons`", !self.mouse.is_empty()),
            ("`.gamepad_buttons`", !self.pads.is_empty()),
            ("`.cursor`", !self.cursor.is_empty()),
            ("`.taps`", !self.taps.is_empty()),
            ("`.wheel`", !self.wheel.is_empty()),
            ("`.types`", !self.texts.is_empty()),
            ("`.clicks`", !self.clicks.is_empty()),
        ];
        let (part, _) = discrete.into_iter().find(|(_, is_said)| *is_said)?;
        match pressed.space() {
            ActionSpace::Discrete(_) => None,
            ActionSpace::Continuous(_) => Some(format!(
                "has {part}, which belong to discrete actions, and continuous ones: buttons of these are \
                 `ActionAxis::buttons` in `.axes`"
            )),
            ActionSpace::Mixed(_) => Some(format!(
                "has {part}, which belong to combined actions, and `.separately`: name buttons of mouse and gamepad in \
                 `.choices`, or leave `.separately` out"
            )),
        }
    }

    /// Returns whether each of its choices is made by itself.
    fn is_separate(&self) -> bool {
        self.separate && !self.choices.is_empty()
    }

    /// Returns the problem of the choices and of the texts.
    fn problem_of_choices(&self) -> Option<String> {
        if let Some(number) = self.choices.iter().position(Vec::is_empty) {
            return Some(format!("has `.choices` with nothing to choose in choice {number}: give it sets of keys"));
        }
        if self.separate && self.choices.is_empty() {
            return Some("has `.separately` and no `.choices` to keep apart: add them, or leave it out".to_owned());
        }
        if self.is_separate() && self.choices.len() > MOST_CHOICES_AT_ONCE {
            return Some(format!(
                "makes {} choices separately, and {MOST_CHOICES_AT_ONCE} are possible: combine some of them",
                self.choices.len()
            ));
        }
        if !self.is_separate() && self.combinations().is_none() {
            return Some(format!(
                "has `.choices` with more than {MOST_CHOICES} combinations: leave some out, or make them `.separately`"
            ));
        }
        if self.wheel.iter().any(|lines| !lines.is_finite()) {
            return Some("has `.wheel` with a number that is not finite: give lines, such as 1 and -1".to_owned());
        }
        let is_empty = self.texts.iter().any(String::is_empty);
        is_empty.then(|| "has `.types` with an empty text: give one or more characters".to_owned())
    }

    /// Returns the number of combinations of the choices; `None` if there are too many.
    fn combinations(&self) -> Option<usize> {
        let number = self.choices.iter().try_fold(1_usize, |number, choice| number.checked_mul(choice.len()))?;
        (number <= MOST_CHOICES).then_some(number)
    }

    /// Returns the keys and buttons of each discrete action: those that were set, or the combinations of the choices.
    fn sets(&self) -> Vec<Vec<VirtualButton>> {
        if self.is_separate() || self.choices.is_empty() || self.combinations().is_none() {
            return self.keys.clone();
        }
        self.choices.iter().fold(vec![Vec::new()], |sets, choice| {
            let with = |set: &Vec<VirtualButton>, more: &Vec<VirtualButton>| {
                let mut all = set.clone();
                more.iter().filter(|button| !set.contains(button)).for_each(|button| all.push(*button));
                all
            };
            sets.iter().flat_map(|set| choice.iter().map(move |more| with(set, more))).collect()
        })
    }

    /// Returns the problem of the clicks on the UI.
    fn problem_of_clicks(&self) -> Option<String> {
        if self.clicks.is_empty() {
            return None;
        }
        if self.space.is_some() {
            return Some("has `.clicks` and `.actions`, and the latter declares every action: keep one".to_owned());
        }
        if self.clicks.iter().any(|name| name.trim().is_empty()) {
            return Some("has `.clicks` with an empty name: give the text or the `Name` of a button".to_owned());
        }
        (!cfg!(feature = "ui"))
            .then(|| "has `.clicks`, which needs the feature `ui` of `playbot`: build with it".to_owned())
    }

    /// Returns the problem of the ticks that a decision holds.
    fn problem_of_period(&self) -> Option<String> {
        match self.every? {
            0 => Some(
                "has `.every(0)`, but a decision holds for at least one tick: type `.every(1)`, or leave it out"
                    .to_owned(),
            ),
            _ => None,
        }
    }

    /// Returns the problem of the ticks in which a decision holds its keys.
    fn problem_of_hold(&self) -> Option<String> {
        let (hold, every) = (self.hold?, self.every.unwrap_or(1));
        if hold == 0 {
            return Some(
                "has `.hold(0)`, but keys are held for at least one tick: type `.hold(1)`, or leave it out".to_owned(),
            );
        }
        if self.space.is_some() {
            return Some(
                "has `.hold` and `.actions`, whose system passes the action on in each tick: leave `.hold` out"
                    .to_owned(),
            );
        }
        (hold > every).then(|| match self.every {
            Some(_) => format!(
                "has `.hold({hold})`, but a decision of `.every({every})` ends before: type `.hold({every})` or less"
            ),
            None => format!(
                "has `.hold({hold})`, but a decision is one tick: add `.every` with more ticks, such as `.every({})`",
                hold.saturating_mul(2)
            ),
        })
    }

    /// Returns whether decisions let their keys go before they end.
    pub(super) fn rests(&self) -> bool {
        self.hold.is_some_and(|hold| hold < self.every.unwrap_or(1))
    }

    /// Returns whether a decision has let its keys go by this tick of an episode.
    fn is_resting(&self, tick: u32) -> bool {
        self.rests() && self.hold.is_some_and(|hold| tick % self.every.unwrap_or(1) >= hold)
    }

    /// Returns whether decisions hold for more than one tick.
    pub(super) fn holds(&self) -> bool {
        self.every.is_some_and(|ticks| ticks > 1)
    }

    /// Returns the number of the first action that clicks on the UI, and the names of the buttons.
    #[cfg(feature = "ui")]
    pub(super) fn clicked(&self) -> (usize, &[String]) {
        let others = match self.held().map(|held| held.space()) {
            Some(ActionSpace::Discrete(others)) => others,
            _ => 0,
        };
        (others, &self.clicks)
    }

    /// Returns the names that were set, or those of what the actions hold.
    pub(super) fn names(&self) -> Vec<String> {
        if !self.names.is_empty() {
            return self.names.clone();
        }
        let of_texts = self.texts.iter().map(|text| format!("type {text:?}"));
        let of_clicks = self.clicks.iter().map(|name| format!("click {name}"));
        let sets = self.sets();
        let others = self.texts.len() + self.clicks.len();
        if self.is_separate() && self.space.is_none() {
            return self.choices.iter().flatten().map(|held| name_of_keys(held)).collect();
        }
        let ActionSpace::Discrete(actions) = self.space() else { return Vec::new() };
        if actions == sets.len() + others {
            return sets.iter().map(|set| name_of_keys(set)).chain(of_texts).chain(of_clicks).collect();
        }
        if self.space.is_some() || self.whole.is_some() || actions < others {
            return Vec::new();
        }
        let of_held = (0..actions - others).map(|action| self.name_of_held(&sets, action));
        of_held.chain(of_texts).chain(of_clicks).collect()
    }

    /// Returns the name of an action by its keys, its buttons and what it does with the mouse and the touch screen. It
    /// has no comma, since commas separate actions on the command line.
    fn name_of_held(&self, sets: &[Vec<VirtualButton>], action: usize) -> String {
        let mouse = self.mouse.get(action).into_iter().flatten().copied().map(VirtualButton::Mouse);
        let pads = self.pads.get(action).into_iter().flatten().copied().map(VirtualButton::Gamepad);
        let held: Vec<VirtualButton> =
            sets.get(action).into_iter().flatten().copied().chain(mouse).chain(pads).collect();
        let cursor = self.cursor.get(action).copied().flatten().map(name_of_position);
        let mut parts = match cursor {
            Some(at) if held == [VirtualButton::Mouse(MouseButton::Left)] => vec![format!("click {at}")],
            Some(at) if held.is_empty() => vec![format!("cursor {at}")],
            Some(at) => vec![format!("{} at {at}", name_of_keys(&held))],
            None if held.is_empty() => Vec::new(),
            None => vec![name_of_keys(&held)],
        };
        parts.extend(self.taps.get(action).copied().flatten().map(|at| format!("tap {}", name_of_position(at))));
        let turned = self.wheel.get(action).filter(|lines| **lines != 0.0);
        parts.extend(turned.map(|lines| format!("wheel {lines:+}")));
        if parts.is_empty() { name_of_keys(&[]) } else { parts.join(" and ") }
    }

    /// Returns the keys of a person: for games that are played with keys alone.
    pub(super) fn bindings(&self) -> Option<KeyBindings> {
        let key = |button: &VirtualButton| match button {
            VirtualButton::Key(key) => Some(*key),
            VirtualButton::Mouse(_) | VirtualButton::Gamepad(_) => None,
        };
        let sets = self.sets();
        let sets = sets.iter().map(|set| set.iter().map(key).collect::<Option<Vec<KeyCode>>>());
        let sets: Vec<Vec<KeyCode>> = sets.collect::<Option<_>>()?;
        let is_keys = self.space.is_none()
            && !sets.is_empty()
            && self.pressed() == Some(VirtualInput::keys(sets.iter().cloned()));
        is_keys.then(|| KeyBindings::of_sets(&sets))
    }
}

/// Returns the name of keys and buttons that are held together.
fn name_of_keys(held: &[VirtualButton]) -> String {
    match held {
        [] => "nothing".to_owned(),
        held => held.iter().map(VirtualButton::to_string).collect::<Vec<_>>().join("+"),
    }
}

/// Returns a position in pixels, or in hundredths of the window's width and height.
fn name_of_position(position: PointerPosition) -> String {
    let percent = |fraction: f32| (fraction * 1000.0).round() / 10.0;
    match position {
        PointerPosition::Pixels(at) => format!("{} {}", at.x, at.y),
        PointerPosition::Fraction(at) => format!("{}% {}%", percent(at.x), percent(at.y)),
    }
}

impl InputTools for ForeignGame {
    fn action_names(&self) -> Vec<String> {
        self.description.first_input().names()
    }

    fn key_bindings(&self) -> Option<KeyBindings> {
        self.description.first_input().bindings()
    }

    fn records_people(&self) -> bool {
        let input = self.description.first_input();
        input.space.is_none() && input.pressed().is_some()
    }

    fn has_idle_action(&self) -> bool {
        let input = self.description.first_input();
        let pressed = input.pressed().filter(|_| input.space.is_none());
        pressed.is_none_or(|pressed| match pressed.space() {
            ActionSpace::Discrete(actions) => pressed.has_idle_action(actions - input.clicks.len()),
            ActionSpace::Continuous(_) | ActionSpace::Mixed(_) => pressed.has_idle_action(0),
        })
    }
}

/// Lets the game's own system pass the action on, except for people, who have their own devices.
pub(super) fn act(world: &mut World) {
    for agent in playing_agents(world) {
        if world.get(agent) == Some(&Control::Human) {
            continue;
        }
        with_foreign(world, agent, |world, foreign| match &mut foreign.asked().act {
            Some(system) => system.demand(world),
            None => Ok(()),
        });
    }
}

/// Marks an agent that a scripted bot of the game plays while its control is [`Control::Bot`].
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub(super) struct ForeignBot {
    /// Its name; `None` for the demonstrator.
    pub(super) name: Option<&'static str>,
    /// Probability of a random action, or standard deviation of the noise.
    pub(super) noise: f64,
}

pub(super) fn decide(world: &mut World) {
    for agent in playing_agents(world) {
        decide_for(world, agent);
    }
}

fn decide_for(world: &mut World, agent: Entity) {
    let (Some(&ForeignBot { name, noise }), Some(Control::Bot)) = (world.get(agent), world.get::<Control>(agent))
    else {
        return;
    };
    let planned = with_foreign(world, agent, |world, foreign| {
        // It sees every tick, since it may count them, also if an earlier decision holds.
        foreign.asked().bot(name)?.demand(world)
    });
    let Some(planned) = planned else { return };
    let mut entity = world.entity_mut(agent);
    let Some(space) = entity.get::<Agent>().map(|agent| agent.actions) else { return };
    let legal = entity.get::<LegalActions>().cloned();
    let Some(mut streams) = entity.get_mut::<AgentStreams>() else { return };
    let chosen = with_noise(planned, &space, legal.as_ref(), noise, &mut streams.action);
    entity.insert(Action(chosen));
}

/// Adds the system that lets keys go before the next decision, if the game wants that.
pub(super) fn add_rest(app: &mut App, input: &Input) {
    if !input.rests() {
        return;
    }
    let decide = TickSchedules::of(app).decide;
    app.add_systems(
        decide,
        // No other system lets the inputs of an agent go.
        rest.in_set(PlaybotSystems::Act).after(check_actions).before(PressSystems).ambiguous_with(PlaybotSystems::Act),
    );
}

fn rest(world: &mut World) {
    let Some(game) = world.get_resource::<ForeignCell>().map(|cell| cell.lock().game.clone()) else { return };
    for agent in playing_agents(world) {
        let is_resting = rests_now(world, agent, &game.description.input);
        if let Some(mut input) = world.get_mut::<VirtualInput>(agent) {
            input.rest(is_resting);
        }
    }
}

/// Returns whether the agent's decision has let its keys go. People hold theirs as long as they please. A replay does
/// what they did.
pub(super) fn rests_now(world: &World, agent: Entity, input: &Input) -> bool {
    let Some(tick) = world.get::<Episode>(agent).map(|episode| episode.tick) else { return false };
    let is_person = match world.get::<Control>(agent) {
        Some(Control::Human) => true,
        Some(Control::Replay) => {
            let deciders = world.get::<Replay>(agent).map(|replay| &replay.episode().deciders);
            deciders.and_then(|deciders| deciders.get(tick as usize)) == Some(&Decider::Human)
        }
        _ => false,
    };
    !is_person && input.is_resting(tick)
}

/// Adds the system that keeps the mask of the agent's actions up to date.
pub(super) fn add_mask(app: &mut App) {
    app.add_systems(ObserveSchedule, mask);
}

pub(super) fn mask(world: &mut World) {
    for agent in playing_agents(world) {
        let legal = with_foreign(world, agent, |world, foreign| {
            let space = foreign.game.description.input.space();
            Ok(match &mut foreign.asked().legal {
                Some(system) => LegalActions::of_space(&space, system.demand(world)?),
                None => LegalActions::all(&space),
            })
        });
        if let Some(legal) = legal {
            note(world, agent, Some(legal));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(add: impl Fn(ForeignGame) -> ForeignGame) -> Vec<String> {
        let game = add(ForeignGame::new("board", 1, |_: &mut App| {}).observe(["x"], || [0.0]));
        InputTools::action_names(&game)
    }

    #[test]
    fn actions_of_the_mouse_are_named_by_where_they_point() {
        let cells = [None, Some(PointerPosition::fraction(1.0 / 6.0, 0.5)), Some(PointerPosition::pixels(160.0, 80.0))];
        let clicked =
            names(|game| game.cursor(cells).mouse_buttons([vec![], vec![MouseButton::Left]]).clicks(["Start"]));
        assert_eq!(clicked, ["nothing", "click 16.7% 50%", "cursor 160 80", "click Start"]);
        let turned = names(|game| {
            let held = [vec![], vec![MouseButton::Right]];
            game.cursor(cells).mouse_buttons(held).taps([None, None, cells[1]]).wheel([-1.0, 0.0, 0.5])
        });
        let right = format!("{} at 16.7% 50%", VirtualButton::Mouse(MouseButton::Right));
        assert_eq!(turned, ["wheel -1", &right, "cursor 160 80 and tap 16.7% 50% and wheel +0.5"]);
    }

    #[test]
    fn names_that_policies_may_have_stored_stay_those_of_keys() {
        let held = [vec![], vec![MouseButton::Left]];
        assert_eq!(
            names(|game| game.keys([vec![], vec![KeyCode::KeyW]]).mouse_buttons(held.clone())),
            ["nothing", "KeyW"]
        );
        let named = names(|game| game.mouse_buttons(held.clone()).action_names(["wait", "go"]));
        assert_eq!(named, ["wait", "go"]);
    }
}
