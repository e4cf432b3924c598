//! A step beside straight walls and over level ground.

use crate::coinrun::{
    paths::{
        Walker,
        ground::{PathGround, Sweep, Swept},
    },
    rules::{PlayerState, PlayerStep, fall, is_supported, move_player, walk},
    tile::SIZE,
};

/// One axis of a step: the corners' start and direction.
#[derive(Clone, Copy, Debug)]
struct Axis {
    /// Position of the centre.
    at: f32,
    /// Displacement in each part of the step.
    by: f32,
    /// Half size of the player.
    half: f32,
    /// Distance of the corners from its centre.
    corner: f32,
    /// Cells of the low and the high corners.
    cells: [i32; 2],
    /// The last cell of the corners in front if nothing blocks them.
    last: i32,
    /// No corner reaches into another cell if nothing blocks it.
    stays: bool,
}

/// Returns the column or the row of a coordinate. `None` outside the level.
#[inline(always)]
fn cell_of(at: f32) -> Option<i32> {
    (0.0..SIZE as f32).contains(&at).then_some(at as i32)
}

impl Axis {
    /// Prepares an axis; `None` outside the level.
    #[inline(always)]
    fn new(at: f32, by: f32, end: f32, half: f32, corner: f32) -> Option<Self> {
        let cells = [cell_of(at - corner)?, cell_of(at + corner)?];
        let ends = [cell_of(end - corner)?, cell_of(end + corner)?];
        let last = ends[usize::from(by >= 0.0)];
        Some(Self { at, by, half, corner, cells, last, stays: cells == ends })
    }

    /// Returns the cell of the corners in front.
    #[inline(always)]
    fn front(&self) -> i32 {
        self.cells[usize::from(self.by >= 0.0)]
    }

    /// Returns the cell after `cell` in the direction of the movement.
    #[inline(always)]
    fn next(&self, cell: i32) -> i32 {
        if self.by < 0.0 { cell - 1 } else { cell + 1 }
    }

    /// Returns the position to which the centre is set back at a cell that blocks.
    #[inline(always)]
    fn flush(&self, cell: i32) -> f32 {
        if self.by < 0.0 { (cell + 1) as f32 + self.half } else { cell as f32 - self.half }
    }

    /// Returns the cell of the corners behind if the centre is set back to `flush`. `None` outside the level.
    #[inline(always)]
    fn behind(&self, flush: f32) -> Option<i32> {
        cell_of(if self.by < 0.0 { flush + self.corner } else { flush - self.corner })
    }

    /// Goes on by one part, towards a cell that blocks. Returns whether it did, and whether the rules would set the
    /// centre back to its edge then.
    #[inline(always)]
    fn blocked(&self, at: f32, cell: i32) -> (bool, bool) {
        let (near, far) = (cell as f32, (cell + 1) as f32);
        if self.by < 0.0 {
            let side = at - self.half;
            (at - self.corner < far, near < side && side <= far)
        } else {
            let side = at + self.half;
            (at + self.corner >= near, near <= side && side < far)
        }
    }
}

/// Computes the step of a player in free space that meets at most one straight edge along each axis. Returns `None` if
/// it may be any other step.
///
/// Let the wall beside be solid over all passed rows, and the ground over all passed columns. Then each axis is blocked
/// or not regardless of the other one. No crate may be near.
#[inline]
pub(super) fn slide(walker: &Walker, ground: &PathGround, sweep: &Sweep) -> Option<Walker> {
    let Sweep { parts, by: [dx, dy], end: [end_x, end_y] } = *sweep;
    let x = Axis::new(walker.x, dx, end_x, ground.rx, ground.corner_x)?;
    let y = Axis::new(walker.y, dy, end_y, ground.ry, ground.corner_y)?;
    let mut swept = Swept::between([walker.x, walker.y], [end_x, end_y]);
    let (x_edge, y_edge) = edges(&x, &y, ground, &mut swept)?;
    if walker.vy < 0.0 && ground.crates.may_hold(walker.y, &swept) {
        return None;
    }
    let (mut at_x, mut at_y) = (x.at, y.at);
    let (mut free_x, mut free_y) = (0_u32, 0_u32);
    for _ in 0..parts {
        let (blocked_x, blocked_y);
        (at_x, blocked_x) = part(&x, at_x, x_edge)?;
        (at_y, blocked_y) = part(&y, at_y, y_edge)?;
        free_x += u32::from(!blocked_x);
        free_y += u32::from(!blocked_y);
        if blocked_x && blocked_y {
            break;
        }
    }
    let (vx, vy) = (walker.vx * (free_x as f32 / parts as f32), walker.vy * (free_y as f32 / parts as f32));
    Some(Walker { x: at_x, y: at_y, vx, vy, ..*walker })
}

/// Computes one part of a step along one axis: its end, and whether it was blocked.
#[inline(always)]
fn part(axis: &Axis, at: f32, edge: Option<i32>) -> Option<(f32, bool)> {
    let at = at + axis.by;
    let Some(cell) = edge else { return Some((at, false)) };
    let (is_blocked, is_flush) = axis.blocked(at, cell);
    if !is_blocked {
        return Some((at, false));
    }
    is_flush.then_some((axis.flush(cell), true))
}

/// Returns the column and the row that block. `None` if these are not straight edges.
#[inline(always)]
fn edges(x: &Axis, y: &Axis, ground: &PathGround, swept: &mut Swept) -> Option<(Option<i32>, Option<i32>)> {
    let rows = ground.tiles.wall_rows();
    let row = |at: i32| rows[at as usize & 63];
    let [low, high] = y.cells;
    let [mut left, mut right] = x.cells;
    let (mut any, mut all) = (0, u64::MAX);
    for at in low..=high {
        any |= row(at);
        all &= row(at);
    }
    let (mut x_edge, mut beside) = (None, 0);
    if x.last != x.front() {
        if x.last != x.next(x.front()) {
            return None;
        }
        beside = 1 << x.last;
        if (row(low) | row(high)) & beside != 0 {
            x_edge = Some(x.last);
            let flush = x.flush(x.last);
            swept.x = [swept.x[0].min(flush), swept.x[1].max(flush)];
            let behind = x.behind(flush)?;
            (left, right) = (left.min(behind), right.max(behind));
        }
    }
    // Columns that must be free, and columns that must be wall, in each passed row. Corners whose rows stay the same
    // are blocked by one of them.
    let mut free = (u64::MAX << left) & (u64::MAX >> (63 - right));
    let mut wall = 0;
    match x_edge {
        Some(_) if y.stays => {}
        Some(_) => wall = beside,
        None => free |= beside,
    }
    let passes = |at: i32| row(at) & free == 0 && row(at) & wall == wall;
    if any & free != 0 || all & wall != wall {
        return None;
    }
    let mut at = y.front();
    while at != y.last {
        at = y.next(at);
        if passes(at) {
            continue;
        }
        // Corners whose columns stay the same are blocked by one of them.
        let is_met = x.stays && row(at) & (1 << left | 1 << right) != 0;
        if !is_met && row(at) & free != free {
            return None;
        }
        let flush = y.flush(at);
        swept.y = [swept.y[0].min(flush), swept.y[1].max(flush)];
        let behind = y.behind(flush)?;
        return ((low..=high).contains(&behind) || passes(behind)).then_some((x_edge, Some(at)));
    }
    Some((x_edge, None))
}

impl Walker {
    /// Returns the player after one step with a direction held (-1, 0 or 1), and perhaps the jump button. It follows
    /// the rules of the player, with short cuts where little is in the way.
    #[inline(always)]
    pub fn step(self, ground: &PathGround, ax: i8, jumps: bool) -> Self {
        let ay = i8::from(jumps && self.supported);
        let (vx, vy) = (walk(self.vx, ax, self.supported), fall(self.vy, ay, self.supported));
        let begun = Self { vx, vy, ..self };
        let sweep = Sweep::new(&begun);
        let mut quick = None;
        if !self.supported || ay > 0 {
            quick = begun.fly(ground, &sweep);
        }
        if quick.is_none() {
            quick = slide(&begun, ground, &sweep);
        }
        if let Some(next) = quick {
            let supported = next.vy == 0.0 && is_supported(&next.body(ground), &PlayerState::default(), ground.tiles);
            return Self { supported, ..next };
        }
        begun.obey(ground, ax, ay)
    }

    /// Computes a step that nothing blocks; `None` if something may be in the way.
    ///
    /// Unblocked parts of a step only add to x and y, in any order of the axes, and leave the velocity as it is.
    #[inline(always)]
    fn fly(self, ground: &PathGround, sweep: &Sweep) -> Option<Self> {
        let [x, y] = sweep.end;
        let swept = Swept::between([self.x, self.y], [x, y]);
        let is_free = ground.tiles.is_clear(&ground.corners(&swept));
        (is_free && (self.vy >= 0.0 || !ground.crates.may_hold(self.y, &swept))).then_some(Self { x, y, ..self })
    }

    /// Computes the step by the rules.
    fn obey(self, ground: &PathGround, ax: i8, ay: i8) -> Self {
        let (mut body, mut memory) = (self.body(ground), PlayerState::default());
        let step = PlayerStep { ax, ay, vy: self.vy, y: self.y, ry: ground.ry };
        move_player(&mut body, &mut memory, ground.tiles, ground.crates.below(self.y), &step, true);
        let supported = is_supported(&body, &memory, ground.tiles);
        Self { x: body.x, y: body.y, vx: body.vx, vy: body.vy, supported }
    }
}
