//! Rivals: the players of an arena's other agents, where one of them learns or is measured.
//!
//! An arena that several agents share has [`seats`](crate::game::HostTools::seats), and seats make
//! [`teams`](crate::game::HostTools::teams). [`Opposed`] is the game as the player of one seat meets it: a game of one
//! agent, whose others [play along](bevy_playbot::engine::PlaysAlong), each by a scripted bot or a policy of its own. What
//! they do depends on the level, on what happens in it, and on random streams of the level. So an episode is decided by
//! the actions of its first agent, and replays from them beside the same rivals.
//!
//! The folder:
//!
//! - `matches`: matches of two players on all seats, and their results.

pub mod matches;

use crate::{
    eval::{Player, all_bots},
    game::{Game, GameTools, HostTools},
    mode::ModeError,
    worlds::build_world,
};
use bevy::{app::PluginGroupBuilder, prelude::*};
use bevy_playbot::{
    action::ActionSpace,
    agent::Agent,
    bot::BlindBot,
    engine::{AgentLimit, OwnPolicy, PlaysAlong},
    headless::HeadlessPlugins,
    observation::{ObservationSpace, VectorSensor},
    placement::TickPlacement,
    unknown_name::UnknownName,
};
use playbot_learner::HasExitCode;
use std::sync::Arc;
use thiserror::Error;

/// A game and its rivals do not fit one another.
#[derive(Debug, Error, PartialEq)]
pub enum RivalError {
    /// The game has one agent, and no seat for a rival.
    #[error(
        "a World of `{game}` has one agent, so it has no rivals: name the agents that play together, with `.agents` of a \
         `ForeignGame`, or with `seats` and `seated` of `HostTools`"
    )]
    Alone {
        /// Name of the game.
        game: String,
    },
    /// All seats are of one team.
    #[error("all seats of `{game}` are of one team, so it has no rivals: name two teams or more")]
    OneTeam {
        /// Name of the game.
        game: String,
    },
    /// A World has more or fewer agents than seats.
    #[error(
        "`{game}` names {seats} seats, and a World of it has {agents} agents: `add_agents_along` of `HostTools` has to add \
         those that are missing"
    )]
    Missing {
        /// Name of the game.
        game: String,
        /// Number of seats.
        seats: usize,
        /// Number of agents in a World.
        agents: usize,
    },
    /// Agents on two seats act or see differently.
    #[error("agents of `{game}` have {words}: one policy plays on all seats, so give them equal {what}")]
    Unequal {
        /// Name of the game.
        game: String,
        /// What differs: `actions` or `observations`.
        what: &'static str,
        /// What each of two seats has.
        words: String,
    },
    /// No seat has this name.
    #[error(transparent)]
    Seat(UnknownName),
    /// The game does not have the mode.
    #[error(transparent)]
    Mode(#[from] ModeError),
}

impl HasExitCode for RivalError {}

/// Checks that a game has rivals: two teams or more, whose agents have equal actions and observations in this mode.
/// Builds a World of each seat.
///
/// # Errors
///
/// [`RivalError`] with what to change.
pub fn check_rivals(game: &dyn Game, mode: &str) -> Result<(), RivalError> {
    let host = game.tools().host;
    let (seats, name) = (host.seats(), || game.name().to_owned());
    if seats.len() < 2 || host.seated(0).is_none() {
        return Err(RivalError::Alone { game: name() });
    }
    let teams = host.teams();
    if teams.iter().all(|team| teams.first() == Some(team)) {
        return Err(RivalError::OneTeam { game: name() });
    }
    game.check_mode(mode)?;
    let (mut world, _) = build_world(&Opposed::new(game, 0)?, mode, 0, 0, 1);
    let mut agents = world.query::<(Entity, &Agent, Option<&VectorSensor>)>();
    let mut found: Vec<_> = agents
        .iter(&world)
        .map(|(entity, agent, sensor)| {
            let values = sensor.map_or(0, |sensor| sensor.space().len());
            (host.seat_of(&world, entity), agent.index, agent.actions, values)
        })
        .collect();
    found.sort_unstable_by_key(|(seat, index, ..)| (*seat, *index));
    if found.len() != seats.len() {
        return Err(RivalError::Missing { game: name(), seats: seats.len(), agents: found.len() });
    }
    let seat_name = |seat: usize| seats.get(seat).cloned().unwrap_or_default();
    let Some(&(seat, _, actions, values)) = found.first() else { return Ok(()) };
    for &(other, _, others, seen) in &found {
        let unequal = |what, first: String, second: String| {
            let words = format!("{first} on the seat `{}` and {second} on `{}`", seat_name(seat), seat_name(other));
            Err(RivalError::Unequal { game: name(), what, words })
        };
        if others != actions {
            return unequal("actions", actions.to_string(), others.to_string());
        }
        if seen != values {
            let words = |count: usize| format!("{count} observed values");
            return unequal("observations", words(values), words(seen));
        }
    }
    Ok(())
}

/// Returns the place of the seat with this name.
///
/// # Errors
///
/// [`RivalError::Seat`] with the seats of the game.
pub fn find_seat(game: &dyn Game, name: &str) -> Result<usize, RivalError> {
    let seats = game.tools().host.seats();
    let found = seats.iter().position(|seat| seat == name);
    let known: Vec<&str> = seats.iter().map(String::as_str).collect();
    found.ok_or_else(|| RivalError::Seat(UnknownName::new("seat", name, &known)))
}

/// Returns the scripted rival of a game with this name: one of [`all_bots`].
///
/// # Errors
///
/// [`UnknownName`] with the bots of the game.
pub fn scripted_rival(game: &dyn Game, name: &str) -> Result<Player, UnknownName> {
    let (names, players): (Vec<_>, Vec<_>) = all_bots(game).into_iter().unzip();
    let found = names.iter().zip(players).find(|(known, _)| **known == name);
    found.map(|(_, player)| player).ok_or_else(|| UnknownName::new("rival", name, &names))
}

/// A game as the player on one seat meets it: others play along on all other seats.
#[derive(Clone)]
pub struct Opposed {
    game: Arc<dyn Game>,
    seat: usize,
    teams: Vec<usize>,
    /// The players of the other team, and of the player's own; `None` for those that the game chooses.
    others: Option<(Player, Player)>,
}

impl Opposed {
    /// Puts the player on this seat. The others are played as the game has it: see
    /// [`add_agents_along`](HostTools::add_agents_along).
    ///
    /// # Errors
    ///
    /// [`RivalError::Alone`] if the game has no such seat.
    pub fn new(game: &dyn Game, seat: usize) -> Result<Self, RivalError> {
        let host = game.tools().host;
        let seated = host.seated(seat).ok_or_else(|| RivalError::Alone { game: game.name().to_owned() })?;
        Ok(Self { game: seated, seat, teams: host.teams(), others: None })
    }

    /// Lets `rival` play on the seats of other teams, and `mate` on those of the player's own.
    #[must_use]
    pub fn against(self, rival: Player, mate: Player) -> Self {
        Self { others: Some((rival, mate)), ..self }
    }

    /// Returns the seat of the player.
    pub fn seat(&self) -> usize {
        self.seat
    }

    /// Returns the agents on the other seats of a World, in the order of their numbers, each with whether it is of the
    /// player's team.
    pub fn others(&self, world: &mut World) -> Vec<(Entity, bool)> {
        let mut others = world.query_filtered::<(&Agent, Entity), With<PlaysAlong>>();
        let mut others: Vec<(u32, Entity)> = others.iter(world).map(|(agent, it)| (agent.index, it)).collect();
        others.sort_unstable();
        let host = self.game.tools().host;
        let own = self.teams.get(self.seat);
        others.into_iter().map(|(_, it)| (it, self.teams.get(host.seat_of(world, it)) == own)).collect()
    }

    /// Hands the other seats of a World over to these players, from the next episode on.
    pub fn seat_others(&self, world: &mut World, rival: &Player, mate: &Player) {
        for (agent, is_mate) in self.others(world) {
            hand_over(&*self.game, world, agent, if is_mate { mate } else { rival });
        }
    }
}

/// Hands an agent that plays along over to a player, from its next episode on.
fn hand_over(game: &dyn Game, world: &mut World, agent: Entity, player: &Player) {
    game.tools().bots.detach(world, agent);
    world.entity_mut(agent).remove::<(BlindBot, OwnPolicy)>();
    if let Player::Policy { policy, prior, draw } = player {
        let own = OwnPolicy { policy: policy.clone(), draw: *draw, skills: prior.clone() };
        world.entity_mut(agent).insert(own);
    } else {
        // Agents that play along are under the control of a bot anyway.
        let _ = player.seat(game, world, agent);
    }
}

impl Game for Opposed {
    fn name(&self) -> &'static str {
        self.game.name()
    }

    fn version(&self) -> u32 {
        self.game.version()
    }

    fn modes(&self) -> &'static [&'static str] {
        self.game.modes()
    }

    fn tick_hz(&self) -> f64 {
        self.game.tick_hz()
    }

    fn actions(&self) -> ActionSpace {
        self.game.actions()
    }

    fn observation(&self) -> ObservationSpace {
        self.game.observation()
    }

    fn build(&self, app: &mut App, mode: &str) {
        self.game.build(app, mode);
        // The others are in the World too.
        let most = u32::try_from(self.teams.len()).unwrap_or(u32::MAX);
        app.insert_resource(AgentLimit { game: self.name(), most });
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        self.game.spawn_agent(world, index)
    }

    fn aliases(&self) -> &'static [&'static str] {
        self.game.aliases()
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { host: self, ..self.game.tools() }
    }

    fn built_anew(&self) -> Option<Arc<dyn Game>> {
        self.game.built_anew().map(|_| Arc::new(self.clone()) as Arc<dyn Game>)
    }
}

impl HostTools for Opposed {
    fn placement(&self) -> TickPlacement {
        self.game.tools().host.placement()
    }

    fn headless_plugins(&self, plugins: HeadlessPlugins) -> PluginGroupBuilder {
        self.game.tools().host.headless_plugins(plugins)
    }

    fn windowed_plugins(&self, plugins: PluginGroupBuilder) -> PluginGroupBuilder {
        self.game.tools().host.windowed_plugins(plugins)
    }

    fn bare_app(&self) -> Option<App> {
        self.game.tools().host.bare_app()
    }

    fn arenas_per_world(&self) -> Option<u32> {
        // Of agents that play along it is known in which World they are, not in which arena.
        Some(1)
    }

    fn seats(&self) -> Vec<String> {
        self.game.tools().host.seats()
    }

    fn teams(&self) -> Vec<usize> {
        self.teams.clone()
    }

    fn seated(&self, seat: usize) -> Option<Arc<dyn Game>> {
        let game = self.game.tools().host.seated(seat)?;
        Some(Arc::new(Self { game, seat, ..self.clone() }))
    }

    fn seat_of(&self, world: &World, agent: Entity) -> usize {
        self.game.tools().host.seat_of(world, agent)
    }

    fn add_agents_along(&self, world: &mut World) {
        self.game.tools().host.add_agents_along(world);
        if let Some((rival, mate)) = &self.others {
            self.seat_others(world, rival, mate);
        }
    }

    fn time_limit(&self) -> Option<u32> {
        self.game.tools().host.time_limit()
    }

    fn unplayable(&self) -> Option<String> {
        self.game.tools().host.unplayable()
    }
}
