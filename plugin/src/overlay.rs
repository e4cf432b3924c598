//! The overlay: what an agent does and why, over the picture of the game.
//!
//! Add [`PlaybotOverlay`] to a game with a window and Bevy's UI. It shows the agent with the lowest number: who holds
//! the controls, action and keys, value, reward and return, the current skill as bars with the ticks that are left of
//! it, notes such as those of detectors, and where the agent has been, coloured by skill. F8 hides it.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{overlay::{OverlayNote, PlaybotOverlay}, prelude::*};
//!
//! let mut app = headless_app();
//! // A game with a window has the UI of `DefaultPlugins`; without it the overlay is only a tree of nodes.
//! app.add_plugins(PlaybotOverlay::default());
//! app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Bot, BlindBot::Uniform));
//! app.world_mut().trigger(OverlayNote("stuck for 60 ticks".to_owned()));
//! app.ticks(10).expect("no agent broke its contract");
//! let mut texts = app.world_mut().query::<&Text>();
//! let shown = texts.iter(app.world()).map(|text| text.0.as_str()).collect::<String>();
//! assert!(shown.contains("bot plays") && shown.contains("stuck for 60 ticks"), "{shown}");
//! ```
//!
//! It reads the World and changes nothing in it but its own nodes. The words change four times a second at most, so that
//! text is laid out seldom: see [`PERIOD`].
//!
//! `trail`, the only file of the folder, draws where the agent has been.

mod trail;

use crate::{
    action::{Action, ActionValue},
    agent::{AgentOrder, Control},
    episode::{Episode, Tick},
    policy::Decision,
    reward::Reward,
    skill_prior::{ActiveSkill, NamedSkill, SkillPrior},
    virtual_input::VirtualInput,
};
use bevy::{input::ButtonInput, prelude::*, text::FontSize};
use std::{collections::VecDeque, fmt::Write, time::Duration};

/// Shortest time between two changes of the words.
pub const PERIOD: Duration = Duration::from_millis(250);

/// Time for which a note is shown.
const NOTE: Duration = Duration::from_secs(6);

/// Largest number of notes that are shown at a time.
const NOTES: usize = 4;

/// Largest number of values of a skill that are shown as bars.
const BARS: usize = 16;

/// Height of a bar from -1 to 1, in pixels of the window.
const HEIGHT: f32 = 36.0;

const TEXT: Color = Color::srgb(0.93, 0.94, 0.96);
const BACK: Color = Color::srgba(0.05, 0.06, 0.09, 0.72);
const BAR: Color = Color::srgb(0.36, 0.68, 0.95);
const RAIL: Color = Color::srgba(1.0, 1.0, 1.0, 0.16);

/// Shows what the agent with the lowest number does: see [the module](self).
#[derive(Clone, Copy, Debug)]
pub struct PlaybotOverlay {
    /// The key that hides and shows it; `None` for no key.
    pub key: Option<KeyCode>,
    /// False to begin hidden.
    pub is_shown: bool,
}

impl Default for PlaybotOverlay {
    fn default() -> Self {
        Self { key: Some(KeyCode::F8), is_shown: true }
    }
}

impl Plugin for PlaybotOverlay {
    fn build(&self, app: &mut App) {
        let Self { key, is_shown } = *self;
        app.insert_resource(Overlay { key, is_shown, ..Overlay::default() })
            .add_observer(note)
            .add_systems(Last, (hear_key, show).chain());
        trail::build(app);
    }
}

/// A note to show for six seconds, such as the finding of a detector. Trigger it.
#[derive(Event, Clone, Debug, PartialEq, Eq, Reflect)]
pub struct OverlayNote(pub String);

/// Names for the overlay, on the agent.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component)]
pub struct OverlayNames {
    /// The name of what decides, in place of that of [`Control`].
    pub decider: Option<String>,
    /// Names of the actions, in their order; may be empty.
    pub actions: Vec<String>,
    /// Names of regions of skills.
    pub skills: Vec<NamedSkill>,
    /// A further line, such as the progress of a lesson.
    pub line: Option<String>,
}

/// The entity whose transform says where the agent is, if it is not that of the agent itself.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct OverlayPosition(pub Entity);

/// The state of the overlay.
#[derive(Resource, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Overlay {
    /// True while it is shown.
    pub is_shown: bool,
    key: Option<KeyCode>,
    /// Notes and the times at which they end.
    notes: VecDeque<(String, Duration)>,
    root: Option<Entity>,
    text: Option<Entity>,
    bars: Vec<Entity>,
    /// Time of the last change of the words.
    changed: Duration,
}

fn note(event: On<OverlayNote>, clock: Res<Time<Real>>, mut overlay: ResMut<Overlay>) {
    let ends = clock.elapsed() + NOTE;
    overlay.notes.retain(|(words, _)| *words != event.0);
    overlay.notes.push_back((event.0.clone(), ends));
    while overlay.notes.len() > NOTES {
        overlay.notes.pop_front();
    }
}

impl Overlay {
    /// Hides it, or shows it again, as its key does.
    pub fn toggle(&mut self) {
        self.is_shown = !self.is_shown;
        // At once, not at the next change of the words.
        self.changed = Duration::ZERO;
    }
}

fn hear_key(keys: Option<Res<ButtonInput<KeyCode>>>, mut overlay: ResMut<Overlay>) {
    if let (Some(keys), Some(key)) = (keys, overlay.key)
        && keys.just_pressed(key)
    {
        overlay.toggle();
    }
}

/// The components of the agent that are shown.
type Shown = (
    &'static Control,
    &'static Episode,
    &'static Action,
    &'static Reward,
    &'static Decision,
    &'static ActiveSkill,
    Option<&'static VirtualInput>,
    Option<&'static OverlayNames>,
);

/// Writes the words and sets the bars.
fn show(
    clock: Res<Time<Real>>,
    tick: Res<Tick>,
    (order, prior): (Res<AgentOrder>, Option<Res<SkillPrior>>),
    agents: Query<Shown>,
    mut overlay: ResMut<Overlay>,
    (mut texts, mut nodes, mut sight): (Query<&mut Text>, Query<&mut Node>, Query<&mut Visibility>),
    mut commands: Commands,
) {
    let now = clock.elapsed();
    // A game may despawn whatever it does not know when a level starts again.
    if overlay.root.is_some_and(|root| !sight.contains(root)) {
        overlay.root = None;
    }
    let is_due = overlay.root.is_none() || overlay.changed.is_zero() || now.saturating_sub(overlay.changed) >= PERIOD;
    if !is_due {
        return;
    }
    overlay.changed = now.max(Duration::from_nanos(1));
    if !overlay.is_shown {
        set_sight(&overlay, &mut sight, Visibility::Hidden);
        return;
    }
    let agent = order.entities().first().copied();
    let Some((control, episode, action, reward, decision, skill, input, names)) =
        agent.and_then(|agent| agents.get(agent).ok())
    else {
        return;
    };
    overlay.notes.retain(|(_, ends)| *ends > now);
    let z = if *control == Control::Policy { skill.z.as_slice() } else { &[] };
    let left = prior.map(|prior| (skill.ticks_left, prior.skill_interval));
    let names = names.cloned().unwrap_or_default();
    let words =
        Words { control: *control, episode, action: &action.0, reward, decision, z, left, input, names: &names };
    let mut words = words.write(*tick);
    for (note, _) in &overlay.notes {
        let _ = write!(words, "\n! {note}");
    }
    let (bars, count) = (overlay.bars.len(), z.len().min(BARS));
    if overlay.root.is_none() || bars != count {
        rebuild(&mut overlay, count, words, &mut commands);
        return;
    }
    set_sight(&overlay, &mut sight, Visibility::Inherited);
    if let Some(mut text) = overlay.text.and_then(|text| texts.get_mut(text).ok())
        && text.0 != words
    {
        text.0 = words;
    }
    for (&bar, &value) in overlay.bars.iter().zip(z) {
        if let Ok(mut node) = nodes.get_mut(bar) {
            let (top, height) = extent(value);
            if (node.top, node.height) != (top, height) {
                (node.top, node.height) = (top, height);
            }
        }
    }
}

fn set_sight(overlay: &Overlay, sight: &mut Query<&mut Visibility>, wanted: Visibility) {
    if let Some(mut seen) = overlay.root.and_then(|root| sight.get_mut(root).ok()) {
        seen.set_if_neq(wanted);
    }
}

/// Returns the distance of a bar from the top and its height. The middle is 0, and values beyond ±1 are cut.
fn extent(value: f32) -> (Val, Val) {
    let value = value.clamp(-1.0, 1.0);
    let half = 0.5 * HEIGHT;
    // Whole pixels, so that a change that is not seen lays out nothing.
    let length = (value.abs() * half).round().max(1.0);
    (Val::Px(if value > 0.0 { half - length } else { half }), Val::Px(length))
}

/// Spawns the nodes, with bars for a skill of so many values.
fn rebuild(overlay: &mut Overlay, count: usize, words: String, commands: &mut Commands) {
    if let Some(old) = overlay.root.take() {
        commands.entity(old).try_despawn();
    }
    let root = commands
        .spawn((
            Name::new("playbot overlay"),
            Node {
                position_type: PositionType::Absolute,
                left: Val::Px(8.0),
                top: Val::Px(8.0),
                padding: UiRect::all(Val::Px(8.0)),
                row_gap: Val::Px(6.0),
                flex_direction: FlexDirection::Column,
                ..default()
            },
            BackgroundColor(BACK),
            GlobalZIndex(i32::MAX - 1),
        ))
        .id();
    let font = TextFont { font_size: FontSize::Px(13.0), ..default() };
    let text = commands.spawn((Text(words), font, TextColor(TEXT), ChildOf(root))).id();
    overlay.bars.clear();
    if count > 0 {
        let row = commands.spawn((Node { column_gap: Val::Px(4.0), ..default() }, ChildOf(root))).id();
        for _ in 0..count {
            let rail = Node { width: Val::Px(9.0), height: Val::Px(HEIGHT), ..default() };
            let rail = commands.spawn((rail, BackgroundColor(RAIL), ChildOf(row))).id();
            let (top, height) = extent(0.0);
            let bar =
                Node { position_type: PositionType::Absolute, top, height, width: Val::Percent(100.0), ..default() };
            overlay.bars.push(commands.spawn((bar, BackgroundColor(BAR), ChildOf(rail))).id());
        }
    }
    (overlay.root, overlay.text) = (Some(root), Some(text));
}

/// What the words are made of.
struct Words<'a> {
    control: Control,
    episode: &'a Episode,
    action: &'a ActionValue,
    reward: &'a Reward,
    decision: &'a Decision,
    z: &'a [f32],
    /// Ticks that are left of the skill, and ticks for which one is used.
    left: Option<(u32, u32)>,
    input: Option<&'a VirtualInput>,
    names: &'a OverlayNames,
}

impl Words<'_> {
    fn write(&self, tick: Tick) -> String {
        let decider = self.names.decider.as_deref().unwrap_or(match self.control {
            Control::Human => "you play",
            Control::Bot => "bot plays",
            Control::Policy => "policy plays",
            Control::Replay => "recording plays",
            Control::Idle => "no player",
        });
        let Episode { level, tick: of_episode, total_reward, .. } = self.episode;
        let mut words = format!("{decider}\nlevel {level}  tick {of_episode} ({} in all)", tick.0);
        let _ = write!(words, "\naction {}", self.action_words());
        let _ = write!(words, "\nreward {:+.3}  return {total_reward:.2}", self.reward.get());
        if self.control == Control::Policy {
            let _ = write!(words, "  value {:.2}", self.decision.value);
            if let Some((left, of)) = self.left.filter(|_| !self.z.is_empty()) {
                let name = NamedSkill::name_of(&self.names.skills, self.z);
                let name = name.map_or_else(|| format!("of {} values", self.z.len()), |name| format!("\"{name}\""));
                let _ = match left {
                    ActiveSkill::HELD => write!(words, "\nskill {name}, held"),
                    left => write!(words, "\nskill {name}, {left} of {of} ticks left"),
                };
            }
        }
        if let Some(line) = &self.names.line {
            let _ = write!(words, "\n{line}");
        }
        words
    }

    /// Returns the action: its number and name, or its values, and what it presses.
    fn action_words(&self) -> String {
        let action = match self.action {
            ActionValue::Discrete(index) => match self.names.actions.get(*index as usize) {
                Some(name) => format!("{index} {name}"),
                None => index.to_string(),
            },
            ActionValue::Continuous(values) => numbers_in_words(values),
            ActionValue::Mixed { choices, numbers } => {
                let options = choices.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
                format!("{options} {}", numbers_in_words(numbers)).trim_end().to_owned()
            }
        };
        // A name says what is pressed.
        let is_named =
            matches!(self.action, ActionValue::Discrete(index) if self.names.actions.len() > *index as usize);
        let held = self.input.filter(|_| !is_named).map(|input| {
            let buttons = input.held(self.action).buttons;
            buttons.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
        });
        match held.filter(|held| !held.is_empty()) {
            Some(held) => format!("{action}  keys {held}"),
            None => action,
        }
    }
}

fn numbers_in_words(values: &[f32]) -> String {
    values.iter().take(8).map(|value| format!("{value:+.2}")).collect::<Vec<_>>().join(" ")
}
