//! Skills: the latent goals that a policy follows for several ticks.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//! use playbot_learner::{Prior, SkillDraw};
//!
//! let mut app = headless_app();
//! let prior = Prior::standard_normal(2, false);
//! app.insert_resource(SkillPrior { prior, skill_interval: 10, draw: SkillDraw::Sample });
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Policy)).id();
//! let mut skill_after = |ticks| {
//!     app.ticks(ticks).expect("no agent broke its contract");
//!     app.world().get::<ActiveSkill>(agent).expect("every agent has one").z.clone()
//! };
//! let first = skill_after(1);
//! assert_eq!(first.len(), 2);
//! assert_eq!(skill_after(9), first, "held for 10 ticks");
//! assert_ne!(skill_after(1), first, "and then another one is drawn");
//! ```

use crate::{
    agent::{Agent, AgentOrder, Control},
    carry_over::{ReflectCarryComponent, ReflectCarryResource},
    episode::Episode,
    fault::Faults,
    observation::Observation,
    streams::AgentStreams,
    vision::{ImageSensor, seen_as},
};
use bevy::prelude::*;
use playbot_learner::{ObsKind, Observations, Prior, SkillDraw, SkillSource};
use serde::{Deserialize, Serialize};

/// Draws a skill z from p(z | s) for each agent at the first tick of an episode and then every
/// `skill_interval` fixed ticks (the paper's T). Each agent has its own count.
#[derive(Resource, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, CarryResource, Clone)]
pub struct SkillPrior {
    /// Distribution of skills: learned, or standard normal.
    pub prior: Prior,
    /// Ticks for which one skill is used.
    pub skill_interval: u32,
    /// A random draw, or the mean.
    pub draw: SkillDraw,
}

impl From<&SkillSource> for SkillPrior {
    fn from(skills: &SkillSource) -> Self {
        Self { prior: skills.prior.clone(), skill_interval: skills.skill_interval as u32, draw: skills.draw }
    }
}

/// The skill an agent is following.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct ActiveSkill {
    /// The skill as the policy sees it; empty without a [`SkillPrior`].
    pub z: Vec<f32>,
    /// Ticks until the next draw, this one included; 0 asks for a draw, and [`HELD`](Self::HELD) for none.
    pub ticks_left: u32,
}

impl ActiveSkill {
    /// The ticks that are left of a skill which is not followed by a draw, not even in the next episode.
    ///
    /// ```
    /// use bevy_playbot::prelude::*;
    /// use playbot_learner::{Prior, SkillDraw};
    ///
    /// let mut app = headless_app();
    /// let prior = Prior::standard_normal(2, false);
    /// app.insert_resource(SkillPrior { prior, skill_interval: 10, draw: SkillDraw::Sample });
    /// let chosen = ActiveSkill { z: vec![0.5, -0.5], ticks_left: ActiveSkill::HELD };
    /// let agent = (Agent::new(0, ActionSpace::Discrete(2)), Control::Policy, chosen.clone());
    /// let agent = app.world_mut().spawn(agent).id();
    /// app.ticks(40).expect("no agent broke its contract");
    /// assert_eq!(app.world().get::<ActiveSkill>(agent), Some(&chosen));
    /// ```
    pub const HELD: u32 = u32::MAX;

    /// Returns whether ticks of it are counted.
    fn is_counted(&self) -> bool {
        (1..Self::HELD).contains(&self.ticks_left)
    }

    /// Returns the remaining share of the skill's ticks, this one included, if skills are used for
    /// `skill_interval` ticks. A skill that has run out counts as a whole one, because the next draw
    /// replaces it.
    // Hidden: for rollouts.
    pub fn left(&self, skill_interval: u32) -> f32 {
        let interval = skill_interval.max(1);
        if self.ticks_left == 0 { 1.0 } else { self.ticks_left.min(interval) as f32 / interval as f32 }
    }
}

/// What a policy over skills remembers of the present episode: that of SPiRL with `ppo.memory`. Empty at first, and for a
/// prior without memory.
#[derive(Component, Clone, Debug, Default, PartialEq, Serialize, Deserialize, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct SkillMemory {
    /// Before the last draw of a skill.
    pub before: Vec<f32>,
    /// After it.
    pub now: Vec<f32>,
}

impl SkillMemory {
    /// Returns whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.now.is_empty()
    }
}

/// A region of skills with a name: all within a distance of its middle.
///
/// ```
/// use bevy_playbot::skill_prior::NamedSkill;
///
/// let region = |name: &str, z: [f32; 2]| NamedSkill { name: name.into(), z: z.to_vec(), radius: 0.5 };
/// let regions = [region("jump", [0.0, 0.8]), region("walk", [0.0, 0.2])];
/// assert_eq!(NamedSkill::name_of(&regions, &[0.1, 0.6]), Some("jump"));
/// assert_eq!(NamedSkill::name_of(&regions, &[0.1, -0.9]), None);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct NamedSkill {
    /// The name.
    pub name: String,
    /// Its middle.
    pub z: Vec<f32>,
    /// Largest distance from the middle.
    pub radius: f32,
}

impl NamedSkill {
    /// Returns whether a skill lies in the region.
    pub fn holds(&self, z: &[f32]) -> bool {
        self.z.len() == z.len() && self.distance(z) <= self.radius
    }

    /// Returns the name of the region in which a skill lies; of several, that with the nearest middle.
    pub fn name_of<'a>(regions: &'a [Self], z: &[f32]) -> Option<&'a str> {
        let holding = regions.iter().filter(|region| region.holds(z));
        let nearest = holding.min_by(|one, other| one.distance(z).total_cmp(&other.distance(z)));
        nearest.map(|region| region.name.as_str())
    }

    fn distance(&self, z: &[f32]) -> f32 {
        self.z.iter().zip(z).map(|(one, other)| (one - other) * (one - other)).sum::<f32>().sqrt()
    }
}

/// Adds the components of skills to every agent.
pub(crate) fn plugin(app: &mut App) {
    app.register_required_components::<Agent, ActiveSkill>().register_required_components::<Agent, SkillMemory>();
}

/// Ends skills with their episode: the first tick of the next episode draws anew, under any
/// control.
pub(crate) fn end_skills(mut agents: Query<(&Episode, &mut ActiveSkill, &mut SkillMemory)>) {
    for (episode, mut skill, mut memory) in &mut agents {
        if !episode.is_running() || episode.tick > 0 {
            continue;
        }
        if skill.is_counted() {
            skill.ticks_left = 0;
        }
        if !memory.is_empty() {
            *memory = SkillMemory::default();
        }
    }
}

/// Draws skills in one batch for the agents whose skill has run out.
pub fn draw_skills(
    prior: Res<SkillPrior>,
    order: Res<AgentOrder>,
    mut agents: Query<(
        (&Agent, &Control, &Episode, &Observation),
        &mut ActiveSkill,
        Option<&mut SkillMemory>,
        &mut AgentStreams,
    )>,
    sensors: Query<&ImageSensor>,
    mut faults: ResMut<Faults>,
) {
    // A prior that ignores observations takes any kind.
    let kind = prior.prior.observation().unwrap_or(ObsKind::Vector(0));
    let (mut batch, mut drawing) = (Observations::empty(&kind), Vec::new());
    let (width, mut memories) = (prior.prior.memory(), Vec::new());
    for &entity in order.entities() {
        let Ok(((agent, control, episode, observation), skill, memory, _)) = agents.get(entity) else { continue };
        if *control == Control::Policy && episode.is_running() && skill.ticks_left == 0 {
            if let Some(why) = misfit(&prior.prior, agent, observation, sensors.get(entity).ok()) {
                faults.report(why);
                return;
            }
            observation.push_to(&mut batch);
            drawing.push(entity);
            // Nothing is remembered of an earlier episode, or of another prior.
            let now = memory.map(|memory| &memory.now).filter(|now| episode.tick > 0 && now.len() == width);
            memories.extend_from_slice(now.map_or(&[], |now| now));
            memories.resize(drawing.len() * width, 0.0);
        }
    }
    if drawing.is_empty() {
        return;
    }
    let mut normal = |row: usize| match agents.get_mut(drawing[row]) {
        Ok((.., mut streams)) => playbot_learner::rng::normal(&mut streams.skill),
        Err(_) => 0.0,
    };
    let drawn = prior.prior.sample_remembering(&batch, &memories, drawing.len(), prior.draw, &mut normal);
    let (skills, remembered) = match drawn {
        Ok(drawn) => drawn,
        Err(error) => return faults.report(format!("the skill prior cannot draw: {error}")),
    };
    let latent = skills.len() / drawing.len();
    for (row, &entity) in drawing.iter().enumerate() {
        let Ok((_, mut skill, memory, _)) = agents.get_mut(entity) else { continue };
        if let (Some(mut memory), 1..) = (memory, width) {
            let of_agent = row * width..(row + 1) * width;
            (memory.before, memory.now) = (memories[of_agent.clone()].to_vec(), remembered[of_agent].to_vec());
        }
        skill.z.clear();
        skill.z.extend_from_slice(&skills[row * latent..(row + 1) * latent]);
        skill.ticks_left = prior.skill_interval;
    }
}

/// Returns why the prior cannot draw for this agent.
fn misfit(prior: &Prior, agent: &Agent, observation: &Observation, sensor: Option<&ImageSensor>) -> Option<String> {
    let wanted = prior.observation()?;
    let seen = seen_as(&wanted, observation, sensor);
    let (number, wanted_words, seen_words) = (agent.index, wanted.describe(), seen.describe());
    (wanted != seen).then(|| {
        format!(
            "agent {number}: the skill prior was made for {wanted_words}, but the game gives {seen_words}; load \
             skills of this game and of the agent's observation"
        )
    })
}

/// Counts one tick of every active skill.
pub(crate) fn count_down_skills(mut agents: Query<(&Control, &Episode, &mut ActiveSkill)>) {
    for (control, episode, mut skill) in &mut agents {
        if control.is_active() && episode.is_running() && skill.is_counted() {
            skill.ticks_left -= 1;
        }
    }
}
