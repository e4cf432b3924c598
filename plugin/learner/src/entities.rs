//! Sets of things in vector observations: their names, their places, and their order.
//!
//! A game with a changing number of enemies observes them as a set: a block of slots in the vector, one per thing. Each
//! slot begins with a presence, 1 or 0, and goes on with the thing's numbers. All numbers of an absent thing are 0. The
//! names of the values say which blocks are sets, so everything that has names knows them: recordings, policy files,
//! checkpoints.

use crate::{LearnError, ObsKind};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The field before the others of a slot: 1 if the slot holds a thing, otherwise 0.
pub const PRESENT: &str = "present";

/// The place of a set in a vector observation: `slots` times a presence and `width` numbers.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct EntityBlock {
    /// Number of values before it.
    pub start: usize,
    /// Most things that it holds.
    pub slots: usize,
    /// Numbers of a thing, without its presence.
    pub width: usize,
}

impl EntityBlock {
    /// Returns the number of values of all slots, presences included.
    pub fn numbers(&self) -> usize {
        self.slots.saturating_mul(self.width.saturating_add(1))
    }

    /// Returns the places of its values.
    pub fn range(&self) -> Range<usize> {
        self.start..self.start.saturating_add(self.numbers())
    }

    /// Writes the numbers of the things in `row`, an observation, to `things`, in an order that depends only on their
    /// numbers. Things in other slots so give the same list, and networks the same result to the bit.
    pub(crate) fn things<'a>(&self, row: &'a [f32], things: &mut Vec<&'a [f32]>) {
        things.clear();
        let slots = row[self.range()].chunks_exact(self.width + 1);
        things.extend(slots.filter_map(|slot| match slot.split_first() {
            Some((present, numbers)) if *present > 0.5 => Some(numbers),
            _ => None,
        }));
        things.sort_unstable_by(|a, b| {
            let pairs = a.iter().zip(b.iter()).map(|(a, b)| a.total_cmp(b));
            pairs.into_iter().find(|order| order.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
        });
    }

    /// Checks that sets lie in observations of `kind`, one behind the other.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the first set that does not.
    pub(crate) fn check_all(blocks: &[Self], kind: &ObsKind) -> Result<(), LearnError> {
        let ObsKind::Vector(values) = *kind else {
            return match blocks {
                [] => Ok(()),
                _ => Err(LearnError::Config(format!("sets of things are parts of vectors, not of {kind}"))),
            };
        };
        let mut end = 0;
        for (number, block) in blocks.iter().enumerate() {
            let Range { start, end: last } = block.range();
            if block.slots == 0 || block.width == 0 || start < end || last > values {
                return Err(LearnError::Config(format!(
                    "set {number}, of {} slots with {} numbers each, takes the values {start}..{last}: sets have slots and \
                     numbers, follow one another, and lie in the {values} observed values",
                    block.slots, block.width
                )));
            }
            end = last;
        }
        Ok(())
    }
}

/// A set of things with its names.
///
/// ```
/// use playbot_learner::EntitySet;
///
/// let mut names = vec!["x".to_owned()];
/// names.extend(EntitySet::names("enemy", 2, &["dx", "dy"]));
/// assert_eq!(names[1..4], ["enemy[0].present", "enemy[0].dx", "enemy[0].dy"]);
/// let sets = EntitySet::all_in(&names);
/// assert_eq!((sets[0].name.as_str(), &sets[0].fields[..]), ("enemy", &["dx".to_owned(), "dy".to_owned()][..]));
/// assert_eq!((sets[0].block.start, sets[0].block.slots, sets[0].block.width), (1, 2, 2));
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EntitySet {
    /// Its name, such as `enemy`.
    pub name: String,
    /// Names of a thing's numbers, such as `dx`.
    pub fields: Vec<String>,
    /// Its place in the observation.
    pub block: EntityBlock,
}

impl EntitySet {
    /// Returns the names of all values of a set: `enemy[0].present`, `enemy[0].dx`, …, `enemy[1].present`, ….
    pub fn names<'a, S: AsRef<str>>(name: &'a str, slots: usize, fields: &'a [S]) -> impl Iterator<Item = String> + 'a {
        (0..slots).flat_map(move |slot| {
            let fields = std::iter::once(PRESENT).chain(fields.iter().map(AsRef::as_ref));
            fields.map(move |field| format!("{name}[{slot}].{field}"))
        })
    }

    /// Returns the sets among values of these names: each begins with `name[0].present`. Its slots have the same fields
    /// and follow one another.
    pub fn all_in(names: &[impl AsRef<str>]) -> Vec<Self> {
        let name_at = |place: usize| names.get(place).map(AsRef::as_ref).unwrap_or_default();
        let (mut sets, mut start) = (Vec::new(), 0);
        while start < names.len() {
            let name = name_at(start).strip_suffix(PRESENT).and_then(|rest| rest.strip_suffix("[0]."));
            let Some(name) = name.filter(|name| !name.is_empty()) else {
                start += 1;
                continue;
            };
            let first = format!("{name}[0].");
            let fields: Vec<String> = (start + 1..names.len())
                .map_while(|place| name_at(place).strip_prefix(&first).map(str::to_owned))
                .collect();
            let width = fields.len();
            let is_slot = |slot: usize| {
                let named = Self::names(name, slot + 1, &fields).skip(slot * (width + 1));
                named.enumerate().all(|(i, named)| name_at(start + slot * (width + 1) + i) == named)
            };
            let slots = 1 + (1..).take_while(|&slot| is_slot(slot)).count();
            let block = EntityBlock { start, slots, width };
            start = block.range().end;
            if width > 0 {
                sets.push(Self { name: name.to_owned(), fields, block });
            }
        }
        sets
    }

    /// Returns the places of the same number in all slots, for a `place` in the set.
    pub fn same_field(&self, place: usize) -> impl Iterator<Item = usize> + use<> {
        let EntityBlock { start, slots, width } = self.block;
        let field = place.saturating_sub(start) % (width + 1);
        (0..slots).map(move |slot| start + slot * (width + 1) + field)
    }

    /// Returns whether `place` is a number of a slot that holds nothing in this observation.
    pub fn is_absent(&self, place: usize, observation: &[f32]) -> bool {
        let EntityBlock { start, width, .. } = self.block;
        let slot = place.saturating_sub(start) / (width + 1);
        let presence = start + slot * (width + 1);
        let is_here = observation.get(presence).is_some_and(|present| *present > 0.5);
        self.block.range().contains(&place) && place != presence && !is_here
    }

    /// Returns whether all slots of an observation hold a thing, so that others may have been left out.
    pub fn is_full(&self, observation: &[f32]) -> bool {
        self.same_field(self.block.start).all(|place| observation.get(place).is_some_and(|present| *present > 0.5))
    }

    /// Returns which values of an observation with these `sets` say nothing, if `is_constant` says which ones never
    /// change. A number of a set says nothing if it is constant in all slots, and is then returned for the first one
    /// alone: a slot that is always empty is no fault.
    pub fn constant_values(sets: &[Self], values: usize, is_constant: impl Fn(usize) -> bool) -> Vec<usize> {
        let says_nothing = |place: &usize| match sets.iter().find(|set| set.block.range().contains(place)) {
            None => is_constant(*place),
            Some(set) => set.same_field(*place).next() == Some(*place) && set.same_field(*place).all(&is_constant),
        };
        (0..values).filter(says_nothing).collect()
    }
}

/// Writes it as `enemy: up to 8 with dx, dy`.
impl std::fmt::Display for EntitySet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: up to {} with {}", self.name, self.block.slots, self.fields.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_which_values_are_sets() {
        let mut names = vec!["x".to_owned(), "lonely[0].present".to_owned(), "y".to_owned()];
        names.extend(EntitySet::names("enemy", 3, &["dx", "dy"]));
        names.extend(EntitySet::names("coin", 1, &["dx"]));
        names.extend(["coin[2].present", "other[1].present", "other[1].dx"].map(str::to_owned));
        let sets: Vec<_> = EntitySet::all_in(&names).into_iter().map(|set| (set.to_string(), set.block)).collect();
        let block = |start, slots, width| EntityBlock { start, slots, width };
        assert_eq!(
            sets,
            [
                ("enemy: up to 3 with dx, dy".to_owned(), block(3, 3, 2)),
                ("coin: up to 1 with dx".to_owned(), block(12, 1, 1)),
            ]
        );
        assert!(EntitySet::all_in(&["enemy 0 present", "enemy 0 dx"]).is_empty(), "names of another form");
    }

    #[test]
    fn slots_that_are_always_empty_are_not_constant_values() {
        let names: Vec<String> =
            ["x".to_owned()].into_iter().chain(EntitySet::names("enemy", 3, &["dx", "dy"])).collect();
        let sets = EntitySet::all_in(&names);
        assert_eq!(sets[0].same_field(6).collect::<Vec<_>>(), [3, 6, 9]);
        let constant = |varied: &[usize]| EntitySet::constant_values(&sets, 10, |place| !varied.contains(&place));
        assert_eq!(constant(&[0, 1, 2, 3]), [] as [usize; 0], "one thing alone was ever seen");
        assert_eq!(constant(&[1, 4, 2]), [0, 3], "nothing has ever been above or below");
        assert_eq!(constant(&[]), [0, 1, 2, 3]);
        let mut row = vec![0.0, 1.0, 0.5, 0.5, 1.0, 0.5, 0.5, 0.0, 0.0, 0.0];
        assert!(!sets[0].is_full(&row));
        let absent: Vec<usize> = (0..10).filter(|place| sets[0].is_absent(*place, &row)).collect();
        assert_eq!(absent, [8, 9], "a presence is there, whatever it says");
        row[7] = 1.0;
        assert!(sets[0].is_full(&row));
    }

    #[test]
    fn things_come_in_an_order_of_their_own() {
        let block = EntityBlock { start: 1, slots: 4, width: 2 };
        let (a, b, c) = ([1.0, 0.5, -1.0], [1.0, -0.5, 9.0], [1.0, 0.5, -2.0]);
        let absent = [0.0; 3];
        let row = |slots: [[f32; 3]; 4]| [&[7.0][..], &slots.concat()].concat();
        for slots in [[a, b, absent, c], [absent, c, b, a], [b, c, a, absent]] {
            let (row, mut things) = (row(slots), Vec::new());
            block.things(&row, &mut things);
            assert_eq!(things, [&b[1..], &c[1..], &a[1..]]);
        }
        let (nothing, mut things) = (row([absent; 4]), Vec::new());
        block.things(&nothing, &mut things);
        assert!(things.is_empty());
    }

    #[test]
    fn sets_outside_the_observation_are_refused() {
        let block = |start, slots, width| EntityBlock { start, slots, width };
        let text = |blocks: &[EntityBlock], values| {
            EntityBlock::check_all(blocks, &ObsKind::Vector(values)).map_err(|error| error.to_string())
        };
        assert_eq!(text(&[block(1, 2, 2), block(7, 1, 1)], 9), Ok(()));
        for (blocks, values) in [
            (&[block(1, 2, 2)][..], 6),
            (&[block(1, 2, 2), block(6, 1, 1)], 20),
            (&[block(0, 0, 2)], 6),
            (&[block(0, 2, 0)], 6),
            (&[block(usize::MAX, usize::MAX, 3)], 6),
        ] {
            assert!(text(blocks, values).expect_err("wrong").contains("lie in the"), "{blocks:?}");
        }
    }
}
