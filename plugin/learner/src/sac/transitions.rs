//! Conversion of rollouts to transitions.

use crate::{LearnError, Observations, Rollout};

/// One step of one environment: row `row` of a rollout and its next state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transition<'a> {
    /// The rollout's row, for everything but the next state.
    pub(super) row: usize,
    /// The observation after the action; `None` after a termination, where there is none.
    pub(super) next_obs: Option<&'a [f32]>,
    /// The skill under which that observation is valued; `None` likewise.
    pub(super) next_z: Option<&'a [f32]>,
    /// The remaining share of that skill's ticks; `None` likewise, and if the rollout does not have it.
    pub(super) next_left: Option<f32>,
}

/// Checks that a checked rollout holds the states where episodes were cut off and where it stops.
///
/// # Errors
/// [`LearnError::Shape`] names the first length that does not fit; [`LearnError::Config`] names a row.
pub(crate) fn check_ends(rollout: &Rollout) -> Result<(), LearnError> {
    let ends = &rollout.ends;
    let mut listed = ends.cut_rows.iter().copied();
    for row in (0..rollout.rows()).filter(|&row| is_cut(rollout, row)) {
        if listed.next() != Some(row) {
            let text = format!("rollout ends: row {row} cuts an episode off, but its last observation is missing");
            return Err(LearnError::Config(text));
        }
    }
    if let Some(row) = listed.next() {
        return Err(LearnError::Config(format!("rollout ends: row {row} is listed but cuts no episode off")));
    }
    ends.next_obs.as_slice().check_size("rollout ends next_obs", &rollout.obs_kind, rollout.envs)?;
    LearnError::check("rollout ends next_z", rollout.envs * rollout.latent, ends.next_z.len())
}

/// Returns the transitions of a checked rollout, in order of its rows.
///
/// The next state is the same environment's next row. Where the episode was cut off it is the episode's own last
/// state, and behind the last row the state where the rollout stopped. A row with both flags terminated.
///
/// # Errors
/// [`LearnError::Config`] if the observations are images.
pub(super) fn transitions(rollout: &Rollout) -> Result<impl Iterator<Item = Transition<'_>>, LearnError> {
    let ends = &rollout.ends;
    let width = rollout.obs_kind.numbers();
    let (obs, cut_obs, next_obs) = (vectors(&rollout.obs)?, vectors(&ends.cut_obs)?, vectors(&ends.next_obs)?);
    let mut cut = 0;
    Ok((0..rollout.rows()).map(move |row| {
        let next = |obs, z, left: &[f32], at: usize| Transition {
            row,
            next_obs: Some(slice(obs, width, at)),
            next_z: Some(slice(z, rollout.latent, at)),
            next_left: left.get(at).copied(),
        };
        let following = row + rollout.envs;
        if rollout.terminated[row] {
            Transition { row, next_obs: None, next_z: None, next_left: None }
        } else if is_cut(rollout, row) {
            cut += 1;
            next(cut_obs, &ends.cut_z, &ends.cut_left, cut - 1)
        } else if following < rollout.rows() {
            next(obs, &rollout.z, &rollout.left, following)
        } else {
            next(next_obs, &ends.next_z, &ends.next_left, following - rollout.rows())
        }
    }))
}

fn is_cut(rollout: &Rollout, row: usize) -> bool {
    rollout.truncated[row] && !rollout.terminated[row]
}

fn vectors(observations: &Observations) -> Result<&[f32], LearnError> {
    observations.as_slice().vectors("SAC")
}

/// Returns row `at` of a flat matrix.
pub(super) fn slice(values: &[f32], width: usize, at: usize) -> &[f32] {
    &values[at * width..(at + 1) * width]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{ActionSpace, Actions, EndStates};

    /// Returns a rollout of two environments, three steps, observations 0 to 5 and skills 10 to 15. Environment 0 is
    /// cut off at step 0 (its last observation is 50), environment 1 terminates at step 1 with both flags set.
    pub(in crate::sac) fn rollout() -> Rollout {
        let numbers = |base: f32| (0..6u8).map(|i| base + f32::from(i)).collect::<Vec<f32>>();
        let at = |rows: &[usize]| (0..6).map(|row| rows.contains(&row)).collect::<Vec<bool>>();
        Rollout {
            steps: 3,
            obs: numbers(0.0).into(),
            z: numbers(10.0),
            actions: Actions::Discrete(vec![0, 1, 2, 0, 1, 2]),
            log_probs: vec![0.0; 6],
            values: vec![0.0; 6],
            rewards: numbers(20.0),
            terminated: at(&[3]),
            truncated: at(&[0, 3]),
            final_values: vec![0.0; 6],
            next_values: vec![0.0; 2],
            left: vec![1.0, 0.5, 1.0, 1.0, 0.5, 0.5],
            ends: EndStates {
                cut_left: vec![0.25],
                next_left: vec![1.0, 0.75],
                cut_rows: vec![0],
                cut_obs: vec![50.0].into(),
                cut_z: vec![60.0],
                next_obs: vec![70.0, 71.0].into(),
                next_z: vec![80.0, 81.0],
            },
            ..Rollout::new(2, 1, 1, &ActionSpace::Discrete(3))
        }
    }

    #[test]
    fn every_row_leads_to_its_own_next_state() {
        let rollout = rollout();
        rollout.check().expect("it fits");
        check_ends(&rollout).expect("it fits");
        let next: Vec<_> = transitions(&rollout)
            .expect("vectors")
            .map(|t| t.next_obs.zip(t.next_z).zip(t.next_left).map(|((obs, z), left)| (obs[0], z[0], left)))
            .collect();
        let expected = [
            Some((50.0, 60.0, 0.25)), // cut off: not the row below, which belongs to the next episode
            Some((3.0, 13.0, 1.0)),
            Some((4.0, 14.0, 0.5)),
            None, // terminated, though also cut off
            Some((70.0, 80.0, 1.0)),
            Some((71.0, 81.0, 0.75)),
        ];
        assert_eq!(next, expected);
        assert!(transitions(&rollout).expect("vectors").map(|t| t.row).eq(0..6));
    }

    #[test]
    fn ends_that_do_not_fit_are_named() {
        let after = |change: fn(&mut Rollout)| {
            let mut rollout = rollout();
            change(&mut rollout);
            rollout.check().and_then(|()| check_ends(&rollout)).expect_err("does not fit").to_string()
        };
        assert!(after(|r| r.ends = EndStates::new(&r.obs_kind)).contains("row 0"));
        assert!(
            after(|r| {
                r.ends.cut_rows.push(3);
                r.ends.cut_obs.push(&[0.0]).expect("vectors");
                r.ends.cut_z.push(0.0);
                r.ends.cut_left.push(0.0);
            })
            .contains("row 3")
        );
        assert!(after(|r| r.truncated[4] = true).contains("row 4"));
        assert!(after(|r| r.ends.cut_obs.clear()).contains("cut_obs"));
        assert!(after(|r| r.ends.next_z.clear()).contains("next_z"));
    }
}
