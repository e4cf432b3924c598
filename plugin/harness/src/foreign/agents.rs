//! Several agents that share one World of a foreign game, and one episode.

use crate::{
    foreign::{
        ForeignGame,
        input::{ForeignBot, Input},
        runtime::{AgentPlace, with_foreign},
    },
    game::Game,
};
use bevy::prelude::*;
use bevy_playbot::{
    agent::{Agent, Control},
    bot::BlindBot,
    engine::{LevelFiles, PlaysAlong, begin_beside},
    episode::EpisodeEnded,
    streams::AgentStreams,
    unknown_name::{nearest, question},
    virtual_input::{VirtualButton, VirtualInput},
};

impl ForeignGame {
    /// Names the agents that play together, such as two paddles. Default: one agent.
    ///
    /// They act in the same tick, on one level, in one episode: a restart is for all of them. The systems of observation,
    /// reward, end, position, mask and scripted bots run once for each agent, and
    /// [`PlayedAgent`](crate::foreign::PlayedAgent) says for which. As soon as [`end`](Self::end) returns an end for one
    /// agent, the episode ends for all of them, as [`Truncated`](bevy_playbot::episode::EpisodeEnd::Truncated) for those
    /// without an end of their own. An agent that is out of the game earlier goes on without effect until then.
    ///
    /// Agents share keyboard, mouse and touch screen, so each needs keys of its own: see [`keys_of`](Self::keys_of). Each
    /// has a gamepad of its own. Keys that two agents hold are a [`problem`](crate::game::Game::problem).
    ///
    /// Trainings and evaluations play all agents by one policy, each with its own observation, unless they have
    /// [rivals](crate::rivals). Everything that records,
    /// replays, tests or explores plays the first agent, and the others play along: by the
    /// [`demonstrator`](Self::demonstrator) without noise, or at random (`chaos`) in a game without one. What they do
    /// depends on the level, and on what happens in it. So a recording holds the actions of the first agent alone, and
    /// replays.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::{ForeignGame, PlayedAgent}, prelude::*};
    ///
    /// /// The heights of the paddles, from left to right.
    /// #[derive(Resource)]
    /// struct Paddles([f32; 2]);
    ///
    /// let pong = |right: [KeyCode; 2]| {
    ///     ForeignGame::new("pong", 1, |app: &mut App| _ = app.insert_resource(Paddles([0.0; 2])))
    ///         .agents(["left", "right"])
    ///         .keys([vec![], vec![KeyCode::KeyS], vec![KeyCode::KeyW]])
    ///         .keys_of("right", [vec![], vec![right[0]], vec![right[1]]])
    ///         .observe(["own", "other"], |paddles: Res<Paddles>, agent: Res<PlayedAgent>| {
    ///             [paddles.0[agent.0], paddles.0[1 - agent.0]]
    ///         })
    /// };
    /// assert_eq!(pong([KeyCode::ArrowDown, KeyCode::ArrowUp]).problem(), None);
    /// let problem = pong([KeyCode::KeyS, KeyCode::ArrowUp]).problem().expect("both press S");
    /// assert!(problem.contains("agents `left` and `right` both hold KeyS"), "{problem}");
    /// ```
    pub fn agents(self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.with(|description| description.agents.names = Some(names.into_iter().map(Into::into).collect()))
    }

    /// Chooses the agent that is recorded, tested or explored, while the others play along. Default: the first of
    /// [`agents`](Self::agents). To test another one as well, add the game twice, under two names.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::{ForeignGame, PlayedAgent}, prelude::*};
    ///
    /// fn duel(name: &'static str, first: &str) -> ForeignGame {
    ///     ForeignGame::new(name, 1, |_: &mut App| {})
    ///         .agents(["hunter", "prey"])
    ///         .keys([vec![], vec![KeyCode::KeyW]])
    ///         .keys_of("prey", [vec![], vec![KeyCode::ArrowUp]])
    ///         .observe(["side"], |agent: Res<PlayedAgent>| [agent.0 as f32])
    ///         .first_agent(first)
    /// }
    /// let (hunt, flight) = (duel("hunt", "hunter"), duel("flight", "prey"));
    /// assert_eq!(hunt.tools().input.action_names(), ["nothing", "KeyW"]);
    /// assert_eq!(flight.tools().input.action_names(), ["nothing", "ArrowUp"]);
    /// let problem = duel("flight", "pray").problem().expect("there is no such agent");
    /// assert!(problem.contains("did you mean `prey`?"), "{problem}");
    /// ```
    pub fn first_agent(self, name: impl Into<String>) -> Self {
        self.with(|description| description.agents.first = Some(name.into()))
    }

    /// Puts the [`agents`](Self::agents) into teams that win together. Default: each agent is a team of its own. Where a
    /// policy learns or is measured against rivals, agents of its own team are no rivals.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::{ForeignGame, PlayedAgent}, prelude::*};
    ///
    /// let pairs = |second: [&'static str; 2]| {
    ///     let keys = [KeyCode::KeyQ, KeyCode::KeyP, KeyCode::KeyA, KeyCode::KeyL];
    ///     let game = ForeignGame::new("doubles", 1, |_: &mut App| {})
    ///         .agents(["north", "east", "south", "west"])
    ///         .teams([["north", "south"], second])
    ///         .observe(["side"], |agent: Res<PlayedAgent>| [agent.0 as f32]);
    ///     let named = ["north", "east", "south", "west"].into_iter().zip(keys);
    ///     named.fold(game, |game, (name, key)| game.keys_of(name, [vec![], vec![key]]))
    /// };
    /// assert_eq!(pairs(["east", "west"]).tools().host.teams(), [0, 1, 0, 1]);
    /// let problem = pairs(["east", "wets"]).problem().expect("there is no such agent");
    /// assert!(problem.contains("did you mean `west`?"), "{problem}");
    /// ```
    pub fn teams(self, teams: impl IntoIterator<Item = impl IntoIterator<Item = impl Into<String>>>) -> Self {
        let teams = teams.into_iter().map(|team| team.into_iter().map(Into::into).collect()).collect();
        self.with(|description| description.agents.teams = Some(teams))
    }

    /// Replaces the sets of [`keys`](Self::keys) for one of the [`agents`](Self::agents): as many, in the same order.
    pub fn keys_of(
        self,
        agent: impl Into<String>,
        sets: impl IntoIterator<Item = impl IntoIterator<Item = KeyCode>>,
    ) -> Self {
        let keys = sets.into_iter().map(|set| set.into_iter().map(VirtualButton::Key).collect()).collect();
        self.with(|description| description.agents.own.push((agent.into(), OwnInput::Keys(keys))))
    }

    /// Replaces the complete input for one of the [`agents`](Self::agents). It has as many actions as those of the others,
    /// in the same order.
    pub fn input_of(self, agent: impl Into<String>, input: VirtualInput) -> Self {
        self.with(|description| description.agents.own.push((agent.into(), OwnInput::Whole(input))))
    }
}

/// The input of one agent, in place of the common one.
#[derive(Clone)]
enum OwnInput {
    Keys(Vec<Vec<VirtualButton>>),
    Whole(VirtualInput),
}

impl OwnInput {
    /// Returns the method that declares it, for messages.
    fn method(&self) -> &'static str {
        match self {
            Self::Keys(_) => "`.keys_of`",
            Self::Whole(_) => "`.input_of`",
        }
    }
}

/// The agents of a World, and the inputs that only one of them has. Both are set in any order.
#[derive(Clone, Default)]
pub(super) struct SharingAgents {
    names: Option<Vec<String>>,
    /// The agent that is spawned first, if it is not the first of the names.
    first: Option<String>,
    /// The names of each team; `None` if each agent is a team of its own.
    teams: Option<Vec<Vec<String>>>,
    own: Vec<(String, OwnInput)>,
}

impl SharingAgents {
    fn names(&self) -> &[String] {
        self.names.as_deref().unwrap_or_default()
    }

    /// Returns the number of agents in a World.
    pub(super) fn count(&self) -> usize {
        self.names().len().max(1)
    }

    /// Returns the names of agents that share a World; none if an agent is alone in it.
    pub(super) fn seats(&self) -> Vec<String> {
        if self.count() > 1 { self.names().to_vec() } else { Vec::new() }
    }

    /// Returns the team of each seat.
    pub(super) fn teams(&self) -> Vec<usize> {
        let seats = self.seats();
        let team_of = |(seat, name): (usize, &String)| {
            let team = self.teams.iter().flatten().position(|team| team.contains(name));
            team.unwrap_or(seat)
        };
        seats.iter().enumerate().map(team_of).collect()
    }

    /// Returns the place of the agent that is spawned after so many others.
    pub(super) fn place_after(&self, others: usize) -> usize {
        let first = self.first.iter().find_map(|first| self.names().iter().position(|name| name == first));
        (others + first.unwrap_or_default()) % self.count()
    }

    /// Returns the input of the agent at this place, with its own parts in place of those of `common`.
    pub(super) fn input_of(&self, place: usize, common: &Input) -> Input {
        let mut input = common.clone();
        let Some(name) = self.names().get(place) else { return input };
        for (_, own) in self.own.iter().filter(|(agent, _)| agent == name) {
            match own {
                OwnInput::Keys(keys) => (input.keys, input.unknown_key) = (keys.clone(), None),
                OwnInput::Whole(whole) => {
                    let Input { names, every, hold, .. } = input;
                    input = Input { whole: Some(whole.clone()), names, every, hold, ..Input::default() };
                }
            }
        }
        input
    }

    /// Returns the problem of the inputs of all agents. The text follows the name of the game.
    pub(super) fn problem(&self, common: &Input) -> Option<String> {
        if let Some(problem) = self.problem_of_names() {
            return Some(problem);
        }
        if self.count() > 1 {
            if !common.clicks.is_empty() {
                return Some(
                    "has `.clicks` and several `.agents`, and there is one mouse: leave one of them out".to_owned(),
                );
            }
            if common.space.is_some() {
                return Some(
                    "has `.actions` and several `.agents`, and its system passes on the action of one agent: declare \
                     inputs with `.keys` and `.keys_of`, or with `.input_of`"
                        .to_owned(),
                );
            }
        }
        let inputs: Vec<Input> = (0..self.count()).map(|place| self.input_of(place, common)).collect();
        inputs.iter().find_map(Input::problem).or_else(|| self.conflict(&inputs))
    }

    fn problem_of_names(&self) -> Option<String> {
        let names = self.names();
        if self.names.is_some() && names.is_empty() {
            return Some("names no agent in `.agents`: name one, or leave it out".to_owned());
        }
        let twice = names.iter().enumerate().find(|(place, name)| names[..*place].contains(name));
        if let Some((_, name)) = twice {
            return Some(format!("names the agent `{name}` twice in `.agents`: give each a name of its own"));
        }
        let first = self.first.iter().map(|agent| ("`.first_agent`", agent));
        let own = self.own.iter().map(|(agent, own)| (own.method(), agent));
        let in_teams = self.teams.iter().flatten().flatten().map(|agent| ("`.teams`", agent));
        let unknown = own.chain(first).chain(in_teams).find(|(_, agent)| !names.contains(agent));
        let Some((method, agent)) = unknown else { return self.problem_of_teams() };
        if names.is_empty() {
            return Some(format!("has {method} for the agent `{agent}`, and names no agents: add `.agents`"));
        }
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        let near = question(nearest(agent, &known));
        let known = known.join("`, `");
        Some(format!("has {method} for an agent `{agent}`{near}, and `.agents` names `{known}`"))
    }

    /// Returns why the teams are no teams of all agents.
    fn problem_of_teams(&self) -> Option<String> {
        let teams = self.teams.as_ref()?;
        for name in self.names() {
            match teams.iter().flatten().filter(|member| *member == name).count() {
                1 => {}
                0 => return Some(format!("has no team for the agent `{name}`: name it in one of `.teams`")),
                _ => return Some(format!("names the agent `{name}` twice in `.teams`: an agent is in one team")),
            }
        }
        (teams.iter().filter(|team| !team.is_empty()).count() < 2).then(|| {
            "has one team in `.teams`, and so no rivals: name two teams or more, or leave `.teams` out".to_owned()
        })
    }

    /// Returns why the agents cannot act together: they have different actions, or share an input.
    fn conflict(&self, inputs: &[Input]) -> Option<String> {
        let named: Vec<(&String, &Input)> = self.names().iter().zip(inputs).collect();
        for (place, (other, input)) in named.iter().enumerate().skip(1) {
            let (name, first) = named[0];
            if input.space() != first.space() {
                let (has, others) = (first.space(), input.space());
                return Some(format!(
                    "has {has} for the agent `{name}`, and {others} for `{other}`: all agents need the same actions, with \
                     an empty set for those that hold nothing"
                ));
            }
            for (earlier, others) in &named[..place] {
                let (Some(one), Some(another)) = (others.pressed(), input.pressed()) else { continue };
                if let Some(shared) = one.shared_with(&another) {
                    return Some(format!(
                        "lets the agents `{earlier}` and `{other}` both hold {shared}: a World has one keyboard, one mouse \
                         and one touch screen. Give each agent keys of its own with `.keys_of`, or inputs with `.input_of`"
                    ));
                }
            }
        }
        None
    }
}

// Agents that play along, where one agent is recorded, tested or replayed.

/// Adds the agents that are missing in a World, as ones that play along.
pub(super) fn add_agents_along(game: &ForeignGame, world: &mut World) {
    let present: Vec<u32> = world.query::<&Agent>().iter(world).map(|agent| agent.index).collect();
    let Some(last) = present.iter().copied().max() else { return };
    let missing = game.description.agents.count().saturating_sub(present.len());
    for number in (1..=missing as u32).map(|number| last.saturating_add(number)) {
        let other = game.spawn_agent(world, number);
        let mut other = world.entity_mut(other);
        other.insert(PlaysAlong);
        match &game.description.demonstrator {
            Some(_) => other.insert(ForeignBot { name: None, noise: 0.0 }),
            None => other.insert(BlindBot::Chaos),
        };
    }
}

/// Begins the episode of the agents that play along, on the level of the first one. Nothing of an earlier episode counts
/// for them, so a replay of the first agent finds them as they were.
pub(super) fn begin_agents_along(world: &mut World, level: u64) {
    let mut others = world.query_filtered::<(&AgentPlace, Entity), With<PlaysAlong>>();
    let mut others: Vec<(usize, Entity)> = others.iter(world).map(|(place, it)| (place.0, it)).collect();
    others.sort_unstable();
    // A file has another number as soon as there are other files.
    let file = world.get_resource::<LevelFiles>().and_then(|files| files.of(level));
    let seed = file.map_or(level, |file| file.hash);
    for (place, other) in others {
        begin_beside(world, other, level);
        world.entity_mut(other).insert(AgentStreams::new(seed, place as u32));
        with_foreign(world, other, |_, foreign| {
            foreign.renew_bots();
            Ok(())
        });
    }
}

/// Returns the place of an agent among those of its World.
pub(super) fn place_of(world: &World, agent: Entity) -> usize {
    world.get::<AgentPlace>(agent).map_or(0, |place| place.0)
}

/// Makes agents that play along wait for the next episode.
pub(super) fn end_agents_along(event: On<EpisodeEnded>, mut others: Query<&mut Control, With<PlaysAlong>>) {
    if let Ok(mut control) = others.get_mut(event.entity) {
        *control = Control::Idle;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::worlds::Arrangement;

    /// A game of two agents without observations of their own; `right` has these keys.
    fn pair(right: &[KeyCode]) -> ForeignGame {
        ForeignGame::new("pair", 1, |_: &mut App| {})
            .agents(["left", "right"])
            .keys([vec![], vec![KeyCode::KeyW]])
            .keys_of("right", std::iter::once(vec![]).chain(right.iter().map(|&key| vec![key])))
            .observe(["x"], || [0.0])
    }

    fn problem(game: &ForeignGame) -> String {
        game.problem().expect("it has a problem")
    }

    #[test]
    fn agents_with_keys_of_their_own_are_no_problem() {
        assert_eq!(pair(&[KeyCode::ArrowUp]).problem(), None);
    }

    #[test]
    fn a_key_that_two_agents_share_is_a_problem() {
        let text = problem(&pair(&[KeyCode::KeyW]));
        assert!(text.starts_with("the game `pair` lets the agents `left` and `right` both hold KeyW: "), "{text}");
        assert!(text.ends_with("with `.keys_of`, or inputs with `.input_of`"), "{text}");
    }

    #[test]
    fn one_mouse_for_two_agents_is_a_problem() {
        let text = problem(&pair(&[KeyCode::ArrowUp]).mouse_buttons([vec![], vec![MouseButton::Left]]));
        assert!(text.contains("both hold MouseLeft"), "{text}");
        let middle = bevy_playbot::virtual_input::PointerPosition::fraction(0.5, 0.5);
        let text = problem(&pair(&[KeyCode::ArrowUp]).cursor([None, Some(middle)]));
        assert!(text.contains("both hold the mouse cursor"), "{text}");
    }

    #[test]
    fn each_agent_has_a_gamepad_of_its_own() {
        let game = pair(&[KeyCode::ArrowUp]).gamepad_buttons([vec![], vec![GamepadButton::South]]);
        assert_eq!(game.problem(), None);
    }

    #[test]
    fn keys_of_an_unknown_agent_are_a_problem_with_the_nearest_name() {
        let text = problem(&pair(&[KeyCode::ArrowUp]).keys_of("rigth", [[KeyCode::KeyA]]));
        let expected = "the game `pair` has `.keys_of` for an agent `rigth` (did you mean `right`?), and `.agents` names \
                        `left`, `right`";
        assert_eq!(text, expected);
    }

    #[test]
    fn other_numbers_of_actions_are_a_problem() {
        let text = problem(&pair(&[KeyCode::ArrowUp, KeyCode::ArrowDown]));
        assert!(
            text.contains("has 2 discrete actions for the agent `left`, and 3 discrete actions for `right`"),
            "{text}"
        );
    }

    #[test]
    fn a_name_that_two_agents_share_is_a_problem() {
        let text = problem(&pair(&[KeyCode::ArrowUp]).agents(["right", "right"]));
        assert!(text.contains("names the agent `right` twice in `.agents`"), "{text}");
    }

    #[test]
    fn agents_that_play_together_share_a_world_and_others_play_alone() {
        let game = pair(&[KeyCode::ArrowUp]);
        assert_eq!(Arrangement::of_agents(&game, 8, 2), Arrangement { worlds: 4, arenas: 2 });
        assert_eq!(Arrangement::of_agents(&game, 3, 1), Arrangement { worlds: 2, arenas: 2 }, "rounded up");
        assert_eq!(Arrangement::new(&game, 8, 2), Arrangement { worlds: 8, arenas: 1 });
        let together = Arrangement { worlds: 4, arenas: 2 };
        assert_eq!(together.for_threads(&game, 16), together);
        let alone = ForeignGame::new("alone", 1, |_: &mut App| {}).keys([vec![]]).observe(["x"], || [0.0]);
        let split = |threads| Arrangement { worlds: 2, arenas: 32 }.for_threads(&alone, threads);
        for (threads, worlds) in [(1, 2), (3, 2), (4, 4), (7, 4), (16, 16), (63, 32), (1000, 64)] {
            assert_eq!(split(threads), Arrangement { worlds, arenas: 64 / worlds }, "{threads} threads");
        }
    }

    #[test]
    fn an_input_as_a_whole_takes_the_place_of_the_keys() {
        let input = VirtualInput::keys([vec![], vec![KeyCode::Enter]]);
        let game = pair(&[KeyCode::KeyW]).input_of("right", input.clone());
        assert_eq!(game.problem(), None);
        let mut world = World::new();
        let agents = [0, 1].map(|index| game.spawn_agent(&mut world, index));
        assert_eq!(world.get::<VirtualInput>(agents[1]), Some(&input));
        let left = VirtualInput::keys([vec![], vec![KeyCode::KeyW]]);
        assert_eq!(world.get::<VirtualInput>(agents[0]), Some(&left));
    }

    #[test]
    fn a_system_of_actions_cannot_serve_two_agents() {
        let space = bevy_playbot::action::ActionSpace::Discrete(2);
        let game = ForeignGame::new("pair", 1, |_: &mut App| {}).agents(["left", "right"]).actions(space, || {});
        let text = problem(&game.observe(["x"], || [0.0]));
        assert!(text.contains("has `.actions` and several `.agents`"), "{text}");
    }
}
