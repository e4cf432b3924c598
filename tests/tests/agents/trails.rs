//! Tests of trails of agents, in the evaluation and in the picture.

use bevy::math::{Rect, Vec2};
use playbot_games::{
    GAMES,
    maze::{Cell, Planner},
};
use playbot_harness::{
    drawing::Shape,
    eval::{EvalPlan, Player, Trail, evaluate, evaluate_with_trails},
    floor_plan::FloorPlan,
    game::Game,
    games::Games,
    trails::{Floor, PlayerTrails, TrailChart, Visits},
};
use playbot_tests::measuring::plan;

fn game(name: &str) -> &'static dyn Game {
    Games::new(&GAMES).expect("each has a name of its own").get(name).expect("a game")
}

fn right_jump() -> Player {
    let bots = game("coinrun").tools().bots.blind_bots();
    Player::Blind(bots.into_iter().find(|(name, _)| *name == "right-jump").expect("CoinRun's bot").1)
}

fn trails(name: &str, player: &Player, levels: &str) -> Vec<Trail> {
    evaluate_with_trails(game(name), player, &plan(levels), |_| {}).expect("sound")
}

#[test]
fn a_trail_has_the_place_after_every_tick_of_its_own_episode() {
    let trails = trails("coinrun", &right_jump(), "hard:0..5");
    let levels: Vec<u64> = trails.iter().map(|trail| trail.result.level).collect();
    assert_eq!(levels, [0, 1, 2, 3, 4, 5]);
    let mut reached = 0;
    for trail in &trails {
        let plan = game("coinrun").tools().levels.floor_plan("hard", trail.result.level).expect("a plan");
        assert_eq!(trail.positions.len() as u32, trail.result.ticks);
        // A jump begins with 1.5 tiles a tick; the position in another episode would be farther away.
        assert!(trail.positions[0].distance(plan.start) < 1.7, "level {}", trail.result.level);
        assert!(trail.positions.windows(2).all(|pair| pair[0].distance(pair[1]) < 1.7), "level {}", trail.result.level);
        let end = trail.positions[trail.positions.len() - 1];
        assert_eq!(end.distance(plan.goal) < 1.7, trail.result.end.is_success(), "level {}", trail.result.level);
        reached += usize::from(trail.result.end.is_success());
    }
    assert!((1..6).contains(&reached), "both endings occur, but {reached} of 6 reached the coin");
}

#[test]
fn following_changes_no_result_and_threads_change_nothing() {
    let player = right_jump();
    let followed = trails("coinrun", &player, "hard:0..7");
    let alone = EvalPlan { threads: 1, ..plan("hard:0..7") };
    let plain = evaluate(game("coinrun"), &player, &alone, |_| {}).expect("sound");
    assert_eq!(followed.iter().map(|trail| trail.result).collect::<Vec<_>>(), plain);
    let alone = evaluate_with_trails(game("coinrun"), &player, &alone, |_| {}).expect("sound");
    assert_eq!(alone, followed);
}

/// Returns the cells of a ball, one after the other. D4RL's walls stand 0.2 aside.
fn cells(trail: &Trail) -> Vec<Cell> {
    let cell = |position: &Vec2| Cell::new((position.x + 0.2).round() as usize, (position.y + 0.2).round() as usize);
    let mut cells: Vec<Cell> = trail.positions.iter().map(cell).collect();
    cells.dedup();
    cells
}

#[test]
fn the_planners_ball_is_seen_in_every_cell_of_its_way_and_in_no_wall() {
    let maze = playbot_games::maze::fixed::maze2d::medium();
    let way = Planner::new(&maze, maze.goal()).path(maze.start()).expect("a way");
    for trail in trails("maze2d", &Player::Demonstrator, "medium+fixed-start+end-at-goal:0..3") {
        assert!(trail.result.end.is_success(), "level {}", trail.result.level);
        let seen = cells(&trail);
        assert!(seen.iter().all(|&cell| maze.is_free(cell)), "{seen:?}");
        let mut rest = seen.iter();
        assert!(way.iter().all(|cell| rest.any(|other| other == cell)), "{seen:?} is not along {way:?}");
    }
}

#[test]
fn the_ants_plan_has_its_start_at_the_origin_and_the_goal_of_the_original() {
    let plan = game("antmaze").tools().levels.floor_plan("large", 0).expect("a plan");
    assert_eq!((plan.start, plan.goal), (Vec2::ZERO, Vec2::new(32.0, 24.0)));
    assert_eq!((plan.bounds.min, plan.bounds.max), (Vec2::splat(-6.0), Vec2::new(42.0, 30.0)));
    let in_wall = |position: Vec2| plan.walls.iter().any(|wall| wall.contains(position));
    let maze = playbot_games::maze::fixed::antmaze::large();
    let centre = |cell: Cell| Vec2::new(4.0 * (cell.col as f32 - 1.0), 4.0 * (cell.row as f32 - 1.0));
    assert!(maze.wall_cells().all(|cell| in_wall(centre(cell))));
    assert!(maze.free_cells().all(|cell| !in_wall(centre(cell))));
}

#[test]
fn an_ants_trail_begins_at_its_start() {
    let idle = Player::Blind(bevy_playbot::bot::BlindBot::Uniform);
    let trail = &trails("antmaze", &idle, "medium+limit=20:0..0")[0];
    assert_eq!(trail.positions.len(), 20);
    assert!(trail.positions.iter().all(|position| position.length() < 3.0), "{:?}", trail.positions);
}

#[test]
fn the_plan_of_coinrun_has_what_kills_and_what_carries() {
    let plan = |level| game("coinrun").tools().levels.floor_plan("hard", level).expect("a plan");
    // Saws on the ground and in pits, and crates, of the original's levels.
    for (level, saws, crates) in [(0, 0, 4), (1, 1, 4), (6, 5, 9), (7, 10, 4), (8, 1, 11)] {
        let plan = plan(level);
        assert_eq!((plan.hazards.len(), plan.platforms.len()), (saws, crates), "level {level}");
        assert!(plan.hazards.iter().chain(&plan.platforms).all(|area| area.size() == Vec2::ONE), "level {level}");
    }
    // Three pits of lava: rows of tiles are joined, and lie between walls.
    let lava = plan(4).hazards;
    assert!(lava.len() >= 3 && lava.iter().all(|area| area.width() > 1.0 && area.height() == 1.0), "{lava:?}");
    assert!(lava.iter().all(|area| plan(4).walls.iter().all(|wall| wall.intersect(*area).is_empty())));
}

#[test]
fn every_tick_is_counted_in_the_square_where_it_was() {
    let trails = trails("coinrun", &right_jump(), "hard:0..0");
    let plan = game("coinrun").tools().levels.floor_plan("hard", 0).expect("a plan");
    let visits = Visits::count(plan.bounds, &trails);
    let inside = trails[0].positions.iter().filter(|&&position| plan.bounds.contains(position));
    assert!(inside.clone().count() > 40 && visits.total() == inside.clone().count() as u64);
    assert!(inside.clone().all(|&position| visits.at(position) > 0));
    let holds = |square: Rect| trails[0].positions.iter().any(|&position| square.inflate(1e-3).contains(position));
    assert!(visits.visited().all(|(square, _)| holds(square)));
    assert_eq!(visits.at(plan.bounds.max), 0, "the upper corner was not visited");
    assert_eq!(visits.at(plan.bounds.max + 1.0), 0, "nor outside");
}

fn players(names: &[&str], trails: &[Trail]) -> Vec<PlayerTrails> {
    names.iter().map(|name| PlayerTrails { name: (*name).to_owned(), trails: trails.to_vec() }).collect()
}

fn floor(plan: FloorPlan, players: Vec<PlayerTrails>) -> Floor {
    let (starts, goals) = (vec![plan.start], vec![plan.goal]);
    Floor { name: "hard:0".to_owned(), plan, starts, goals, players }
}

#[test]
fn the_picture_has_a_line_for_each_episode_and_everything_on_the_paper() {
    let trails = trails("coinrun", &right_jump(), "hard:0..0");
    let plan = game("coinrun").tools().levels.floor_plan("hard", 0).expect("a plan");
    for (names, copies) in [(&["right-jump"][..], 3_usize), (&["one", "two", "<three>"], 40)] {
        let copied: Vec<Trail> = (0..copies).flat_map(|_| trails.clone()).collect();
        let chart =
            TrailChart { title: "CoinRun".to_owned(), floors: vec![floor(plan.clone(), players(names, &copied))] };
        let drawing = chart.draw();
        let long = |shape: &&Shape| matches!(shape, Shape::Line { points, .. } if points.len() > 5);
        let lines = drawing.shapes.iter().filter(long).count();
        assert_eq!(lines, names.len() * copies.min(24));
        for shape in &drawing.shapes {
            let (min, max) = match shape {
                Shape::Block { area, .. } => (area.min, area.max),
                Shape::Line { points, .. } => {
                    points.iter().fold((points[0], points[0]), |(min, max), point| (min.min(*point), max.max(*point)))
                }
                Shape::Mark { centre, .. } => (*centre, *centre),
                Shape::Text { at, .. } => (*at, *at),
            };
            assert!(min.min_element() >= 0.0 && max.cmple(drawing.size).all(), "{shape:?} on {}", drawing.size);
        }
        let svg = drawing.to_svg();
        assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n") && !svg.contains("<three>"));
        assert_eq!(svg, chart.draw().to_svg());
    }
}
