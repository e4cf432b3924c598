//! Shared memory for the observations of all Worlds, each of which fills its own part of every tick.

use crate::{LearnError, ObsKind, ObsSlice, Observations};

/// The observations of some environments in a rollout of more, tick by tick.
#[derive(Debug)]
pub struct ObsColumns<'a> {
    /// The remaining ticks, the next one last.
    ticks: Vec<Tick<'a>>,
}

#[derive(Debug)]
enum Tick<'a> {
    Vector(&'a mut [f32]),
    Image(&'a mut [u8]),
}

impl ObsColumns<'_> {
    /// Writes the observations of the next tick.
    ///
    /// # Errors
    /// [`LearnError::Shape`] if their number differs from that of environments, or the rollout is full;
    /// [`LearnError::Config`] if they are of another kind.
    pub fn fill_next(&mut self, obs: ObsSlice<'_>) -> Result<(), LearnError> {
        let what = "observations of a tick";
        match (self.ticks.pop(), obs) {
            (Some(Tick::Vector(to)), ObsSlice::Vector(from)) => {
                LearnError::check(what, to.len(), from.len())?;
                to.copy_from_slice(from);
            }
            (Some(Tick::Image(to)), ObsSlice::Image(from)) => {
                LearnError::check(what, to.len(), from.len())?;
                to.copy_from_slice(from);
            }
            (None, obs) => LearnError::check(what, 0, obs.numbers())?,
            (Some(_), _) => return Err(LearnError::Config("a tick's observations are of another kind".to_owned())),
        }
        Ok(())
    }
}

impl Observations {
    /// Makes room for `steps` ticks of the environments of all `shares`, if needed, and returns the columns of each
    /// share.
    pub fn columns(&mut self, kind: &ObsKind, steps: usize, shares: &[usize]) -> Vec<ObsColumns<'_>> {
        let rows = steps * shares.iter().sum::<usize>();
        if self.as_slice().check_size("rollout obs", kind, rows).is_err() {
            *self = Self::zeros(kind, rows);
        }
        let sizes: Vec<usize> = shares.iter().map(|share| share * kind.numbers()).collect();
        let all = match self {
            Self::Vector(values) => split(values, steps, &sizes, Tick::Vector),
            Self::Image(pixels) => split(pixels, steps, &sizes, Tick::Image),
        };
        all.into_iter().map(|ticks| ObsColumns { ticks }).collect()
    }
}

/// Splits each tick into the parts of all shares, from the last tick to the first.
fn split<'a, T>(
    mut rest: &'a mut [T],
    steps: usize,
    sizes: &[usize],
    tick: impl Fn(&'a mut [T]) -> Tick<'a>,
) -> Vec<Vec<Tick<'a>>> {
    let mut all: Vec<Vec<Tick<'a>>> = sizes.iter().map(|_| Vec::with_capacity(steps)).collect();
    for _ in 0..steps {
        for (ticks, size) in all.iter_mut().zip(sizes) {
            let (part, behind) = rest.split_at_mut(*size);
            ticks.push(tick(part));
            rest = behind;
        }
    }
    all.iter_mut().for_each(|ticks| ticks.reverse());
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worlds_fill_what_belongs_to_them() {
        let (kind, mut all) = (ObsKind::Vector(2), Observations::Vector(vec![7.0]));
        let mut parts = all.columns(&kind, 2, &[2, 1]);
        for tick in 0..2 {
            let from = 10.0 * tick as f32;
            parts[1].fill_next(ObsSlice::Vector(&[from + 5.0, from + 6.0])).expect("fits");
            parts[0].fill_next(ObsSlice::Vector(&[from + 1.0, from + 2.0, from + 3.0, from + 4.0])).expect("fits");
        }
        assert!(parts[0].fill_next(ObsSlice::Vector(&[1.0])).is_err(), "it is full");
        drop(parts);
        let want = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0];
        assert_eq!(all, Observations::Vector(want));
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let kind = ObsKind::Vector(2);
        let mut all = Observations::empty(&kind);
        let mut parts = all.columns(&kind, 2, &[1]);
        let error = parts[0].fill_next(ObsSlice::Vector(&[1.0])).expect_err("too short").to_string();
        assert!(error.contains("observations of a tick"), "{error}");
        assert!(parts[0].fill_next(ObsSlice::Image(&[1, 2])).is_err());
    }
}
