//! Readings of a foreign game after a tick: its agent's observation and state, reward and end, and the default state
//! hash.

use crate::{
    detector::LevelProof,
    foreign::{
        ForeignGame,
        entities::write_all,
        runtime::{
            Baseline, ForeignCell, OwnedSystem, ReaderFactory, Sensor, SystemFactory, note, playing_agents,
            with_foreign,
        },
    },
    game::{GuessedPosition, StateTools},
    reflected_path::component_of,
    worlds::hash_with_agent,
};
use bevy::{
    ecs::{component::ComponentInfo, system::ReadOnlySystem},
    prelude::*,
};
use bevy_playbot::{
    agent::Control,
    demo::replay::Replay,
    engine::{TickSchedules, is_tick},
    episode::{Episode, EpisodeEnd, NoTimeLimit},
    observation::{Observation, VectorSensor},
    reward::Reward,
    state_hash::StateHash,
    systems::{ObserveSchedule, PlaybotSystems},
    vision::VisionSystems,
};
use playbot_report::counted;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Adds the system that reads the observation.
pub(super) fn add_observation(app: &mut App) {
    app.add_systems(ObserveSchedule, observe.before(VisionSystems::Sync));
}

/// Fills the vector of each agent, unless it has no sensor for one.
pub(super) fn observe(world: &mut World) {
    for agent in playing_agents(world) {
        observe_for(world, agent);
    }
}

fn observe_for(world: &mut World, agent: Entity) {
    let Some(expected) = world.get::<VectorSensor>(agent).map(|sensor| sensor.space().len()) else { return };
    let values = with_foreign(world, agent, |world, foreign| {
        let parts = foreign.asked();
        let mut values = match &mut parts.sensor {
            Sensor::System(system) => system.demand(world)?,
            Sensor::Paths(paths) => paths
                .iter_mut()
                .map(|path| path.read(world))
                .collect::<Result<_, _>>()
                .map_err(|error| error.to_string())?,
            Sensor::Nothing => Vec::new(),
        };
        let own = expected.saturating_sub(parts.entities.iter().map(|(slots, _)| slots.len()).sum());
        if values.len() == own {
            write_all(&mut parts.entities, world, &mut values)?;
            return Ok(values);
        }
        let system = foreign.game.description.sensor_name();
        Err(format!(
            "`.observe` names {}, but its system `{system}` returned {} in this tick: it must return every value in each \
             tick",
            counted(own as u64, "value"),
            values.len()
        ))
    });
    if let (Some(values), Some(mut observation)) = (values, world.get_mut::<Observation>(agent)) {
        observation.set(values);
    }
}

// State of the agent, for explorers, detectors and proofs.

impl ForeignGame {
    /// Declares the position of the agent, from above or from the side, in any units, for detectors of progress, for
    /// explorers and for pictures. The system may run more than once in a tick, so it must change nothing. While it is
    /// skipped, because an entity that it asks for does not exist, the position is unknown. Without it, reports of
    /// unsolved levels use the only entity with a component `Player`, or another of
    /// [`PLAYER_NAMES`](crate::foreign::PLAYER_NAMES), if there is one.
    ///
    /// It is read twice in a tick: in `PreUpdate`, before the action, and in `Last`, after the game's `FixedUpdate` and
    /// `Update`.
    ///
    /// The system returns a `Vec2`, or in three dimensions a `Vec3`: see [`IntoPlanPosition`].
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::foreign::ForeignGame;
    ///
    /// #[derive(Component)]
    /// struct Hero;
    ///
    /// fn flat(game: ForeignGame) -> ForeignGame {
    ///     game.position(|hero: Single<&Transform, With<Hero>>| hero.translation.truncate())
    /// }
    ///
    /// fn in_space(game: ForeignGame) -> ForeignGame {
    ///     game.position(|hero: Single<&Transform, With<Hero>>| hero.translation)
    /// }
    /// ```
    pub fn position<Position: IntoPlanPosition, M: 'static>(
        self,
        system: impl IntoSystem<(), Position, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| {
            description.position = Some(SystemFactory::new(system, |position: Position| {
                let height = position.height();
                (position.into_plan_position(), height)
            }));
        })
    }

    /// Declares the state of the agent for explorers, in a few whole numbers: states with the same numbers are the same.
    /// Name it where a position says too little, such as in a game with keys or switches. The system may run more than
    /// once in a tick, so it must change nothing.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::foreign::ForeignGame;
    ///
    /// #[derive(Component)]
    /// struct Hero {
    ///     has_key: bool,
    /// }
    ///
    /// fn explored(game: ForeignGame) -> ForeignGame {
    ///     game.cell(|hero: Single<(&Transform, &Hero)>| {
    ///         let (at, hero) = *hero;
    ///         [at.translation.x as i32, at.translation.y as i32, i32::from(hero.has_key)]
    ///     })
    /// }
    /// ```
    pub fn cell<Cell: IntoIterator<Item = i32> + 'static, M: 'static>(
        self,
        system: impl IntoSystem<(), Cell, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        let convert = |cell: Cell| -> Vec<i32> { cell.into_iter().collect() };
        self.with(|description| description.cell = Some(SystemFactory::new(system, convert)))
    }

    /// Declares the reason why an episode has ended without the goal, in a word or two for people: `saw`, `fall`. The
    /// system runs in `Last`, after [`end`](Self::end), when an episode has ended and was not won; also if its time is
    /// up.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::foreign::ForeignGame;
    ///
    /// #[derive(Component)]
    /// struct Hero {
    ///     health: u32,
    /// }
    ///
    /// fn explained(game: ForeignGame) -> ForeignGame {
    ///     game.end_cause(|hero: Single<(&Transform, &Hero)>| {
    ///         let (at, hero) = *hero;
    ///         if at.translation.y < 0.0 { Some("fall") } else { (hero.health == 0).then_some("enemy") }
    ///     })
    /// }
    /// ```
    pub fn end_cause<M: 'static>(
        self,
        system: impl IntoSystem<(), Option<&'static str>, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| description.end_cause = Some(SystemFactory::new(system, |cause| cause)))
    }

    /// Declares a proof about the state of an episode: whether the goal can still be reached. The detector `soft-lock`
    /// calls it now and then. The system takes a millisecond at most and only reads the World, so it has no `Commands`,
    /// `ResMut` or `&mut`. Only a search to its end is a proof: see [`LevelProof`].
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{detector::LevelProof, foreign::ForeignGame};
    ///
    /// /// Keys that the level still has, and doors that are closed.
    /// #[derive(Resource)]
    /// struct Left {
    ///     keys: u32,
    ///     doors: u32,
    /// }
    ///
    /// fn proved(game: ForeignGame) -> ForeignGame {
    ///     game.prove_from(|left: Res<Left>| {
    ///         let why = "more doors are closed than there are keys".to_owned();
    ///         if left.doors > left.keys { LevelProof::Unsolvable { why } } else { LevelProof::Unknown }
    ///     })
    /// }
    /// ```
    pub fn prove_from<M: 'static>(
        self,
        system: impl IntoSystem<(), LevelProof, M, System: ReadOnlySystem> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| description.proof = Some(ReaderFactory::new(system)))
    }

    /// Adds a reward of each tick to other rewards. The system runs in `Last`, after the game's `FixedUpdate` and `Update`
    /// and before [`end`](Self::end). It also runs once before the first tick, to read what
    /// happened before it, and pays nothing for that.
    pub fn reward<M: 'static>(self, system: impl IntoSystem<(), f32, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.rewards.push((SystemFactory::new(system, |reward| reward), false)))
    }

    /// Adds a reward by the growth of a value, such as a score, since the last tick. The value need not begin at 0 in
    /// an episode. The system runs as that of [`reward`](Self::reward) does.
    pub fn reward_delta<M: 'static>(self, system: impl IntoSystem<(), f32, M> + Clone + Send + Sync + 'static) -> Self {
        self.with(|description| description.rewards.push((SystemFactory::new(system, |value| value), true)))
    }

    /// Declares whether and how the game is over after a tick. The system runs in `Last`, after the game's `FixedUpdate` and
    /// `Update` and after [`reward`](Self::reward). A state that the game has set by `NextState` in this tick is not entered
    /// yet. The system also runs once before the first tick, where its answer does not count.
    pub fn end<M: 'static>(
        self,
        system: impl IntoSystem<(), Option<EpisodeEnd>, M> + Clone + Send + Sync + 'static,
    ) -> Self {
        self.with(|description| description.end = Some(SystemFactory::new(system, |end| end)))
    }
}

/// A position that has a place on the plan of its level.
pub trait IntoPlanPosition: 'static {
    /// Returns the position on the plan.
    fn into_plan_position(self) -> Vec2;

    /// Returns the height, if the plan does not show it. By default the plan shows it, or there is none.
    fn height(&self) -> Option<f32> {
        None
    }
}

impl IntoPlanPosition for Vec2 {
    fn into_plan_position(self) -> Vec2 {
        self
    }
}

/// A position in space, seen from above: x and z of the World are x and y of the plan, and y is the height.
impl IntoPlanPosition for Vec3 {
    fn into_plan_position(self) -> Vec2 {
        self.xz()
    }

    fn height(&self) -> Option<f32> {
        Some(self.y)
    }
}

/// Position of the agent on its level's plan, and its height if the plan is seen from above. Missing while it is unknown.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub(super) struct ForeignPosition {
    on_plan: Vec2,
    height: Option<f32>,
}

/// State of the agent for explorers. Missing while it is unknown.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub(super) struct ForeignExploreCell(Vec<i32>);

/// The reason why the agent's episode has just ended without the goal. Missing if there is no reason.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
struct ForeignEndCause(&'static str);

/// Position and cell of an agent, for a snapshot.
pub(super) type KeptState = (Option<ForeignPosition>, Option<ForeignExploreCell>);

/// Returns the state of an agent after its last tick.
pub(super) fn kept_state(world: &World, agent: Entity) -> KeptState {
    (world.get(agent).cloned(), world.get(agent).cloned())
}

/// Puts an agent into a state that was kept.
pub(super) fn put_state(world: &mut World, agent: Entity, (position, cell): &KeptState) {
    note(world, agent, *position);
    note(world, agent, cell.clone());
    note::<ForeignEndCause>(world, agent, None);
}

/// Removes the state of an agent in its last episode, which is stale in the next one.
pub(super) fn forget_state(world: &mut World, agent: Entity) {
    world.entity_mut(agent).remove::<(ForeignPosition, ForeignExploreCell, ForeignEndCause)>();
}

impl StateTools for ForeignGame {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        world.get::<ForeignPosition>(agent).map(|position| position.on_plan)
    }

    fn height(&self, world: &World, agent: Entity) -> Option<f32> {
        world.get::<ForeignPosition>(agent)?.height
    }

    fn guessed_position(&self, world: &World, _agent: Entity) -> Option<GuessedPosition> {
        let description = &self.description;
        let cell = world.get_resource::<ForeignCell>().filter(|_| description.position.is_none())?;
        cell.lock().guess.position(world, &description.paths)
    }

    fn end_cause(&self, world: &World, agent: Entity) -> Option<&'static str> {
        world.get::<ForeignEndCause>(agent).map(|cause| cause.0)
    }

    fn explore_cell(&self, world: &World, agent: Entity) -> Option<Vec<i32>> {
        world.get::<ForeignExploreCell>(agent).map(|cell| cell.0.clone())
    }

    fn known_state(&self, world: &World, agent: Entity) -> Option<u64> {
        let declared = world.get::<StateHash>(agent)?.0;
        if self.description.hash.is_some() {
            return Some(declared);
        }
        let cell = world.get_resource::<ForeignCell>()?;
        let of_entities = of_entities(world, cell.lock().baseline.as_ref()?)?;
        Some(StateHash::of([declared, of_entities]).0)
    }

    fn compares_levels(&self) -> bool {
        true
    }

    fn proves_states(&self) -> bool {
        self.description.proof.is_some()
    }

    fn prove_from(&self, world: &World, agent: Entity) -> LevelProof {
        let is_playing = world.get::<Episode>(agent).is_some_and(Episode::is_running);
        let Some(cell) = world.get_resource::<ForeignCell>().filter(|_| is_playing) else {
            return LevelProof::Unknown;
        };
        let mut foreign = cell.lock();
        match foreign.proof.as_mut().map(|proof| proof.read(world)) {
            Some(Ok(proof)) => proof.unwrap_or_default(),
            Some(Err(why)) => {
                foreign.failed_proof = Some(why);
                LevelProof::Unknown
            }
            None => LevelProof::Unknown,
        }
    }
}

/// Adds the systems that read the state: before each tick, so that the start of an episode is known, and after it.
pub(super) fn add_state(app: &mut App) {
    let judge = TickSchedules::of(app).judge;
    app.add_systems(ObserveSchedule, read_state.before(observe).before(VisionSystems::Sync))
        .add_systems(judge, read_state.before(read_outcome).before(PlaybotSystems::Judge).run_if(is_tick));
}

fn read_state(world: &mut World) {
    for agent in playing_agents(world) {
        read_state_of(world, agent);
    }
}

fn read_state_of(world: &mut World, agent: Entity) {
    let state = with_foreign(world, agent, |world, foreign| {
        if let Some(why) = foreign.failed_proof.take() {
            return Err(why);
        }
        if let Some(proof) = &mut foreign.proof {
            proof.prepare(world);
        }
        if let Some(save) = &mut foreign.save {
            save.prepare(world);
        }
        let parts = foreign.asked();
        Ok((run(&mut parts.position, world)?, run(&mut parts.cell, world)?))
    });
    let (position, cell) = state.unwrap_or_default();
    note(world, agent, position.map(|(on_plan, height)| ForeignPosition { on_plan, height }));
    note(world, agent, cell.map(ForeignExploreCell));
}

/// Runs a system of the description, if there is one.
fn run<Out: 'static>(system: &mut Option<OwnedSystem<Out>>, world: &mut World) -> Result<Option<Out>, String> {
    system.as_mut().map_or(Ok(None), |system| system.run(world))
}

// Reward and end.

/// Reads rewards and ends, after the game's frame. The end of one agent's episode ends those of all others.
pub(super) fn read_outcome(world: &mut World) {
    let mut outcomes = Vec::new();
    let agents = playing_agents(world);
    let lifted = LiftedLimit::of(world, &agents);
    for &agent in &agents {
        outcomes.extend(outcome_of(world, agent, lifted).map(|(reward, end)| (agent, reward, end)));
    }
    let is_over = outcomes.iter().any(|(_, _, end)| end.is_some());
    for (agent, reward, end) in outcomes {
        judge(world, agent, reward, end.or(is_over.then_some(EpisodeEnd::Truncated)));
    }
    // Proofs and snapshots are about the first agent, and read the World as it is now.
    if let [first, _, ..] = agents[..] {
        with_foreign(world, first, |_, _| Ok(()));
    }
}

/// The time up to which the game's time limit ends no episode.
#[derive(Clone, Copy)]
enum LiftedLimit {
    /// There is no limit.
    Always,
    /// The limit is at least this many ticks.
    Until(u32),
}

impl LiftedLimit {
    /// Returns that of the agents of a level, whose episodes end together. A recording goes on to its end, because it
    /// may have been made without the limit.
    fn of(world: &World, agents: &[Entity]) -> Self {
        if agents.iter().any(|&agent| world.entity(agent).contains::<NoTimeLimit>()) {
            return Self::Always;
        }
        let recorded = |&agent: &Entity| {
            let replay = world.get::<Replay>(agent).filter(|_| Control::of(world, agent) == Control::Replay)?;
            Some(u32::try_from(replay.episode().len()).unwrap_or(u32::MAX))
        };
        Self::Until(agents.iter().filter_map(recorded).max().unwrap_or(0))
    }

    /// Returns whether time is up after this many ticks.
    fn is_over(self, limit: u32, ticks: u32) -> bool {
        match self {
            Self::Always => false,
            Self::Until(lifted) => ticks >= limit.max(lifted),
        }
    }
}

/// Returns the agent's reward of this tick, and the end of the game as the agent sees it.
fn outcome_of(world: &mut World, agent: Entity, lifted: LiftedLimit) -> Option<(f32, Option<EpisodeEnd>)> {
    let tick = world.get::<Episode>(agent).map_or(0, |episode| episode.tick);
    with_foreign(world, agent, |world, foreign| {
        let limit = foreign.game.description.limit;
        let parts = foreign.asked();
        let mut reward = 0.0;
        for part in &mut parts.rewards {
            // A value of an entity that does not exist now pays nothing.
            let Some(value) = part.system.run(world)? else { continue };
            reward += if part.is_delta { value - part.last.unwrap_or(value) } else { value };
            part.last = Some(value);
        }
        let end = run(&mut parts.end, world)?.flatten();
        let time_is_up = limit.is_some_and(|limit| lifted.is_over(limit, tick + 1));
        Ok((reward, end.or(time_is_up.then_some(EpisodeEnd::Truncated))))
    })
}

/// Pays the agent, and ends its episode if there is an end.
fn judge(world: &mut World, agent: Entity, reward: f32, end: Option<EpisodeEnd>) {
    let outcome = with_foreign(world, agent, |world, foreign| {
        let is_lost = end.is_some_and(|end| end != EpisodeEnd::WON);
        let cause = if is_lost { run(&mut foreign.asked().end_cause, world)?.flatten() } else { None };
        let state = match &mut foreign.hash {
            Some(system) => system.demand(world)?,
            None => foreign.baseline.as_ref().map_or(0, |baseline| of_transforms(world, baseline)),
        };
        Ok((cause, state))
    });
    let Some((cause, state)) = outcome else { return };
    if cause.is_some() {
        note(world, agent, cause.map(ForeignEndCause));
    }
    let mut agent = world.entity_mut(agent);
    if let Some(mut paid) = agent.get_mut::<Reward>() {
        paid.add(reward);
    }
    let hash = hash_with_agent(state, agent.get(), agent.get());
    agent.insert(StateHash(hash));
    if let Some(mut episode) = agent.get_mut::<Episode>() {
        match end {
            Some(EpisodeEnd::Terminated { success }) => episode.terminate(success),
            Some(EpisodeEnd::Truncated) => episode.truncate(),
            None => {}
        }
    }
}

/// Returns a hash of the transforms of all entities of the game. The ids of entities and their order in memory do not
/// matter.
pub(super) fn of_transforms(world: &World, baseline: &Baseline) -> u64 {
    let mut sum = 0_u64;
    for entity in baseline.spawned_with::<Transform>(world) {
        let Some(transform) = world.get::<Transform>(entity) else { continue };
        if !baseline.is_placed(world, entity) {
            continue;
        }
        sum = sum.wrapping_add(StateHash::of(bits(transform)).0);
    }
    sum
}

/// Returns a hash of all entities of the game, by the types of their components and their transforms. It is the same in
/// all Worlds of a process, and differs between processes. Returns `None` if nothing but cameras has a transform: then it
/// says nothing about the level.
fn of_entities(world: &World, baseline: &Baseline) -> Option<u64> {
    let camera = component_of(world, "Camera");
    let (mut sum, mut has_places) = (0_u64, false);
    for entity in baseline.spawned(world) {
        if !baseline.is_placed(world, entity) {
            continue;
        }
        let entity = world.entity(entity);
        // The order of components depends on which system has run first.
        let mut types = 0_u64;
        for id in entity.archetype().components() {
            let Some(id) = world.components().get_info(*id).and_then(ComponentInfo::type_id) else { continue };
            let mut hasher = DefaultHasher::new();
            id.hash(&mut hasher);
            types = types.wrapping_add(hasher.finish());
        }
        let transform = entity.get::<Transform>();
        has_places |= transform.is_some() && camera.is_none_or(|camera| !entity.contains_id(camera));
        let words = transform.into_iter().flat_map(bits).chain([types]);
        sum = sum.wrapping_add(StateHash::of(words).0);
    }
    has_places.then_some(sum)
}

/// Returns the numbers of a transform.
fn bits(Transform { translation, rotation, scale }: &Transform) -> [u64; 10] {
    let ([x, y, z], [width, height, depth]) = (translation.to_array(), scale.to_array());
    let [i, j, k, w] = rotation.to_array();
    [x, y, z, width, height, depth, i, j, k, w].map(|number| u64::from(number.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        demo::verify_file,
        floor_plan::FloorPlan,
        foreign::{ForeignGame, Restart},
        level_files::LevelDesigns,
        prelude::*,
        worlds::build_world,
    };
    use bevy_playbot::demo::file::{DemoEnd, DemoReader, DemoWriter};

    #[derive(Component)]
    struct Snail;

    /// A snail that crawls 1 to the right in each frame, and is home after three.
    fn snail() -> ForeignGame {
        let game = |app: &mut App| {
            app.add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Snail, Transform::from_xyz(2.0, 5.0, 0.0)));
            })
            .add_systems(Update, |mut at: Single<&mut Transform, With<Snail>>| at.translation.x += 1.0);
        };
        ForeignGame::new("snail", 1, game)
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], |at: Single<&Transform, With<Snail>>| [at.translation.x])
            .position(|at: Single<&Transform, With<Snail>>| at.translation.truncate())
            .plan(|level| FloorPlan { goal: Vec2::new(level as f32, 0.0), ..FloorPlan::default() })
            .levels(3)
            .time_limit(3)
            .restart(Restart::Startup)
    }

    #[test]
    fn positions_are_known_after_each_tick_and_begin_anew_with_each_episode() {
        let game = snail();
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        let agent = agents[0];
        assert_eq!(game.tools().state.position(&world, agent), None, "nothing is played");
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([7, 8])));
        let mut positions = Vec::new();
        for _ in 0..20 {
            world.tick().expect("sound");
            if Control::of(&world, agent).is_active() {
                positions.extend(game.tools().state.position(&world, agent).map(|position| position.x));
            }
        }
        let episodes: Vec<&[f32]> = positions.chunk_by(|one, next| one <= next).collect();
        // Two frames pass before the first tick.
        assert_eq!(episodes, [[4.0, 5.0, 6.0]; 2], "{positions:?}");
    }

    #[test]
    fn plans_are_those_of_the_level_that_is_played() {
        let goal = |level| snail().tools().levels.floor_plan("default", level).map(|plan| plan.goal.x);
        assert_eq!([goal(1), goal(7)], [Some(1.0), Some(1.0)]);
        let bare = ForeignGame::new("bare", 1, |_: &mut App| {});
        assert_eq!(bare.tools().levels.floor_plan("default", 0), None);
    }

    /// Plays a level to its end without a key, and calls `look` after each tick.
    fn play(game: &ForeignGame, mut look: impl FnMut(&World, Entity)) {
        let (mut world, agents) = build_world(game, "default", 0, 0, 1);
        let bot = BlindBot::Constant(ActionValue::Discrete(0));
        world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list([7])));
        while Control::of(&world, agents[0]).is_active() {
            world.tick().expect("sound");
            if Control::of(&world, agents[0]).is_active() {
                look(&world, agents[0]);
            }
        }
    }

    #[test]
    fn a_recording_without_the_time_limit_replays_to_its_end() {
        let game = |limit| {
            let home = |at: Single<&Transform, With<Snail>>| (at.translation.x >= 9.0).then_some(EpisodeEnd::WON);
            snail().end(home).time_limit(limit)
        };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("long.demo");
        let (limited, (mut world, agents)) = (game(2), build_world(&game(2), "default", 0, 0, 1));
        assert_eq!(limited.tools().host.time_limit(), Some(2));
        let writer = DemoWriter::create(&path, limited.demo_header("default")).expect("a new file");
        world.insert_resource(Recorder::new(writer));
        let bot = BlindBot::Constant(ActionValue::Discrete(0));
        world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list([7]), Recording::default()));
        world.entity_mut(agents[0]).insert(NoTimeLimit);
        while Control::of(&world, agents[0]).is_active() {
            world.tick().expect("sound");
        }
        drop(world);
        let episodes = DemoReader::open(&path).and_then(DemoReader::read_all).expect("sound");
        let ends: Vec<_> = episodes.iter().map(|episode| (episode.len(), episode.end)).collect();
        // The snail begins at 2, and moves in the two frames before the first tick.
        assert_eq!(ends, [(6, DemoEnd::Terminated { success: true })]);
        let report = verify_file(&limited, &path, |_| {}).expect("readable");
        assert_eq!((report.ticks, report.divergences), (6, Vec::new()));

        // A bot has the limit.
        let mut seen = Vec::new();
        play(&limited, |world, agent| seen.extend(limited.tools().state.position(world, agent).map(|at| at.x)));
        assert_eq!(seen, [4.0, 5.0]);
        // A game that no longer ends where the recording does differs in its end, as without any limit.
        let further = snail().time_limit(2);
        let report = verify_file(&further, &path, |_| {}).expect("readable");
        assert!(report.divergences.iter().all(|(_, words)| words.contains("the episode's end is")), "{report:?}");
        assert_eq!(report.divergences.len(), 1);
    }

    #[test]
    fn a_position_in_space_is_seen_from_above_and_its_height_is_known() {
        let game = snail().position(|at: Single<&Transform, With<Snail>>| at.translation + Vec3::Z);
        let mut seen = Vec::new();
        play(&game, |world, agent| {
            let state = game.tools().state;
            seen.extend(state.position(world, agent).zip(state.height(world, agent)));
        });
        assert_eq!(seen.last(), Some(&(Vec2::new(6.0, 1.0), 5.0)), "{seen:?}");
        let flat = snail().position(|at: Single<&Transform, With<Snail>>| at.translation.truncate());
        play(&flat, |world, agent| assert_eq!(flat.tools().state.height(world, agent), None, "its plan shows it"));
    }

    #[test]
    fn an_explorer_reads_the_cell_of_each_tick() {
        let game = snail().cell(|at: Single<&Transform, With<Snail>>| [at.translation.x as i32, 8]);
        let mut seen = Vec::new();
        play(&game, |world, agent| seen.extend(game.tools().state.explore_cell(world, agent)));
        seen.dedup();
        assert_eq!(seen, [vec![4, 8], vec![5, 8], vec![6, 8]]);
        let (world, agents) = build_world(&game, "default", 0, 0, 1);
        assert_eq!(game.tools().state.explore_cell(&world, agents[0]), None, "nothing is played");
    }

    #[test]
    fn a_lost_episode_has_a_cause_from_its_last_tick() {
        let lost = |at: Single<&Transform, With<Snail>>| (at.translation.x >= 5.0).then_some(EpisodeEnd::LOST);
        let game = snail().end(lost).end_cause(|at: Single<&Transform, With<Snail>>| {
            Some(if at.translation.x >= 5.0 { "salt" } else { "sun" })
        });
        let mut seen = Vec::new();
        play(&game, |world, agent| seen.push(game.tools().state.end_cause(world, agent)));
        assert_eq!(seen.last(), Some(&Some("salt")));
        assert_eq!(seen.iter().flatten().count(), 1, "the other ticks have no cause: {seen:?}");
    }

    #[test]
    fn an_episode_whose_time_is_up_has_a_cause_as_well() {
        let game = snail().end_cause(|| Some("too slow"));
        let mut last = None;
        play(&game, |world, agent| last = game.tools().state.end_cause(world, agent));
        assert_eq!(last, Some("too slow"));
    }

    #[test]
    fn a_won_episode_has_no_cause() {
        let game = snail().end(|| Some(EpisodeEnd::WON)).end_cause(|| Some("salt"));
        let mut ticks = 0;
        play(&game, |world, agent| {
            ticks += 1;
            assert_eq!(game.tools().state.end_cause(world, agent), None);
        });
        assert!(ticks > 0);
    }

    #[test]
    fn the_cause_of_one_episode_is_not_that_of_the_next() {
        let game = snail().end_cause(|| Some("too slow"));
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1, 2])));
        let mut seen = Vec::new();
        while Control::of(&world, agents[0]).is_active() {
            world.tick().expect("sound");
            if world.get::<Episode>(agents[0]).is_some_and(|episode| episode.is_running() && episode.end().is_none()) {
                seen.push(game.tools().state.end_cause(&world, agents[0]));
            }
        }
        assert!(!seen.is_empty() && seen.iter().all(Option::is_none), "{seen:?}");
    }

    #[test]
    fn a_proof_reads_the_current_state() {
        let game = snail().prove_from(|at: Single<&Transform, With<Snail>>| {
            let why = format!("at {}", at.translation.x);
            if at.translation.x >= 5.0 { LevelProof::Unsolvable { why } } else { LevelProof::Unknown }
        });
        let mut seen = Vec::new();
        play(&game, |world, agent| {
            seen.extend(game.tools().state.prove_from(world, agent).why_unsolvable().map(str::to_owned));
        });
        assert_eq!(seen.first().map(String::as_str), Some("at 5"), "{seen:?}");
        let (world, agents) = build_world(&game, "default", 0, 0, 1);
        assert_eq!(game.tools().state.prove_from(&world, agents[0]), LevelProof::Unknown, "nothing is played");
    }

    #[test]
    fn a_proof_that_cannot_run_is_a_fault() {
        // There is no such resource, since no level is from a file.
        let game = snail().prove_from(|_: Res<LevelDesigns>| LevelProof::Unknown);
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1])));
        let fault = (0..20).find_map(|_| {
            let fault = world.tick().err();
            assert_eq!(game.tools().state.prove_from(&world, agents[0]), LevelProof::Unknown);
            fault
        });
        let fault = fault.expect("the proof cannot run").to_string();
        assert!(fault.contains("the game `snail`: ") && fault.contains("LevelDesigns"), "{fault}");
    }
}
