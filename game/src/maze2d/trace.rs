//! Tracing Maze2D: the ball under given pushes.

use crate::maze2d::{
    Ball, Maze2dLevel,
    arena::level_of,
    ball::{Vec2d, clip_action},
    sim::BallSim,
};
use playbot_harness::{
    game::Game,
    inspect::{InspectError, Print, TraceRequest, plain, read_text},
    level_files::read::shown_path,
};
use std::{path::Path, sync::Arc};

/// Plays the pushes of a file and prints the ball after each. Reports the number of clipped pushes.
pub(super) fn run(game: &dyn Game, request: &TraceRequest, print: Print) -> Result<Option<String>, InspectError> {
    let Some(path) = request.file else {
        return Err(InspectError::Usage(
            "the pushes of maze2d are numbers: write them to a file, one `ux uy` a line, and \
            name it with --actions-file"
                .to_owned(),
        ));
    };
    let mode = request.mode.unwrap_or("medium");
    game.check_mode(mode)?;
    let (level, rules) = level_of(game, mode, request.level).map_err(InspectError::Usage)?;
    let mut level = Arc::unwrap_or_clone(level);
    if !request.start.is_empty() {
        level.start = start(request.start, &level)?;
    }
    let (pushes, clipped) = pushes(&read_text(path)?, path)?;
    let mut sim = BallSim::new(&rules, &level);
    if !request.json {
        print(format!("{:>5} {:>22} {:>22} {:>22} {:>22}", "step", "x", "y", "vx", "vy"))?;
    }
    for (step, push) in pushes.into_iter().enumerate() {
        sim.step(push);
        let Ball { position: [x, y], velocity: [vx, vy] } = sim.ball;
        let state = [x, y, vx, vy].map(plain);
        if request.json {
            print(format!("[{}]", state.join(",")))?;
        } else {
            let [x, y, vx, vy] = state;
            print(format!("{:>5} {x:>22} {y:>22} {vx:>22} {vy:>22}", step + 1))?;
        }
    }
    let note = format!("{}: {clipped} pushes lay outside -1 to 1 and were clipped", shown_path(path));
    Ok((clipped > 0).then_some(note))
}

/// Returns the ball of `--start`.
fn start(values: &[f64], level: &Maze2dLevel) -> Result<Ball, InspectError> {
    let &[x, y, vx, vy] = values else {
        return Err(InspectError::Usage(format!("--start has {} numbers: write four, x,y,vx,vy", values.len())));
    };
    if let Some(bad) = values.iter().find(|value| !value.is_finite()) {
        return Err(InspectError::Usage(format!("--start has {bad}: write finite numbers")));
    }
    if !level.walls.is_free([x, y]) {
        return Err(InspectError::Usage(format!(
            "--start {x},{y} lies in a wall: x is the row and y the column of the map"
        )));
    }
    Ok(Ball { position: [x, y], velocity: [vx, vy] })
}

/// Returns the pushes in a file, clipped, and the number of clipped ones.
fn pushes(text: &str, path: &Path) -> Result<(Vec<Vec2d>, usize), InspectError> {
    let mut clipped = 0;
    let mut pushes = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let push = push(line).ok_or_else(|| {
            let (path, line_number) = (shown_path(path), index + 1);
            InspectError::Usage(format!(
                "{path}, line {line_number}: `{line}` is no push; write two finite numbers, `ux uy`, each from -1 to 1"
            ))
        })?;
        let (push, was_clipped) = clip_action(push);
        clipped += usize::from(was_clipped);
        pushes.push(push);
    }
    if pushes.is_empty() {
        return Err(InspectError::Usage(format!("{} has no pushes: write one `ux uy` a line", shown_path(path))));
    }
    Ok((pushes, clipped))
}

fn push(line: &str) -> Option<[f32; 2]> {
    let mut words = line.split([' ', '\t', ',']).filter(|word| !word.is_empty());
    let mut next = || words.next()?.parse::<f32>().ok().filter(|value| value.is_finite());
    let push = [next()?, next()?];
    words.next().is_none().then_some(push)
}
