//! Play of a few episodes to their end, whatever the game does in them.

use bevy_playbot::vision::VisionError;

use super::{
    played::{Interruption, Played, PlayedEnd, Task, Watch},
    test_world::TestWorld,
    tester::Tester,
};
use crate::game::Game;

/// Plays episodes and returns their results in order; `None` if `stop` returned true.
///
/// Many are played in one World. If it breaks, its current episodes are played again, each alone in a World of its
/// own. An episode that breaks its World again is the broken one; all others are played as if nothing had happened.
///
/// If no episode does, the break depends on state that other episodes left in the World. It is then a finding of the
/// episode in which it occurred.
///
/// # Errors
///
/// The game does not support the tester's observations.
pub(super) fn play_tasks(
    game: &dyn Game,
    mode: &str,
    tester: &Tester,
    tasks: &[Task],
    watch: &Watch,
) -> Result<Option<Vec<Played>>, VisionError> {
    let mut played: Vec<Option<Played>> = vec![None; tasks.len()];
    let mut waiting: Vec<usize> = (0..tasks.len()).collect();
    while !waiting.is_empty() {
        let mut test_world = TestWorld::build(game, mode, tester, tasks, &waiting, watch.arenas)?;
        match test_world.play_out(game, &mut played, watch) {
            Ok(()) => {}
            Err(Interruption::Stopped) => return Ok(None),
            Err(Interruption::Broken { detector, message }) => {
                let mut is_seen = false;
                for suspect in test_world.suspects() {
                    let Some(alone) = play_alone(game, mode, tester, tasks[suspect], watch)? else { return Ok(None) };
                    is_seen |= alone.shows(detector);
                    played[suspect] = Some(alone);
                }
                if let Some((suspect, finding)) = test_world.left_behind(detector, &message).filter(|_| !is_seen)
                    && let Some(played) = &mut played[suspect]
                {
                    played.found.push(finding);
                }
            }
        }
        waiting.retain(|&task| played[task].is_none());
    }
    Ok(Some(played.into_iter().flatten().collect()))
}

/// Plays one episode in a World of its own.
fn play_alone(
    game: &dyn Game,
    mode: &str,
    tester: &Tester,
    task: Task,
    watch: &Watch,
) -> Result<Option<Played>, VisionError> {
    let mut test_world = TestWorld::build(game, mode, tester, &[task], &[0], 1)?;
    let mut played = [None];
    let end = match test_world.play_out(game, &mut played, watch) {
        Ok(()) => return Ok(played[0].take()),
        Err(Interruption::Stopped) => return Ok(None),
        Err(Interruption::Broken { detector, message }) => {
            (watch.progress)(1);
            let (tick, message) = test_world.without_moment(&message);
            PlayedEnd::Broken { detector, tick, message }
        }
    };
    let found = std::mem::take(&mut test_world.found);
    let walk = test_world.take_walk(0);
    Ok(Some(Played { end, exact: test_world.is_untouched(0, task.seed), found, walk }))
}
