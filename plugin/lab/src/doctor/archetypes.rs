//! More archetypes in a World, to reveal games that depend on the order of archetypes.

use bevy::prelude::*;
use bevy_playbot::renewal::Renewal;

/// Copies with other numbers of archetypes. One of several shows a difference that another may hide by chance.
pub(super) const VARIANTS: u32 = 7;

#[derive(Component, Reflect)]
#[reflect(Component)]
struct First;

#[derive(Component, Reflect)]
#[reflect(Component)]
struct Second;

#[derive(Component, Reflect)]
#[reflect(Component)]
struct Third;

/// Creates `count` archetypes, at most 7, before those of the game's start.
///
/// Bevy's queries go over archetypes in an order that depends on their numbers, and these depend on how many archetypes
/// there were before. A recorder, a window and every plugin add some.
pub(super) fn add_archetypes(world: &mut World, count: u32) {
    Renewal::set_up(world, move |world| (1..=count).for_each(|kinds| add_archetype(world, kinds)));
}

/// Creates the archetype of these components, one bit for each.
fn add_archetype(world: &mut World, kinds: u32) {
    let mut entity = world.spawn_empty();
    if kinds & 1 != 0 {
        entity.insert(First);
    }
    if kinds & 2 != 0 {
        entity.insert(Second);
    }
    if kinds & 4 != 0 {
        entity.insert(Third);
    }
    entity.despawn();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_makes_another_archetype() {
        let mut world = World::new();
        let before = world.archetypes().len();
        add_archetypes(&mut world, 7);
        assert_eq!(world.archetypes().len(), before + 7);
    }
}
