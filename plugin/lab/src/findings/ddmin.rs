//! ddmin: the search for a part of a list with the same effect as the whole list (Zeller and Hildebrandt, Simplifying
//! and isolating failure-inducing input, IEEE Transactions on Software Engineering 28 (2), 2002).

/// Leaves out parts of a list until no more can be left out, or the budget of `try_it` is used up.
///
/// `try_it` receives a shorter list. It returns `Some` if the effect remains, with the number of items that were
/// needed, counted from the first; else `None`. The order of its calls is reproducible.
pub(super) fn ddmin<T: Clone>(
    mut items: Vec<T>,
    has_enough: &dyn Fn() -> bool,
    mut try_it: impl FnMut(&[T]) -> Option<usize>,
) -> Vec<T> {
    let mut parts = 2;
    while items.len() >= 2 && !has_enough() {
        match reduced(&items, parts, has_enough, &mut try_it) {
            Some((shorter, next)) => {
                items = shorter;
                parts = next.clamp(2, items.len().max(2));
            }
            None if parts >= items.len() => break,
            None => parts = (2 * parts).min(items.len()),
        }
    }
    if items.len() == 1 && !has_enough() && try_it(&[]).is_some() {
        items.clear();
    }
    items
}

/// Returns the first part with the effect, or else the first remainder without one part, with the number of parts to go
/// on with.
fn reduced<T: Clone>(
    items: &[T],
    parts: usize,
    has_enough: &dyn Fn() -> bool,
    try_it: &mut impl FnMut(&[T]) -> Option<usize>,
) -> Option<(Vec<T>, usize)> {
    let bounds: Vec<usize> = (0..=parts).map(|part| part * items.len() / parts).collect();
    let ends = || bounds.windows(2).map(|ends| (ends[0], ends[1]));
    let mut still = |candidate: Vec<T>| {
        let needed = if has_enough() { None } else { try_it(&candidate) }?;
        Some(candidate[..needed.min(candidate.len())].to_vec())
    };
    for (start, end) in ends() {
        if let Some(part) = still(items[start..end].to_vec()) {
            return Some((part, 2));
        }
    }
    // With two parts, the remainder without one is the other.
    if parts > 2 {
        for (start, end) in ends() {
            if let Some(rest) = still([&items[..start], &items[end..]].concat()) {
                return Some((rest, parts - 1));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    const NEVER: &dyn Fn() -> bool = &|| false;

    /// The effect needs these items in this order. Returns how far the list has to be read.
    fn needs(list: &[u32], wanted: &[u32]) -> Option<usize> {
        let mut at = 0;
        for number in wanted {
            at += list[at..].iter().position(|found| found == number)? + 1;
        }
        Some(at)
    }

    #[test]
    fn what_is_not_needed_is_left_out() {
        for wanted in [&[3][..], &[0, 99], &[7, 8, 50], &[10, 20, 30, 40, 90], &[]] {
            let found = ddmin((0..100).collect(), NEVER, |list| needs(list, wanted));
            assert_eq!(found, wanted, "{wanted:?}");
        }
    }

    #[test]
    fn a_list_that_needs_all_of_it_stays() {
        let all: Vec<u32> = (0..9).collect();
        assert_eq!(ddmin(all.clone(), NEVER, |list| needs(list, &all)), all);
        assert!(ddmin(Vec::<u32>::new(), NEVER, |_| panic!("there is nothing to try")).is_empty());
    }

    #[test]
    fn it_ends_when_it_has_had_enough_with_the_best_so_far() {
        let tried = Cell::new(0);
        let found = ddmin((0..1000).collect(), &|| tried.get() >= 20, |list| {
            tried.set(tried.get() + 1);
            needs(list, &[400, 700])
        });
        assert_eq!(tried.get(), 20);
        assert!(found.len() < 1000 && needs(&found, &[400, 700]).is_some(), "{}", found.len());
    }
}
