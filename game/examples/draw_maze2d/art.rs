//! The pictures of Maze2D: flat colours that can be told apart at a few pixels, also in grey.

/// Side of every drawing, texels.
pub const SIDE: usize = 16;

/// Red, green, blue, alpha.
type Texel = [u8; 4];

const NOTHING: Texel = [0; 4];
const WALL: Texel = [0x2b, 0x30, 0x3b, 255];
const FLOOR: Texel = [0xec, 0xef, 0xf4, 255];
const BALL: Texel = [0xd7, 0x26, 0x3d, 255];
const GOAL: Texel = [0xf5, 0xb7, 0x00, 255];

/// Returns every picture with its file name in `assets/maze2d`: a strip of two tiles, and two discs. Each is [`SIDE`]
/// wide, top row first.
pub fn pictures() -> [(&'static str, Vec<Texel>); 3] {
    let flat = |colour| std::iter::repeat_n(colour, SIDE * SIDE);
    let tiles = flat(WALL).chain(flat(FLOOR)).collect();
    [("tiles.png", tiles), ("ball.png", disc(BALL)), ("goal.png", disc(GOAL))]
}

fn disc(colour: Texel) -> Vec<Texel> {
    // Distances from the middle, in halves of a texel.
    let along = |at: usize| (2 * at + 1).abs_diff(SIDE);
    let is_inside = |x: usize, y: usize| along(x).pow(2) + along(y).pow(2) <= SIDE * SIDE;
    (0..SIDE * SIDE).map(|index| if is_inside(index % SIDE, index / SIDE) { colour } else { NOTHING }).collect()
}
