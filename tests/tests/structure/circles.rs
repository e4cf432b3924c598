//! Circles of modules that need one another.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::imports::Need;

/// The modules of one folder, and which of them needs which of the others: the first place where it says so.
pub type Folder<'a> = BTreeMap<(&'a str, &'a str), &'a Need>;

/// Needs between modules that stand side by side, folder by folder. The crate's own folder is `[]`.
pub fn folders(needs: &[Need]) -> BTreeMap<&[String], Folder<'_>> {
    let mut found: BTreeMap<&[String], Folder> = BTreeMap::new();
    for need in needs {
        let common = need.from.iter().zip(&need.to).take_while(|(one, other)| one == other).count();
        if let (Some(from), Some(to)) = (need.from.get(common), need.to.get(common)) {
            found.entry(&need.from[..common]).or_default().entry((from, to)).or_insert(need);
        }
    }
    found
}

/// A shortest circle for each module that is in one and not in an earlier one: needs, each from where the last one
/// leads.
pub fn circles<'a>(folder: &Folder<'a>) -> Vec<Vec<&'a Need>> {
    let names: BTreeSet<&str> = folder.keys().map(|(from, _)| *from).collect();
    let (mut found, mut seen) = (Vec::new(), BTreeSet::new());
    for name in names {
        if seen.contains(name) {
            continue;
        }
        if let Some(way) = shortest_way_round(folder, name) {
            seen.extend(way.iter().map(|(from, _)| *from));
            found.push(way.iter().map(|edge| folder[edge]).collect());
        }
    }
    found
}

fn shortest_way_round<'a>(folder: &Folder<'a>, name: &'a str) -> Option<Vec<(&'a str, &'a str)>> {
    let mut came_from: BTreeMap<&str, (&str, &str)> = BTreeMap::new();
    let mut queue = VecDeque::from([name]);
    while let Some(at) = queue.pop_front() {
        for &(from, to) in folder.keys().filter(|(from, _)| *from == at) {
            if came_from.contains_key(to) {
                continue;
            }
            came_from.insert(to, (from, to));
            if to == name {
                let mut way = vec![(from, to)];
                while way[0].0 != name {
                    way.insert(0, came_from[way[0].0]);
                }
                return Some(way);
            }
            queue.push_back(to);
        }
    }
    None
}
