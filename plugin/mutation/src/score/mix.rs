//! The mixes of testers that find most together.

/// Most testers for which all mixes are tried. With more, the best next tester is added again and again.
const MOST_TRIED: usize = 14;

/// The defects that a tester found, and its false findings.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Catch {
    /// For each mutant, in the same order for all testers.
    pub found: Vec<bool>,
    /// For each unmutated level, in the same order for all testers.
    pub false_findings: Vec<bool>,
    /// For each unmutated level, whether it is called unsolvable.
    pub unsolvable: Vec<bool>,
}

/// The limits of false findings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    /// Largest share of the unmutated levels with a finding.
    pub false_share: f64,
}

impl Catch {
    /// Joins the findings of a mix of testers.
    pub fn of(all: &[Self], mix: &[usize]) -> Self {
        let join = |part: fn(&Self) -> &Vec<bool>| {
            let length = all.first().map_or(0, |catch| part(catch).len());
            let any = |index: usize| mix.iter().any(|&tester| part(&all[tester])[index]);
            (0..length).map(any).collect()
        };
        Self {
            found: join(|catch| &catch.found),
            false_findings: join(|catch| &catch.false_findings),
            unsolvable: join(|catch| &catch.unsolvable),
        }
    }

    fn is_within(&self, limits: Limits) -> bool {
        let most = limits.false_share * self.false_findings.len() as f64;
        count(&self.unsolvable) == 0 && count(&self.false_findings) as f64 <= most
    }
}

fn count(list: &[bool]) -> usize {
    list.iter().filter(|is| **is).count()
}

/// Returns the smallest mix of testers that finds most, by their indices. Of several of the same size it is the one
/// with the fewest false findings, then the first. With limits, only mixes within them count.
pub(super) fn best_mix(all: &[Catch], limits: Option<Limits>) -> Vec<usize> {
    if all.len() <= MOST_TRIED { best_of_all(all, limits) } else { greedy(all, limits) }
}

/// Returns the rank of a mix; more is better.
fn rank(catch: &Catch, size: usize) -> (usize, std::cmp::Reverse<(usize, usize)>) {
    (count(&catch.found), std::cmp::Reverse((size, count(&catch.false_findings))))
}

fn is_allowed(catch: &Catch, limits: Option<Limits>) -> bool {
    limits.is_none_or(|limits| catch.is_within(limits))
}

fn best_of_all(all: &[Catch], limits: Option<Limits>) -> Vec<usize> {
    let mut best = (rank(&Catch::of(all, &[]), 0), Vec::new());
    for mask in 1_u32..1 << all.len() {
        let mix: Vec<usize> = (0..all.len()).filter(|tester| (mask >> tester) & 1 == 1).collect();
        let catch = Catch::of(all, &mix);
        let rank = rank(&catch, mix.len());
        if rank > best.0 && is_allowed(&catch, limits) {
            best = (rank, mix);
        }
    }
    best.1
}

fn greedy(all: &[Catch], limits: Option<Limits>) -> Vec<usize> {
    let mut mix: Vec<usize> = Vec::new();
    loop {
        let before = count(&Catch::of(all, &mix).found);
        let more = (0..all.len()).filter(|tester| !mix.contains(tester)).filter_map(|tester| {
            let longer = [mix.as_slice(), &[tester]].concat();
            let catch = Catch::of(all, &longer);
            let is_better = count(&catch.found) > before && is_allowed(&catch, limits);
            is_better.then(|| (rank(&catch, longer.len()), longer))
        });
        // The first of equal ones.
        let best = more.reduce(|best, other| if other.0 > best.0 { other } else { best });
        match best {
            Some((_, longer)) => mix = longer,
            None => break,
        }
    }
    mix.sort_unstable();
    mix
}

#[cfg(test)]
mod tests {
    use super::*;

    fn catch(found: &str, false_findings: &str) -> Catch {
        let list = |text: &str| text.chars().map(|sign| sign == 'x').collect::<Vec<bool>>();
        let unsolvable = vec![false; false_findings.len()];
        Catch { found: list(found), false_findings: list(false_findings), unsolvable }
    }

    #[test]
    fn the_smallest_mix_that_finds_most_is_found_where_greed_takes_one_too_many() {
        let all = [catch("xxxx--", "-"), catch("xx--x-", "-"), catch("--xx-x", "-")];
        assert_eq!(best_mix(&all, None), [1, 2]);
        assert_eq!(greedy(&all, None), [0, 1, 2]);
        assert_eq!(count(&Catch::of(&all, &[1, 2]).found), 6);
    }

    #[test]
    fn of_equals_the_one_with_fewer_false_findings_is_taken_and_then_the_first() {
        let all = [catch("x-", "x-"), catch("x-", "--"), catch("x-", "--")];
        assert_eq!((best_mix(&all, None), greedy(&all, None)), (vec![1], vec![1]));
        assert!(best_mix(&[catch("--", "-")], None).is_empty(), "no tester is needed to find nothing");
        assert!(best_mix(&[], None).is_empty());
    }

    #[test]
    fn limits_keep_testers_out() {
        let loud = catch("xx", "xxxx");
        let mut wrong = catch("xx", "----");
        wrong.unsolvable[2] = true;
        let all = [loud, wrong, catch("x-", "---x")];
        let within = |false_share| Some(Limits { false_share });
        assert_eq!(best_mix(&all, None), [1]);
        assert_eq!(best_mix(&all, within(0.25)), [2]);
        assert!(best_mix(&all, within(0.24)).is_empty());
        assert_eq!(greedy(&all, within(0.25)), [2]);
    }

    #[test]
    fn many_testers_are_added_one_by_one() {
        let all: Vec<Catch> = (0..20)
            .map(|tester| {
                catch(&(0..20).map(|mutant| if mutant == tester { 'x' } else { '-' }).collect::<String>(), "-")
            })
            .collect();
        assert_eq!(best_mix(&all, None), (0..20).collect::<Vec<_>>());
    }
}
