//! One step of a path, by the rules of the player, with short cuts where little is in the way.

use super::{ground::Ground, slide::slide, sweep::Sweep, swept::Swept, walker::Walker};
use crate::coinrun::rules::{PlayerState, PlayerStep, fall, is_supported, move_player, walk};

impl Walker {
    /// Returns the player after one step with a direction held (-1, 0 or 1), and perhaps the jump button.
    #[inline(always)]
    pub fn step(self, ground: &Ground, ax: i8, jumps: bool) -> Self {
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
    fn fly(self, ground: &Ground, sweep: &Sweep) -> Option<Self> {
        let [x, y] = sweep.end;
        let swept = Swept::between([self.x, self.y], [x, y]);
        let is_free = ground.tiles.is_clear(&ground.corners(&swept));
        (is_free && (self.vy >= 0.0 || !ground.crates.may_hold(self.y, &swept))).then_some(Self { x, y, ..self })
    }

    /// Computes the step by the rules.
    fn obey(self, ground: &Ground, ax: i8, ay: i8) -> Self {
        let (mut body, mut memory) = (self.body(ground), PlayerState::default());
        let step = PlayerStep { ax, ay, vy: self.vy, y: self.y, ry: ground.ry };
        move_player(&mut body, &mut memory, ground.tiles, ground.crates.below(self.y), &step, true);
        let supported = is_supported(&body, &memory, ground.tiles);
        Self { x: body.x, y: body.y, vx: body.vx, vy: body.vy, supported }
    }
}
