//! Creation order of the bodies of a level, as text.
//!
//! Files list saws, crates and enemies apart. The creation order of all of them decides which of two overlapping bodies
//! is in front.

use super::spawn::Spawn;

fn letter(spawn: &Spawn) -> char {
    match spawn {
        Spawn::Saw(_) => 's',
        Spawn::Crate { .. } => 'c',
        Spawn::Enemy { .. } => 'e',
    }
}

/// Returns a letter for each body: `s`, `c` or `e`. `None` for all saws before all crates before all enemies.
pub(super) fn to_text(spawns: &[Spawn]) -> Option<String> {
    let order: String = spawns.iter().map(letter).collect();
    let kinds = ["s", "c", "e"].map(|kind| kind.repeat(order.matches(kind).count()));
    (order != kinds.concat()).then_some(order)
}

/// Arranges the bodies in the order of the letters; `None` unless there is one letter for each body. Bodies of one kind
/// stay in their order.
pub(super) fn arrange(order: &str, spawns: &[Spawn]) -> Option<Vec<Spawn>> {
    let mut kinds = ['s', 'c', 'e'].map(|kind| (kind, spawns.iter().filter(move |spawn| letter(spawn) == kind)));
    let mut arranged = Vec::with_capacity(spawns.len());
    for wanted in order.chars() {
        let (_, bodies) = kinds.iter_mut().find(|(kind, _)| *kind == wanted)?;
        arranged.push(*bodies.next()?);
    }
    (arranged.len() == spawns.len()).then_some(arranged)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_come_back_in_the_order_in_which_they_were() {
        let (saw, other) = (Spawn::Saw([1, 1]), Spawn::Saw([2, 1]));
        let wooden = Spawn::Crate { cell: [1, 1], sprite: 2 };
        let enemy = Spawn::Enemy { cell: [3, 1], dir: 1, sprite: 0 };
        let mixed = [saw, enemy, wooden, other];
        let listed = [saw, other, wooden, enemy];
        assert_eq!((to_text(&mixed).as_deref(), to_text(&listed)), (Some("secs"), None));
        assert_eq!(arrange("secs", &listed).as_deref(), Some(&mixed[..]));
        for bad in ["", "sec", "secss", "seccs", "secx"] {
            assert_eq!(arrange(bad, &listed), None, "{bad}");
        }
    }
}
