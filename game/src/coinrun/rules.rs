//! The rules of play: pure functions over plain data.
//!
//! One step is, in this order: [`begin_step`], [`patrol`] for every enemy, [`move_player`],
//! [`touch`]. All arithmetic is f32 and in a fixed order, because standing and landing depend on
//! exact equality.
//!
//! In the folder:
//!
//! - [`motion`]: movement in small steps, contacts, and the end of an episode.

pub mod motion;

use crate::coinrun::{rules::motion::advance, tile::TileGrid};

pub use crate::coinrun::rules::motion::{CoinRunEnd, hash_state, patrol, touch};
pub(super) use crate::coinrun::rules::motion::{corners, flush, part_count};

/// Most times that a crate may pass the player on to another crate within one displacement.
pub(super) const MAX_PUSHES: u32 = 5;

/// The memory of a player from step to step besides its [`Body`].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PlayerState {
    /// The top of a crate held the player in the last step.
    pub on_crate: bool,
    /// An enemy on a crate made the player count as standing on one; see [`patrol`].
    pub lent_support: bool,
    /// The player had support at the start of the last step.
    pub supported: bool,
    /// The player looks to the left: the last horizontal action pointed there.
    pub faces_left: bool,
}

/// The player's part of the state that the rest of a step depends on.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlayerStep {
    /// Horizontal action: -1 left, 1 right.
    pub ax: i8,
    /// Vertical action: -1 down, 1 jump. A jump without support has become 0.
    pub ay: i8,
    /// Velocity before the movement, tiles per step, upwards.
    pub vy: f32,
    /// Height of the player's centre before the movement, tiles.
    pub y: f32,
    /// Half height of the player, tiles.
    pub ry: f32,
}

impl PlayerStep {
    /// Returns true if the top of `block` holds a player with the present vertical velocity `vy`. It holds only one
    /// that falls, does not press down and was not below the top when the step began.
    #[inline]
    fn is_held_by(&self, block: &Body, vy: f32) -> bool {
        vy < 0.0 && self.ay >= 0 && self.y >= block.y + block.ry + self.ry
    }
}

/// Returns the directions (horizontal, vertical) of an action, each -1, 0 or 1.
///
/// Actions 0 to 8 are `3 * (horizontal + 1) + (vertical + 1)`; the others do nothing in CoinRun.
#[inline]
pub(super) fn directions(action: u8) -> (i8, i8) {
    debug_assert!(action < ACTIONS);
    match action {
        0..9 => (action as i8 / 3 - 1, action as i8 % 3 - 1),
        _ => (0, 0),
    }
}

/// Starts a step: decodes `action` (0 to 14), looks for support and updates the velocity.
#[inline]
pub fn begin_step(player: &mut Body, state: &mut PlayerState, tiles: &TileGrid, action: u8) -> PlayerStep {
    let (ax, mut ay) = directions(action);
    if ax != 0 {
        state.faces_left = ax < 0;
    }
    state.supported = is_supported(player, state, tiles);
    (state.on_crate, state.lent_support) = (false, false);
    if !state.supported {
        ay = ay.min(0);
    }
    player.vx = walk(player.vx, ax, state.supported);
    player.vy = fall(player.vy, ay, state.supported);
    PlayerStep { ax, ay, vy: player.vy, y: player.y, ry: player.ry }
}

/// Returns true if a jump would work now. The vertical speed must be exactly 0, which rules out all but a completed
/// landing.
#[inline]
pub fn is_supported(player: &Body, state: &PlayerState, tiles: &TileGrid) -> bool {
    player.vy == 0.0 && (state.on_crate || state.lent_support || stands_on_wall(player, tiles))
}

#[inline]
fn stands_on_wall(player: &Body, tiles: &TileGrid) -> bool {
    let below = player.y - (player.ry + FOOT_MARGIN);
    let foot = player.rx - FOOT_MARGIN;
    tiles.at(player.x - foot, below).is_wall() || tiles.at(player.x + foot, below).is_wall()
}

/// Moves the horizontal velocity towards the wanted one. Less than the gain of one step of full acceleration counts as
/// standing still; exactly that much does not.
#[inline]
pub(super) fn walk(vx: f32, ax: i8, supported: bool) -> f32 {
    let control = if supported { GROUND_CONTROL } else { GROUND_CONTROL * AIR_CONTROL };
    let vx = (1.0 - control) * vx + control * WALK_SPEED * f32::from(ax);
    if vx.abs() < control * WALK_SPEED { 0.0 } else { vx }
}

/// Returns the vertical velocity: that of a jump, or with gravity added, and with "down" on the ground.
#[inline]
pub(super) fn fall(vy: f32, ay: i8, supported: bool) -> f32 {
    if ay > 0 {
        return JUMP_SPEED;
    }
    let pressed = if supported { vy + GRAVITY * f32::from(ay) } else { vy };
    (pressed - GRAVITY).clamp(-JUMP_SPEED, JUMP_SPEED)
}

/// Moves the player against tiles and crates. `crates` may be any subset, in creation order, that
/// contains those within a tile of the player. `x_wins_tie` decides the order of the axes when no
/// direction is pressed and both speeds are equal.
#[inline]
pub fn move_player(
    player: &mut Body,
    state: &mut PlayerState,
    tiles: &TileGrid,
    crates: &[Body],
    step: &PlayerStep,
    x_wins_tie: bool,
) {
    let x_first = match (step.ax, step.ay) {
        (0, 0) => {
            let (x, y) = (player.vx.abs(), player.vy.abs());
            x > y || (x == y && x_wins_tie)
        }
        (_, ay) => ay == 0,
    };
    let on_crate = &mut state.on_crate;
    advance(player, x_first, |body, dx, dy| displace(body, tiles, crates, step, dx, dy, on_crate, 0));
}

/// Moves the player along one axis and returns whether it was blocked. A displacement of 0 counts as
/// vertical.
#[inline]
fn displace(
    player: &mut Body,
    tiles: &TileGrid,
    crates: &[Body],
    step: &PlayerStep,
    dx: f32,
    dy: f32,
    on_crate: &mut bool,
    pushes: u32,
) -> bool {
    let (x, y) = (player.x + dx, player.y + dy);
    let at_wall = tiles.blocks_player(&corners(player, x, y));
    if dx != 0.0 {
        player.x = if at_wall { flush(x, player.rx, dx > 0.0) } else { x };
        player.y = y;
        return at_wall;
    }
    player.x = x;
    player.y = if at_wall { flush(y, player.ry, dy > 0.0) } else { y };
    // A player who rises or presses down passes through every crate.
    if crates.is_empty() || player.vy >= 0.0 || step.ay < 0 {
        return at_wall;
    }
    land_on_crates(player, tiles, crates, step, on_crate, pushes) || at_wall
}

/// Sets a falling player on top of the crates that it has just entered from above.
fn land_on_crates(
    player: &mut Body,
    tiles: &TileGrid,
    crates: &[Body],
    step: &PlayerStep,
    on_crate: &mut bool,
    pushes: u32,
) -> bool {
    let mut landed = false;
    for block in crates.iter().rev() {
        if !player.overlaps(block, OVERLAP_MARGIN) || !step.is_held_by(block, player.vy) {
            continue;
        }
        landed = true;
        *on_crate = true;
        if pushes < MAX_PUSHES {
            let rise = rise_to_top(player, block);
            displace(player, tiles, crates, step, 0.0, rise, on_crate, pushes + 1);
        }
        player.vy = 0.0;
    }
    landed
}

/// Returns the displacement that puts the player flush on the side of `block` on which its centre is. The sum is exact
/// before it is rounded to f32.
pub(super) fn rise_to_top(player: &Body, block: &Body) -> f32 {
    let reach = f64::from(block.ry + player.ry);
    let side = match player.y - block.y {
        above if above > 0.0 => reach,
        below if below < 0.0 => -reach,
        _ => 0.0,
    };
    (f64::from(block.y) + side - f64::from(player.y)) as f32
}

/// An axis-aligned rectangle with a velocity.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Body {
    /// Centre, tiles from the left.
    pub x: f32,
    /// Centre, tiles from the bottom.
    pub y: f32,
    /// Horizontal velocity, tiles per step.
    pub vx: f32,
    /// Vertical velocity, tiles per step.
    pub vy: f32,
    /// Half width, tiles.
    pub rx: f32,
    /// Half height, tiles.
    pub ry: f32,
}

impl Body {
    /// Returns the player at the start of every level.
    pub fn player() -> Self {
        Self {
            x: START_CELL[0] as f32 + PLAYER_HALF_WIDTH,
            y: START_CELL[1] as f32 + PLAYER_HALF_HEIGHT,
            vx: 0.0,
            vy: 0.0,
            rx: PLAYER_HALF_WIDTH,
            ry: PLAYER_HALF_HEIGHT,
        }
    }

    /// Returns a saw or a crate: a resting square that fills `cell`.
    pub fn block(cell: [i32; 2]) -> Self {
        Self { x: cell[0] as f32 + 0.5, y: cell[1] as f32 + 0.5, vx: 0.0, vy: 0.0, rx: BLOCK_HALF, ry: BLOCK_HALF }
    }

    /// Returns an enemy that starts in `cell` and walks to the right (`dir` 1) or to the left (-1).
    pub fn enemy(cell: [i32; 2], dir: i8) -> Self {
        Self { vx: ENEMY_SPEED * f32::from(dir), ..Self::block(cell) }
    }

    /// Returns true if the two rectangles overlap when the sum of their half sizes is changed by `margin`.
    #[inline]
    pub fn overlaps(&self, other: &Body, margin: f32) -> bool {
        let reach_x = (self.rx + other.rx) + margin;
        let reach_y = (self.ry + other.ry) + margin;
        (self.x - other.x).abs() < reach_x && (self.y - other.y).abs() < reach_y
    }
}

// The numbers of the game, with lengths in tiles and speeds in tiles per step.

/// Number of actions of the environment.
pub const ACTIONS: u8 = 15;

/// An episode ends after this many steps.
pub const TIMEOUT: u32 = 1000;

/// Reward of the coin. There is no other reward.
pub const COIN_REWARD: f32 = 10.0;

/// The cell in which the player starts.
pub const START_CELL: [i32; 2] = [1, 1];

/// Half width of the player.
pub const PLAYER_HALF_WIDTH: f32 = 0.5;

/// Half height of the player.
pub const PLAYER_HALF_HEIGHT: f32 = 0.5787;

/// Half width and half height of saws, enemies and crates.
pub const BLOCK_HALF: f32 = 0.5;

/// Loss of vertical speed per step.
pub const GRAVITY: f32 = 0.2;

/// Vertical speed right after a jump, and the highest vertical speed.
pub const JUMP_SPEED: f32 = 1.5;

/// Horizontal speed that walking approaches.
pub const WALK_SPEED: f32 = 0.5;

/// Share of the speed difference that a supported player makes up in one step.
pub const GROUND_CONTROL: f32 = 0.2;

/// Factor on [`GROUND_CONTROL`] in the air.
pub const AIR_CONTROL: f32 = 0.15;

/// Start speed of enemies.
pub const ENEMY_SPEED: f32 = 0.15;

/// Bodies overlap only if they do so by more than this, and a body touches a tile only if it
/// reaches this far into it.
pub(super) const OVERLAP_MARGIN: f32 = -0.001;

/// The corners that are tested against tiles lie at this part of the half size.
pub(super) const CORNER: f32 = 0.98;

/// Margin inside its sides and below its feet for the player's support.
pub(super) const FOOT_MARGIN: f32 = 0.01;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::level::Level;

    const FLOOR: &str = "#.....C\n#A.....\n#======\n";

    fn run(level: &Level, actions: &[u8]) -> Vec<Body> {
        let (mut player, mut state) = (Body::player(), PlayerState::default());
        let mut path = Vec::new();
        for &action in actions {
            let step = begin_step(&mut player, &mut state, &level.tiles, action);
            let crates = level.crates_near(player.x);
            move_player(&mut player, &mut state, &level.tiles, crates, &step, false);
            path.push(player);
        }
        path
    }

    fn level(text: &str) -> Level {
        Level::from_text(text).expect("a valid picture")
    }

    #[test]
    fn actions_decode() {
        assert_eq!(directions(0), (-1, -1));
        assert_eq!(directions(5), (0, 1));
        assert_eq!(directions(7), (1, 0));
        for action in 9..15 {
            assert_eq!(directions(action), directions(4));
        }
    }

    #[test]
    fn the_first_push_survives_the_dead_zone() {
        assert_eq!(walk(0.0, 1, true), GROUND_CONTROL * WALK_SPEED);
        let air = GROUND_CONTROL * AIR_CONTROL * WALK_SPEED;
        assert_eq!(walk(0.0, -1, false), -air);
        assert_eq!(walk(0.12, 0, true), 0.0);
    }

    #[test]
    fn a_jump_rises_six_tiles_and_lands_after_sixteen_steps() {
        let mut actions = vec![5];
        actions.extend([4; 16]);
        let path = run(&level(FLOOR), &actions);
        let apex = path.iter().map(|body| body.y).fold(0.0, f32::max);
        assert!((apex - 1.5787 - 6.4).abs() < 1e-4, "apex {apex}");
        assert_eq!(path[15].y, Body::player().y);
    }

    #[test]
    fn landing_on_ground_costs_a_step_before_the_next_jump() {
        // Held jump: the fall ends exactly on the surface in step 16 with its full speed, the next
        // step comes to rest, and only the one after jumps.
        let path = run(&level(FLOOR), &[5; 18]);
        assert_eq!(path[15].vy, -1.5);
        assert_eq!(path[16].vy, 0.0);
        assert_eq!(path[17].vy, JUMP_SPEED);
    }

    #[test]
    fn a_crate_stops_a_fall_at_once_and_carries() {
        // The crate in column 2 is a part of the floor: walking over it needs no jump.
        let level = level("#....C\n#A....\n#.x===\n");
        let path = run(&level, &[7; 6]);
        assert!(path.iter().all(|body| body.y == Body::player().y));
        let on_crate: Vec<&Body> = path.iter().filter(|body| (1.6..2.4).contains(&body.x)).collect();
        assert!(on_crate.len() >= 2 && on_crate.iter().all(|body| body.vy == 0.0));
    }

    #[test]
    fn down_drops_through_a_crate() {
        let level = level("#....C\n#x....\n#A....\n#=====\n");
        // Jump through the crate above from below, then land on its top.
        let mut actions = vec![5; 12];
        actions.extend([4; 4]);
        let path = run(&level, &actions);
        let rest = path[path.len() - 1];
        assert_eq!((rest.vy, rest.y), (0.0, Body::player().y + 2.0));
        actions.extend([3; 6]);
        let path = run(&level, &actions);
        assert_eq!(path[path.len() - 1].y, Body::player().y);
    }
}
