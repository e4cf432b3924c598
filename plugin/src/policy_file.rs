//! Shipped policies: checking them against the game and installing them.
//!
//! ```
//! use bevy_playbot::{
//!     policy_file::{GameMetadata, PolicyMetadata, PolicyFile, check_policy, install_policy},
//!     prelude::*,
//! };
//! use playbot_learner::DeviceKind;
//! # use playbot_learner::{Learner as _, PolicySpec, PpoConfig, PpoLearner};
//! # let spec = PolicySpec { obs: 1.into(), latent: 0, action_space: ActionSpace::Discrete(3) };
//! # let policy = PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::Flex)?.policy();
//! # let observations = vec!["x".into()];
//! # let metadata = PolicyMetadata { game: "walk".into(), game_version: 1, observations, ..PolicyMetadata::default() };
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("walker.policy");
//! # PolicyFile { metadata, policy, skills: None }.save(&path, &[0.5_f32], &[], 1)?;
//!
//! let walk = GameMetadata {
//!     name: "walk",
//!     version: 1,
//!     observations: vec!["x".into()],
//!     actions: ActionSpace::Discrete(3),
//!     action_names: Vec::new(),
//!     has_picture: false,
//! };
//! // `path` leads to a file written by `playbot policy export` or `PolicyFile::save`.
//! let file = PolicyFile::load(&path, DeviceKind::default())?;
//! check_policy(&walk, &file)?;
//! let mut app = headless_app();
//! install_policy(app.world_mut(), &file, ActionDraw::Sample);
//! assert!(app.world().contains_resource::<ActivePolicy>());
//!
//! let error = check_policy(&GameMetadata { version: 2, ..walk }, &file).expect_err("the rules have changed");
//! assert!(error.to_string().contains("version 1 of `walk`, whose rules are at version 2"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::{
    action::ActionSpace,
    policy::{ActionDraw, ActivePolicy},
    skill_prior::SkillPrior,
    vision::{ObservationConfig, UnknownObservation},
};
use bevy::prelude::*;
use playbot_learner::HasExitCode;
use thiserror::Error;

pub use playbot_learner::{DeviceKind, PolicyFile, PolicyMetadata, SkillSource};

/// Metadata of a game. A policy that was made for another game, or another version of this one,
/// does not fit.
#[derive(Clone, Debug, PartialEq)]
pub struct GameMetadata<'a> {
    /// Name of the game.
    pub name: &'a str,
    /// Version of its rules.
    pub version: u32,
    /// Names of the observation's values.
    pub observations: Vec<String>,
    /// Actions of every agent.
    pub actions: ActionSpace,
    /// Names of the discrete choices, or of the dimensions of continuous actions; may be empty.
    pub action_names: Vec<String>,
    /// True if the game can be drawn, for policies that read pictures.
    pub has_picture: bool,
}

/// A policy file does not fit the game.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum PolicyMisfit {
    /// The policy was made for another game.
    #[error("the policy was made for the game `{made_for}`, not for `{game}`")]
    Game {
        /// Name of the policy's game.
        made_for: String,
        /// Name of this game.
        game: String,
    },
    /// The rules have changed since.
    #[error(
        "the policy was made for version {made_for} of `{game}`, whose rules are at version {now}: train and export it \
         again"
    )]
    Version {
        /// Name of this game.
        game: String,
        /// Version that the policy was made for.
        made_for: u32,
        /// Version of the game.
        now: u32,
    },
    /// The policy reads another number of values than its metadata names: it was trained with
    /// another observation.
    #[error("the policy reads {reads} observation values, but {named} are named: train it again with this observation")]
    Metadata {
        /// Values that it reads.
        reads: usize,
        /// Values that are named.
        named: usize,
    },
    /// The file does not state the observation of its policy.
    #[error(transparent)]
    ObservationConfig(#[from] UnknownObservation),
    /// The policy reads pictures, and the game cannot be drawn.
    #[error("the policy reads {observation_config}, but `{game}` cannot be drawn")]
    NoPicture {
        /// Name of this game.
        game: String,
        /// The observation that the policy reads.
        observation_config: ObservationConfig,
    },
    /// The observation has changed.
    #[error(
        "the policy reads {made_for} observation values and `{game}` gives {now}; the first difference is at number \
         {at}: {} there, {} here",
        quoted(.expected),
        quoted(.found)
    )]
    Observation {
        /// Name of this game.
        game: String,
        /// Values that the policy reads.
        made_for: usize,
        /// Values of the game.
        now: usize,
        /// Number of the first value that differs, from 0.
        at: usize,
        /// Its name in the policy; empty if there is none.
        expected: String,
        /// Its name in the game; empty if there is none.
        found: String,
    },
    /// A discrete choice or a dimension of the actions has another meaning in the game.
    #[error("action {at} of the policy is `{expected}`, that of `{game}` is `{found}`: train and export it again")]
    ActionName {
        /// Name of this game.
        game: String,
        /// Number of the first action that differs, from 0.
        at: usize,
        /// Its name in the policy.
        expected: String,
        /// Its name in the game.
        found: String,
    },
    /// The game's actions differ from the policy's.
    #[error("the policy acts with {made_for}, `{game}` with {now}")]
    Actions {
        /// Name of this game.
        game: String,
        /// The policy's actions.
        made_for: Box<ActionSpace>,
        /// The game's actions.
        now: Box<ActionSpace>,
    },
}

impl HasExitCode for PolicyMisfit {}

/// Returns a name in the form of messages.
fn quoted(name: &str) -> String {
    if name.is_empty() { "nothing".to_owned() } else { format!("`{name}`") }
}

/// Returns the observation of a policy: the sensor that its agents need.
///
/// # Errors
///
/// The file does not state it.
pub fn policy_observation(file: &PolicyFile) -> Result<ObservationConfig, UnknownObservation> {
    ObservationConfig::from_metadata(file.metadata.picture.as_ref(), &file.policy.observation())
}

/// Checks that a policy was made for this game, these rules, this observation and these actions. A
/// policy that reads pictures needs a game that can be drawn. The sensor itself reports if this
/// program lacks it.
///
/// # Errors
///
/// [`PolicyMisfit`] with the first difference.
pub fn check_policy(game: &GameMetadata<'_>, file: &PolicyFile) -> Result<(), PolicyMisfit> {
    let (metadata, name) = (&file.metadata, game.name.to_owned());
    if metadata.game != name {
        return Err(PolicyMisfit::Game { made_for: metadata.game.clone(), game: name });
    }
    if metadata.game_version != game.version {
        return Err(PolicyMisfit::Version { game: name, made_for: metadata.game_version, now: game.version });
    }
    let observation_config = policy_observation(file)?;
    if !observation_config.is_image() {
        check_names(game, file)?;
    } else if !game.has_picture {
        return Err(PolicyMisfit::NoPicture { game: name, observation_config });
    }
    if file.policy.action_space() != game.actions {
        let (made_for, now) = (file.policy.action_space().into(), game.actions.into());
        return Err(PolicyMisfit::Actions { game: name, made_for, now });
    }
    let (theirs, ours) = (&metadata.actions, &game.action_names);
    match theirs.iter().zip(ours).enumerate().find(|(_, (theirs, ours))| theirs != ours) {
        Some((at, (expected, found))) => {
            Err(PolicyMisfit::ActionName { game: name, at, expected: expected.clone(), found: found.clone() })
        }
        None => Ok(()),
    }
}

/// Compares the names of the values that the policy reads with those of the game.
fn check_names(game: &GameMetadata<'_>, file: &PolicyFile) -> Result<(), PolicyMisfit> {
    let (metadata, names) = (&file.metadata, &game.observations);
    let reads = file.policy.obs_dim();
    if reads != metadata.observations.len() {
        return Err(PolicyMisfit::Metadata { reads, named: metadata.observations.len() });
    }
    let longest = names.len().max(metadata.observations.len());
    if let Some(at) = (0..longest).find(|&at| names.get(at) != metadata.observations.get(at)) {
        let name_at = |names: &[String]| names.get(at).cloned().unwrap_or_default();
        return Err(PolicyMisfit::Observation {
            game: game.name.to_owned(),
            made_for: metadata.observations.len(),
            now: names.len(),
            at,
            expected: name_at(&metadata.observations),
            found: name_at(names),
        });
    }
    Ok(())
}

/// Lets a policy, with its skills, drive every agent of this World under
/// [`Control::Policy`](crate::agent::Control::Policy). If the policy reads pictures, its agents
/// need the sensor that [`policy_observation`] names.
pub fn install_policy(world: &mut World, file: &PolicyFile, draw: ActionDraw) {
    let active = ActivePolicy { policy: file.policy.clone(), draw };
    active.install(world, file.skills.as_ref().map(SkillPrior::from));
}
