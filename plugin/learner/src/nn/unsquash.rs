//! A Gaussian decoder in the coordinates of a squashed Gaussian policy.

use super::HostDist;

/// Bound within which actions are clamped before the inverse of tanh is applied.
const EDGE: f64 = 0.999;

/// Maps a Gaussian over actions in [-1, 1] back through tanh, to be compared with a squashed policy before its tanh.
///
/// The inverse image is not normal, so this is an approximation. The inverse of tanh is monotone and maps quantiles
/// to quantiles: the median m goes to atanh(m), and σ to half the distance of the images of m ± σ, with m and m ± σ
/// clamped to ±0.999. For small σ this is the tangent's σ / (1 - m²). Near the edges, where that explodes, it stays a
/// width that a policy can have. Categorical distributions are unchanged.
pub fn unsquashed(decoder: &HostDist) -> HostDist {
    let Some(stds) = &decoder.log_std else { return decoder.clone() };
    let before = |action: f64| action.clamp(-EDGE, EDGE).atanh();
    let mut out = HostDist { dim: decoder.dim, head: Vec::new(), log_std: None };
    let mut log_std = Vec::with_capacity(stds.len());
    for (&mean, &log) in decoder.head.iter().zip(stds) {
        let mean = f64::from(mean).clamp(-EDGE, EDGE);
        let std = f64::from(log).exp();
        let spread = 0.5 * (before(mean + std) - before(mean - std));
        out.head.push(before(mean) as f32);
        // The smallest ln σ that a state-dependent decoder can have; guards against σ that rounding makes 0.
        log_std.push(spread.ln().max(-10.0) as f32);
    }
    out.log_std = Some(log_std);
    out
}

/// Returns the normal number whose tanh is `action`. An action beyond ±(1 - 1e-6), which single precision cannot
/// resolve, is clamped there.
pub(crate) fn unsquashed_action(action: f32) -> f32 {
    let edge = 1.0 - 1e-6;
    f64::from(action).clamp(-edge, edge).atanh() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(mean: f32, std: f32) -> (f32, f32) {
        let decoder = HostDist { dim: 1, head: vec![mean], log_std: Some(vec![std.ln()]) };
        let mapped = unsquashed(&decoder);
        (mapped.head[0], mapped.log_std.expect("continuous")[0].exp())
    }

    #[test]
    fn narrow_ones_follow_the_tangent() {
        let (mean, std) = of(0.5, 0.001);
        assert!((mean - 0.5f32.atanh()).abs() < 1e-6);
        assert!((std / (0.001 / (1.0 - 0.25)) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn wide_ones_keep_their_quantiles() {
        let (mean, std) = of(-0.2, 0.5);
        assert!((mean - (-0.2f32).atanh()).abs() < 1e-6);
        assert!((std - 0.5 * (0.3f32.atanh() + 0.7f32.atanh())).abs() < 1e-6);
    }

    #[test]
    fn means_beyond_the_edge_stay_finite_and_usable() {
        for sign in [-1.0, 1.0] {
            let (mean, std) = of(7.0 * sign, 0.3);
            assert!((mean - sign * 3.8002).abs() < 1e-3);
            // Half of atanh(0.999) - atanh(0.699).
            assert!((std - 0.5 * (3.8002 - 0.8653)).abs() < 1e-2, "{std}");
        }
        let (_, std) = of(1.0, 1e-30);
        assert!(std > 0.0);
    }

    #[test]
    fn choices_are_left_alone() {
        let choices = HostDist { dim: 2, head: vec![-0.5, -0.9], log_std: None };
        assert_eq!(unsquashed(&choices), choices);
    }
}
