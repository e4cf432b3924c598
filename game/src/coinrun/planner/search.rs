//! Weighted A* over the exact rules.

use crate::coinrun::{planner::PlannerConfig, rules::WALK_SPEED, sim::Sim};
use bevy::platform::collections::HashSet;
use std::{cmp::Ordering, collections::BinaryHeap};

/// Resolution of actions and states in a search.
pub(super) struct SearchResolution {
    /// Actions on the ground: 8, 5 and 2 jump.
    ground_actions: &'static [u8],
    /// Actions in the air, where a jump has no effect.
    air_actions: &'static [u8],
    /// Actions are held for this many steps on the ground.
    ground_hold: u32,
    /// Actions are held for this many steps in the air, or until a landing.
    air_hold: u32,
    /// Positions closer than a tile divided by this are taken for the same.
    cells_per_tile: f32,
}

/// Quick, and nearly always enough.
pub(super) const COARSE: SearchResolution = SearchResolution {
    ground_actions: &[8, 7, 5, 4, 2, 1],
    air_actions: &[7, 4, 1],
    ground_hold: 2,
    air_hold: 4,
    cells_per_tile: 4.0,
};

/// For tight spots. Also presses down, which drops through crates.
pub(super) const FINE: SearchResolution = SearchResolution {
    ground_actions: &[8, 7, 5, 4, 2, 1, 6, 3, 0],
    air_actions: &[7, 4, 1, 6, 3, 0],
    ground_hold: 1,
    air_hold: 1,
    cells_per_tile: 16.0,
};

/// An enemy this near (tiles) makes the time a part of the state's key.
const ENEMY_RANGE: f32 = 8.0;

/// The result of a search.
pub(super) enum Found {
    /// Actions up to the coin.
    Coin(Vec<u8>),
    /// Actions to the most promising state that was seen.
    Progress(Vec<u8>),
    /// The same, with a proof that nothing leads to the coin.
    Hopeless(Vec<u8>),
}

/// The edge to a node: the held action, its duration, and the node before.
struct Step {
    parent: usize,
    action: u8,
    ticks: u32,
}

struct Node {
    sim: Sim,
    step: Step,
    cost: f32,
}

/// An entry of the open list. The order is reversed, so that the heap yields the lowest first.
struct Open {
    estimate: f32,
    node: usize,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_estimate = other.estimate.total_cmp(&self.estimate);
        by_estimate.then(other.node.cmp(&self.node))
    }
}

/// Searches from the state of `sim`. Also returns the number of expanded states.
pub(super) fn search(sim: &Sim, config: &PlannerConfig, resolution: &SearchResolution) -> (Found, usize) {
    let mut search = Search::new(sim, config, resolution);
    for expansion in 0..config.max_expansions {
        let Some(Open { node, .. }) = search.open.pop() else {
            return (search.progress(), expansion);
        };
        if let Some(actions) = search.expand(node) {
            return (Found::Coin(actions), expansion + 1);
        }
    }
    (search.progress(), config.max_expansions)
}

struct Search<'a> {
    config: &'a PlannerConfig,
    resolution: &'a SearchResolution,
    nodes: Vec<Node>,
    open: BinaryHeap<Open>,
    seen: HashSet<u64>,
    /// The node nearest to the coin, and its estimated steps to it.
    nearest: (usize, f32),
}

impl<'a> Search<'a> {
    fn new(sim: &Sim, config: &'a PlannerConfig, resolution: &'a SearchResolution) -> Self {
        let mut search = Self {
            config,
            resolution,
            nodes: Vec::new(),
            open: BinaryHeap::new(),
            seen: HashSet::default(),
            nearest: (0, f32::INFINITY),
        };
        let start = Step { parent: 0, action: 0, ticks: 0 };
        search.push(sim.clone(), start, 0.0);
        search
    }

    /// Adds the states that follow from `node`. Returns the actions if one of them is the coin.
    fn expand(&mut self, node: usize) -> Option<Vec<u8>> {
        let grounded = self.nodes[node].sim.vy() == 0.0;
        let (actions, hold) = if grounded {
            (self.resolution.ground_actions, self.resolution.ground_hold)
        } else {
            (self.resolution.air_actions, self.resolution.air_hold)
        };
        for &action in actions {
            let mut sim = self.nodes[node].sim.clone();
            let mut cost = self.nodes[node].cost;
            let Some(ticks) = self.hold(&mut sim, action, hold, &mut cost) else {
                continue;
            };
            let step = Step { parent: node, action, ticks };
            if sim.end().is_some() {
                self.nodes.push(Node { sim, step, cost });
                return Some(self.actions_to(self.nodes.len() - 1));
            }
            if self.seen.insert(self.signature(&sim)) {
                self.push(sim, step, cost);
            }
        }
        None
    }

    /// Holds an action and adds up the cost. `None` if the player does not survive.
    fn hold(&self, sim: &mut Sim, action: u8, limit: u32, cost: &mut f32) -> Option<u32> {
        for tick in 0..limit {
            let was_falling = sim.vy() != 0.0;
            match sim.step(held(action, tick)).end {
                Some(end) if end.is_success() => return Some(tick + 1),
                Some(_) => return None,
                None => {}
            }
            if self.config.margin > 0.0 && is_too_close(sim, self.config.margin) {
                return None;
            }
            *cost += 1.0;
            if self.config.caution > 0.0 {
                *cost += self.config.caution * risk(sim);
            }
            let landed = was_falling && sim.vy() == 0.0;
            if landed {
                return Some(tick + 1);
            }
        }
        Some(limit)
    }

    fn push(&mut self, sim: Sim, step: Step, cost: f32) {
        let left = steps_to_coin(&sim);
        let node = self.nodes.len();
        if left < self.nearest.1 {
            self.nearest = (node, left);
        }
        let estimate = cost + self.config.greed * left;
        self.nodes.push(Node { sim, step, cost });
        self.open.push(Open { estimate, node });
    }

    /// Returns a number that states with nearly the same future share.
    fn signature(&self, sim: &Sim) -> u64 {
        let cells = self.resolution.cells_per_tile;
        let x = (sim.x() * cells) as u64;
        let y = (sim.y() * cells) as u64;
        let vx = (sim.vx() * 4.0 * cells + 64.0) as u64;
        let vy = (sim.vy() * 10.0 + 32.0) as u64;
        let is_near = sim.enemies().iter().any(|enemy| (enemy.x - sim.x()).abs() < ENEMY_RANGE);
        let time = if is_near { 1 + u64::from(sim.steps() / self.resolution.ground_hold) } else { 0 };
        x | y << 12 | vx << 24 | vy << 32 | time << 40
    }

    fn progress(&self) -> Found {
        Found::Progress(self.actions_to(self.nearest.0))
    }

    fn actions_to(&self, mut node: usize) -> Vec<u8> {
        let mut actions = Vec::new();
        while node != 0 {
            let step = &self.nodes[node].step;
            actions.extend((0..step.ticks).rev().map(|tick| held(step.action, tick)));
            node = step.parent;
        }
        actions.reverse();
        actions
    }
}

/// Returns the action of step `tick` while `action` is held: a jump is pressed only once.
fn held(action: u8, tick: u32) -> u8 {
    match action {
        2 | 5 | 8 if tick > 0 => action - 1,
        _ => action,
    }
}

/// Returns an optimistic number of steps to the coin: the distance along x at full speed.
fn steps_to_coin(sim: &Sim) -> f32 {
    let coin = sim.level().coin[0] as f32 + 0.5;
    ((coin - sim.x()).abs() - 1.0).max(0.0) / WALK_SPEED
}

// Distance of the player to hazards.

/// Distance (tiles) at which a hazard begins to count as a risk.
const RISK_RANGE: f32 = 1.0;

/// Returns true if a saw or an enemy is nearer than `margin` (tiles, less than 1).
pub(super) fn is_too_close(sim: &Sim, margin: f32) -> bool {
    let saws = sim.level().saws_near(sim.x());
    let player = sim.player();
    saws.iter().chain(sim.enemies()).any(|body| player.overlaps(body, margin))
}

/// Returns the risk of the present state: 0 far from saws, enemies and lava, growing to 1 on contact.
pub(super) fn risk(sim: &Sim) -> f32 {
    let player = sim.player();
    let saws = sim.level().saws_near(sim.x());
    let mut nearest = lava_below(sim);
    for body in saws.iter().chain(sim.enemies()) {
        let gap_x = (player.x - body.x).abs() - (player.rx + body.rx);
        let gap_y = (player.y - body.y).abs() - (player.ry + body.ry);
        nearest = nearest.min(gap_x.max(gap_y));
    }
    (1.0 - nearest.max(0.0) / RISK_RANGE).max(0.0)
}

/// Returns the height (tiles) of the player's feet over lava, if there is some in reach below.
fn lava_below(sim: &Sim) -> f32 {
    let player = sim.player();
    let feet = player.y - player.ry;
    let columns = [player.x - player.rx, player.x + player.rx];
    let row = feet as i32;
    for depth in 0..=(RISK_RANGE as i32 + 1) {
        let is_lava = |x: f32| sim.level().tiles.get(x as i32, row - depth).is_lava();
        if columns.into_iter().any(is_lava) {
            return feet - (row - depth + 1) as f32;
        }
    }
    f32::INFINITY
}
