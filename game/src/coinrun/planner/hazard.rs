//! Distance of the player to hazards.

use crate::coinrun::sim::Sim;

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
