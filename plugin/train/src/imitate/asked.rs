//! Worlds in which the policy plays and the demonstrator is asked in each state.
//!
//! The demonstrator decides as it does when it plays. Its action becomes the label of the state, and before the game
//! reads it, the policy's action takes its place, or stays away with the demonstrator's share.

use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionSpace, ActionValue, MixedSpace},
    agent::{Agent, AgentOrder, Control},
    engine::{Renewal, TickSchedules, is_tick, tick_world},
    episode::{Episode, EpisodeEnded},
    fault::{Fault, Faults},
    legal::LegalActions,
    level::LevelQueue,
    observation::Observation,
    policy::AgentMemory,
    streams::AgentStreams,
    systems::PlaybotSystems,
    vision::{ObservationConfig, ObservationKind, VisionError},
};
use playbot_harness::{
    game::Game,
    parallel::{on_threads, one_by_one},
    randomise::Randomise,
    split::LevelSplit,
    worlds::{Arrangement, build_observing_world, is_bound_to_its_thread},
};
use playbot_learner::{
    LabelledSteps, LearnError, Observations, Policy, PolicySpec, Streams,
    rng::{ChaCha8Rng, unit},
};

use crate::imitate::ImitateError;

/// What is played and asked in a round.
pub(super) struct AskPlan<'a> {
    pub(super) game: &'a dyn Game,
    /// Levels, of which agents draw uniformly.
    pub(super) levels: &'a LevelSplit,
    /// Values that each level draws.
    pub(super) randomise: &'a Randomise,
    pub(super) observation_config: ObservationConfig,
    /// Random seed of the round.
    pub(super) seed: u64,
    /// Share of the actions that the demonstrator takes.
    pub(super) share: f64,
    pub(super) policy: &'a Policy,
    /// Ticks of each agent.
    pub(super) ticks: u64,
    pub(super) arenas: u32,
    pub(super) worlds: u32,
    pub(super) threads: usize,
}

/// The labelled steps of a round, and the episodes that ended in it.
pub(super) struct Asked {
    pub(super) steps: LabelledSteps,
    pub(super) episodes: u64,
}

/// Plays and asks. The result is the same on any number of threads: steps are in the order of the agents.
pub(super) fn ask(plan: &AskPlan<'_>) -> Result<Asked, ImitateError> {
    let of_experiment = Arrangement::of_agents(plan.game, plan.arenas, plan.worlds);
    let of_experiment = if plan.randomise.is_empty() { of_experiment } else { of_experiment.apart(plan.game) };
    let arrangement = match plan.observation_config.kind {
        ObservationKind::Camera => of_experiment,
        _ => of_experiment.for_threads(plan.game, plan.threads),
    };
    let worlds: Result<Vec<_>, _> =
        arrangement.first_agents().map(|first| AskedWorld::new(plan, first, arrangement.arenas)).collect();
    let mut worlds = worlds?;
    let is_bound = worlds.iter().any(|asked| is_bound_to_its_thread(&asked.world));
    let play = |world: &mut AskedWorld| world.play(plan.ticks);
    let played = match is_bound {
        true => one_by_one(&mut worlds, plan.threads, play),
        false => on_threads(&mut worlds, plan.threads, play),
    };
    let spec = plan.policy.spec();
    let mut all = Asked { steps: LabelledSteps::empty(&spec), episodes: 0 };
    for of_world in played {
        let (agents, episodes) = of_world?;
        all.episodes += episodes;
        for steps in agents {
            all.steps.extend(&steps, &spec)?;
        }
    }
    Ok(all)
}

struct AskedWorld {
    world: World,
}

impl AskedWorld {
    fn new(plan: &AskPlan<'_>, first: u32, count: u32) -> Result<Self, VisionError> {
        let AskPlan { game, levels, seed, .. } = *plan;
        let (mut world, agents) =
            build_observing_world(game, &levels.mode, &plan.observation_config, seed, first, count)?;
        plan.randomise.install(&mut world);
        Renewal::set_up(&mut world, |world| {
            world.init_resource::<Asking>();
            world.add_observer(note_end);
            let TickSchedules { decide, .. } = *world.resource::<TickSchedules>();
            let before = forget_actions.after(PlaybotSystems::Observe).before(PlaybotSystems::Decide);
            let after = take_labels.after(PlaybotSystems::Decide).before(PlaybotSystems::Act);
            let mut schedules = world.resource_mut::<Schedules>();
            schedules.add_systems(decide, (before.run_if(is_tick), after.run_if(is_tick)));
        });
        Renewal::carry_resource::<Asking>(&mut world);
        let spec = plan.policy.spec();
        let streams = Streams::new(seed);
        let stream = |index| streams.stream("imitation.play", u64::from(index));
        world.insert_resource(Asking {
            policy: Some(plan.policy.clone()),
            share: plan.share,
            streams: (first..first + count).map(stream).collect(),
            steps: agents.iter().map(|_| LabelledSteps::empty(&spec)).collect(),
            episodes: 0,
        });
        for (&agent, index) in agents.iter().zip(first..) {
            game.tools().bots.attach_demonstrator(&mut world, agent, 0.0);
            world.entity_mut(agent).insert((
                AgentStreams::new(seed, index),
                Control::Bot,
                LevelQueue::Uniform { first: levels.first, last: levels.last },
            ));
        }
        Ok(Self { world })
    }

    /// Plays so many ticks. Returns the labelled steps of each agent, and the episodes that ended.
    fn play(&mut self, ticks: u64) -> Result<(Vec<LabelledSteps>, u64), Fault> {
        for _ in 0..ticks {
            tick_world(&mut self.world)?;
        }
        self.world.resource_mut::<Faults>().take()?;
        let asking = self.world.resource_mut::<Asking>().into_inner();
        Ok((std::mem::take(&mut asking.steps), asking.episodes))
    }
}

/// The policy that plays in a World, and the labelled steps of its agents.
#[derive(Resource, Default, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
struct Asking {
    #[reflect(ignore)]
    policy: Option<Policy>,
    share: f64,
    #[reflect(ignore)]
    streams: Vec<ChaCha8Rng>,
    #[reflect(ignore)]
    steps: Vec<LabelledSteps>,
    episodes: u64,
}

fn note_end(_: On<EpisodeEnded>, mut asking: ResMut<Asking>) {
    asking.episodes += 1;
}

/// Returns an action that no bot can take.
fn no_action(space: &ActionSpace) -> ActionValue {
    match space {
        ActionSpace::Discrete(_) => ActionValue::Discrete(u32::MAX),
        ActionSpace::Continuous(dim) => ActionValue::Continuous(vec![f32::NAN; *dim]),
        ActionSpace::Mixed(MixedSpace { choices, numbers }) => {
            ActionValue::Mixed { choices: vec![u32::MAX; choices.sizes().len()], numbers: vec![f32::NAN; *numbers] }
        }
    }
}

fn is_action(action: &ActionValue) -> bool {
    let (options, numbers) = (action.options(), action.numbers());
    let is_chosen = options.is_empty() || options.iter().any(|&option| option != u32::MAX);
    is_chosen && (numbers.is_empty() || numbers.iter().any(|number| !number.is_nan()))
}

/// Removes the actions of the last tick, so that a demonstrator without an answer is noticed.
fn forget_actions(mut agents: Query<(&Agent, &Control, &Episode, &mut Action)>) {
    for (agent, control, episode, mut action) in &mut agents {
        if *control == Control::Bot && episode.is_running() {
            action.0 = no_action(&agent.actions);
        }
    }
}

/// Notes the demonstrator's actions as labels, and lets the policy act in its place.
fn take_labels(world: &mut World) {
    let labelled = world.try_resource_scope(|world, mut asking: Mut<Asking>| label_all(world, &mut asking));
    if let Some(Err(why)) = labelled {
        world.resource_mut::<Faults>().report(why);
    }
}

fn label_all(world: &mut World, asking: &mut Asking) -> Result<(), String> {
    let Some(policy) = asking.policy.clone() else { return Ok(()) };
    let spec = policy.spec();
    let words = |error: LearnError| format!("the policy cannot decide: {error}");
    let entities = world.resource::<AgentOrder>().entities().to_vec();
    let mut rows = Vec::new();
    let (mut seen, mut legal, mut is_masked) = (Observations::empty(&spec.obs), Vec::new(), false);
    let (width, mut memories) = (policy.memory(), Vec::new());
    for (place, &entity) in entities.iter().enumerate() {
        let agent = world.entity(entity);
        let (Some(who), Some(episode), Some(Control::Bot)) =
            (agent.get::<Agent>(), agent.get::<Episode>(), agent.get::<Control>())
        else {
            continue;
        };
        let (Some(observation), Some(action)) = (agent.get::<Observation>(), agent.get::<Action>()) else { continue };
        if !episode.is_running() || place >= asking.steps.len() {
            continue;
        }
        if !is_action(&action.0) {
            return Err(format!(
                "{}: the demonstrator gives no action, so it cannot be asked in states that it has not led to: imitate \
                 recordings, without --dagger",
                episode.moment(who)
            ));
        }
        let (before, mask) = (seen.numbers(), agent.get::<LegalActions>());
        observation.push_to(&mut seen);
        if seen.numbers() - before != spec.obs.numbers() {
            return Err(format!("{}: its observation is not that of the policy", episode.moment(who)));
        }
        is_masked |= mask.is_some();
        match mask {
            Some(mask) => legal.extend(mask.entries(&spec.action_space)),
            None => legal.resize(legal.len() + spec.action_space.mask_width(), true),
        }
        let memory = agent.get::<AgentMemory>().filter(|memory| memory.0.len() == width && episode.tick > 0);
        memories.extend(memory.map_or(&[][..], |memory| &memory.0));
        rows.push((place, entity, action.0.clone(), episode.tick == 0));
        memories.resize(rows.len() * width, 0.0);
    }
    if rows.is_empty() {
        return Ok(());
    }
    if !is_masked {
        legal.clear();
    }
    let mut output = policy.forward_remembering(&[], &[], &memories, seen.as_slice(), rows.len()).map_err(words)?;
    output.restrict(&legal);
    for (row, (place, entity, label, begins)) in rows.into_iter().enumerate() {
        if let Some(mut memory) = world.get_mut::<AgentMemory>(entity).filter(|_| width > 0) {
            memory.0 = output.memory[row * width..(row + 1) * width].to_vec();
        }
        let mut steps = single(&spec, &seen, row, &label, &legal).map_err(words)?;
        steps.begins.extend(begins.then_some(0));
        asking.steps[place].extend(&steps, &spec).map_err(words)?;
        let stream = &mut asking.streams[place];
        // Both are drawn in any case, so that shares of 0 and 1 use the streams alike.
        let (drawn, (own, _)) = (unit(stream), output.sample(row, stream));
        if drawn >= asking.share
            && let Some(mut action) = world.get_mut::<Action>(entity)
        {
            action.0 = own;
        }
    }
    Ok(())
}

/// Returns one row as labelled steps.
fn single(
    spec: &PolicySpec,
    seen: &Observations,
    row: usize,
    label: &ActionValue,
    legal: &[bool],
) -> Result<LabelledSteps, LearnError> {
    let mut steps = LabelledSteps::empty(spec);
    steps.obs.push(seen.row(row, spec.obs.numbers()))?;
    steps.actions.push(label)?;
    let width = spec.action_space.mask_width();
    steps.legal = legal.get(row * width..(row + 1) * width).unwrap_or_default().to_vec();
    Ok(steps)
}
