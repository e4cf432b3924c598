//! The pictures of Maze2D: flat colours that can be told apart at a few pixels, also in grey.

/// Side of every drawing, texels.
pub const SIDE: usize = 16;

/// Red, green, blue, alpha.
type Texel = [u8; 4];

const NOTHING: Texel = [0; 4];
const WALL: Texel = [0x2b, 0x30, 0x3b, 255];
const WALL_EDGE: Texel = [0x3a, 0x41, 0x50, 255];
const FLOOR: Texel = [0xec, 0xef, 0xf4, 255];
const BALL: Texel = [0xd7, 0x26, 0x3d, 255];
const BALL_EDGE: Texel = [0x8f, 0x12, 0x22, 255];
const GOAL: Texel = [0xf5, 0xb7, 0x00, 255];
const GOAL_HEART: Texel = [0xc9, 0x8a, 0x00, 255];

/// Every picture with its file name in `assets/maze2d`: a strip of two tiles, and two figures. Each is [`SIDE`] wide, top
/// row first.
pub fn pictures() -> [(&'static str, Vec<Texel>); 3] {
    let tiles = draw(wall).into_iter().chain(draw(|_, _| FLOOR)).collect();
    [("tiles.png", tiles), ("ball.png", draw(ball)), ("goal.png", draw(goal))]
}

fn draw(texel: impl Fn(usize, usize) -> Texel) -> Vec<Texel> {
    (0..SIDE * SIDE).map(|index| texel(index % SIDE, index / SIDE)).collect()
}

fn wall(x: usize, y: usize) -> Texel {
    if x == 0 || y == 0 { WALL_EDGE } else { WALL }
}

fn ball(x: usize, y: usize) -> Texel {
    match from_middle(x, y) {
        ..36 => BALL,
        36..=64 => BALL_EDGE,
        _ => NOTHING,
    }
}

/// A disc with a darker one in it.
fn goal(x: usize, y: usize) -> Texel {
    match from_middle(x, y) {
        ..9 => GOAL_HEART,
        9..=64 => GOAL,
        _ => NOTHING,
    }
}

/// Square of the distance from the middle of the drawing, texels.
fn from_middle(x: usize, y: usize) -> usize {
    let along = |at: usize| (2 * at + 1).abs_diff(SIDE);
    (along(x).pow(2) + along(y).pow(2)) / 4
}
