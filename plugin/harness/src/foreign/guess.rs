//! The position of an agent in a game that declares none, guessed from the game's entities.
//!
//! The entity is the one whose `Transform` the game's `.observe_paths` read, or else the only one with a component
//! `Player`, with a component whose name contains `Player`, with the `Name` `Player`, or with another component of
//! [`PLAYER_NAMES`]. Where several entities match, the guess is not certain, and there is none.

use crate::{
    game::GuessedPosition,
    reflected_path::{component_of, is_ours},
};
use bevy::{
    ecs::{archetype::Archetype, component::ComponentId},
    prelude::*,
};
use std::collections::BTreeSet;

/// Names of components by which games call what a person plays, the likeliest first.
pub const PLAYER_NAMES: [&str; 10] =
    [WORD, "Hero", "Paddle", "Character", "Avatar", "Ship", "PlayerShip", "Snake", "Bird", "Car"];

const WORD: &str = "Player";

/// Crates of Bevy, whose components such as `AudioPlayer` mark no agent.
const ENGINE: [&str; 3] = ["bevy::", "bevy_", "core::"];

/// The signs of the agent's entity in a World, for guessing which entity a person plays.
#[derive(Default)]
pub struct PlayerGuess {
    /// Number of components when the signs were looked up.
    known: usize,
    /// The signs, the most certain first.
    signs: Vec<Sign>,
    /// The component of cameras in space.
    camera: Option<ComponentId>,
}

/// A sign of the agent's entity.
enum Sign {
    /// One of these components, with their names.
    Components(Vec<(String, ComponentId)>),
    /// This `Name`.
    Name(String),
}

impl PlayerGuess {
    /// Returns the one entity with the most certain sign that any entity has; `None` if there are several.
    pub fn entity(&mut self, world: &World) -> Option<Entity> {
        self.find(world, &[]).map(|(entity, _)| entity)
    }

    /// Returns the position of that entity. `paths` are those of `.observe_paths`.
    pub(super) fn position(&mut self, world: &World, paths: &[String]) -> Option<GuessedPosition> {
        let (entity, sign) = self.find(world, paths)?;
        let at = translation(world, entity)?;
        let description = sign.describe(world, entity);
        let is_in_space = self.camera.is_some_and(|camera| has_any(world, camera));
        // Seen from above, as positions in space are.
        let position = if is_in_space { at.xz() } else { at.truncate() };
        Some(GuessedPosition { position, entity: description })
    }

    fn find(&mut self, world: &World, paths: &[String]) -> Option<(Entity, &Sign)> {
        let components = world.components().num_registered();
        if self.known != components {
            *self = Self {
                known: components,
                signs: signs(world, paths, &named(world)),
                camera: component_of(world, "Camera3d"),
            };
        }
        for sign in &self.signs {
            match sign.entities(world).as_slice() {
                [] => {}
                [entity] => return Some((*entity, sign)),
                _ => return None,
            }
        }
        None
    }
}

impl Sign {
    /// Returns the entities that have the sign and a `Transform`.
    fn entities(&self, world: &World) -> Vec<Entity> {
        let Some(transform) = world.components().component_id::<Transform>() else { return Vec::new() };
        let may_match = |archetype: &&Archetype| match self {
            Self::Components(any) => any.iter().any(|(_, component)| archetype.contains(*component)),
            Self::Name(_) => true,
        };
        let is_meant = |entity: &Entity| match self {
            Self::Components(_) => true,
            Self::Name(name) => world.get::<Name>(*entity).is_some_and(|found| found.as_str() == name),
        };
        let archetypes = world.archetypes().iter().filter(|archetype| archetype.contains(transform)).filter(may_match);
        let entities = archetypes.flat_map(|archetype| archetype.entities().iter().map(|entity| entity.id()));
        entities.filter(is_meant).collect()
    }

    /// Describes the entity by the sign.
    fn describe(&self, world: &World, entity: Entity) -> String {
        match self {
            Self::Components(any) => {
                let own = any.iter().find(|(_, component)| world.entity(entity).contains_id(*component));
                format!("the entity with `{}`", own.map_or(WORD, |(name, _)| name.as_str()))
            }
            Self::Name(name) => format!("the entity named `{name}`"),
        }
    }
}

/// Returns the signs, the most certain first. `named` are components that look like the player.
fn signs(world: &World, paths: &[String], named: &[(String, ComponentId)]) -> Vec<Sign> {
    let read = paths.iter().filter_map(|path| {
        let mut parts = path.split('.');
        let (marker, component) = (parts.next()?, parts.next()?);
        ["Transform", "GlobalTransform"].contains(&component).then_some(marker)
    });
    let read: BTreeSet<&str> = read.collect();
    let mut signs = Vec::new();
    if let (Some(marker), 1) = (read.first(), read.len()) {
        let name = (*marker).to_owned();
        signs.push(match component_of(world, marker) {
            Some(component) => Sign::Components(vec![(name, component)]),
            None => Sign::Name(name),
        });
    }
    let with = |is_meant: &dyn Fn(&str) -> bool| {
        Sign::Components(named.iter().filter(|(name, _)| is_meant(name)).cloned().collect())
    };
    signs.extend([with(&|name| name == WORD), with(&|name| name.contains(WORD)), Sign::Name(WORD.to_owned())]);
    signs.extend(PLAYER_NAMES[1..].iter().map(|word| with(&|name| name == *word)));
    signs
}

/// Returns the game's components whose short names look like the player, in the order of their names.
fn named(world: &World) -> Vec<(String, ComponentId)> {
    let components = world.components();
    let mut found = BTreeSet::new();
    let mut note = |path: &str, component: ComponentId| {
        let plain = path.split('<').next().unwrap_or_default();
        let short = plain.rsplit("::").next().unwrap_or_default();
        let is_engine = is_ours(path) || ENGINE.iter().any(|of| path.starts_with(of));
        if (short.contains(WORD) || PLAYER_NAMES.contains(&short)) && !is_engine {
            found.insert((short.to_owned(), component));
        }
    };
    // Bevy keeps these names with its feature `debug` only.
    components.iter_registered().for_each(|info| note(&info.name(), info.id()));
    if let Some(registry) = world.get_resource::<AppTypeRegistry>() {
        for known in registry.read().iter() {
            if let Some(component) = components.get_id(known.type_id()) {
                note(known.type_info().type_path(), component);
            }
        }
    }
    found.into_iter().collect()
}

/// Returns where an entity is in the World.
fn translation(world: &World, entity: Entity) -> Option<Vec3> {
    let place = world.get::<GlobalTransform>(entity).filter(|_| world.get::<ChildOf>(entity).is_some());
    let own = || world.get::<Transform>(entity).map(|transform| transform.translation);
    place.map(GlobalTransform::translation).or_else(own)
}

fn has_any(world: &World, component: ComponentId) -> bool {
    world.archetypes().iter().any(|archetype| archetype.contains(component) && !archetype.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Component)]
    struct Player;

    #[derive(Component)]
    struct PlayerHat;

    #[derive(Component)]
    struct Hero;

    fn guessed(world: &World, paths: &[&str]) -> Option<(f32, String)> {
        let paths: Vec<String> = paths.iter().map(|path| (*path).to_owned()).collect();
        // The tests' own components are those of this crate, which a guess leaves out.
        let components = world.components();
        let mine = [
            ("Player", components.component_id::<Player>()),
            ("PlayerHat", components.component_id::<PlayerHat>()),
            ("Hero", components.component_id::<Hero>()),
        ];
        let mine = mine.into_iter().filter_map(|(name, component)| Some((name.to_owned(), component?)));
        let mine: Vec<_> = mine.collect();
        let mut guess = PlayerGuess {
            known: components.num_registered(),
            signs: signs(world, &paths, &mine),
            camera: component_of(world, "Camera3d"),
        };
        guess.position(world, &paths).map(|found| (found.position.x, found.entity))
    }

    #[test]
    fn the_only_player_is_the_agent_and_two_are_no_guess() {
        let mut world = World::new();
        assert_eq!(guessed(&world, &[]), None);
        world.spawn((PlayerHat, Transform::from_xyz(9.0, 0.0, 0.0)));
        assert_eq!(guessed(&world, &[]), Some((9.0, "the entity with `PlayerHat`".to_owned())));
        world.spawn((Player, Transform::from_xyz(2.0, 0.0, 0.0)));
        assert_eq!(
            guessed(&world, &[]),
            Some((2.0, "the entity with `Player`".to_owned())),
            "its hat is another entity"
        );
        world.spawn((Player, Transform::from_xyz(3.0, 0.0, 0.0)));
        assert_eq!(guessed(&world, &[]), None, "which of the two is meant is not certain");
    }

    #[test]
    fn a_hero_is_the_agent_of_a_game_without_a_player() {
        let mut world = World::new();
        world.spawn((Hero, Transform::from_xyz(4.0, 0.0, 0.0)));
        assert_eq!(guessed(&world, &[]), Some((4.0, "the entity with `Hero`".to_owned())));
        world.spawn((Player, Transform::from_xyz(2.0, 0.0, 0.0)));
        assert_eq!(guessed(&world, &[]), Some((2.0, "the entity with `Player`".to_owned())));
    }

    #[test]
    fn the_entity_of_observed_transforms_comes_before_a_player() {
        let mut world = World::new();
        world.spawn((Player, Transform::from_xyz(2.0, 0.0, 0.0)));
        world.spawn((Hero, Name::new("Ball"), Transform::from_xyz(5.0, 0.0, 0.0)));
        let by_name = Some((5.0, "the entity named `Ball`".to_owned()));
        assert_eq!(guessed(&world, &["Ball.Transform.translation.x", "Score.0"]), by_name);
        let by_both = guessed(&world, &["Ball.Transform.translation.x", "Paddle.Transform.translation.x"]);
        assert_eq!(by_both, Some((2.0, "the entity with `Player`".to_owned())), "two are observed");
    }

    #[test]
    fn a_child_is_where_its_parents_have_put_it() {
        let mut world = World::new();
        let place = GlobalTransform::from_translation(Vec3::new(7.0, 0.0, 0.0));
        let child = world.spawn((Name::new("Player"), Transform::from_xyz(1.0, 0.0, 0.0))).id();
        world.spawn(Transform::from_xyz(6.0, 0.0, 0.0)).add_child(child);
        world.entity_mut(child).insert(place);
        assert_eq!(guessed(&world, &[]), Some((7.0, "the entity named `Player`".to_owned())));
    }

    #[test]
    fn components_of_the_engine_and_of_the_plugin_mark_no_agent() {
        let mut world = World::new();
        world.spawn((Player, Transform::default()));
        assert!(named(&world).is_empty(), "this crate is a part of the plugin");
    }
}
