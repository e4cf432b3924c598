//! Accelerations that obey mass, forces and one-sided constraints: Newton's method on a convex cost, as in MuJoCo.
//!
//! The cost is ½(a - a₀)·M·(a - a₀) + ½ Σ w·min(0, J·a - reference)², where a₀ are the accelerations without
//! constraints. It is quadratic as long as the same rows push, so few iterations reach the exact minimum.

use super::{
    arrow_matrix::{ArrowMatrix, BASE, Coordinates},
    constraint::Row,
};

const ITERATIONS: usize = 30;
const LINE_ITERATIONS: usize = 20;

/// Scratch space of the solver.
#[derive(Clone, Debug, Default)]
pub struct ConstraintSolver {
    residuals: Vec<f64>,
    slopes: Vec<f64>,
}

impl ConstraintSolver {
    /// Minimises the cost, starting from `guess`.
    pub fn solve(&mut self, mass: &ArrowMatrix, free: &Coordinates, rows: &[Row], guess: &Coordinates) -> Coordinates {
        let mut at = *guess;
        self.residuals.clear();
        self.residuals.extend(rows.iter().map(|row| row.dot(&at) - row.reference));
        for _ in 0..ITERATIONS {
            let pull = mass.times(&at.plus(-1.0, free));
            let gradient = self.gradient(&pull, rows);
            let hessian = self.hessian(mass, rows);
            let step = hessian.factor().solve(&gradient);
            // The step is a descent direction, taken with a minus sign.
            self.slopes.clear();
            self.slopes.extend(rows.iter().map(|row| -row.dot(&step)));
            let (length, settled) = self.search(-pull.dot(&step), step.dot(&mass.times(&step)), rows);
            at = at.plus(-length, &step);
            for (residual, slope) in self.residuals.iter_mut().zip(&self.slopes) {
                *residual += length * slope;
            }
            if settled {
                break;
            }
        }
        at
    }

    fn gradient(&self, pull: &Coordinates, rows: &[Row]) -> Coordinates {
        let mut gradient = *pull;
        for (row, &residual) in rows.iter().zip(&self.residuals) {
            if residual < 0.0 {
                let force = row.weight * residual;
                for (g, j) in gradient.base.iter_mut().zip(&row.base) {
                    *g += force * j;
                }
                gradient.legs[row.leg][0] += force * row.hinges[0];
                gradient.legs[row.leg][1] += force * row.hinges[1];
            }
        }
        gradient
    }

    fn hessian(&self, mass: &ArrowMatrix, rows: &[Row]) -> ArrowMatrix {
        let mut hessian = *mass;
        for (row, _) in rows.iter().zip(&self.residuals).filter(|(_, residual)| **residual < 0.0) {
            let [p, q] = row.hinges.map(|hinge| hinge * row.weight);
            for i in 0..BASE {
                let scaled = row.base[i] * row.weight;
                for j in 0..=i {
                    hessian.base[i][j] += scaled * row.base[j];
                }
                hessian.arms[row.leg][0][i] += p * row.base[i];
                hessian.arms[row.leg][1][i] += q * row.base[i];
            }
            let leg = &mut hessian.legs[row.leg];
            leg[0] += p * row.hinges[0];
            leg[1] += p * row.hinges[1];
            leg[2] += q * row.hinges[1];
        }
        hessian
    }

    /// Returns the step length at which the slope of the cost along the step vanishes. Also tells whether the step is
    /// whole with the same rows pushing throughout: then the minimum is reached.
    fn search(&self, start_slope: f64, curvature: f64, rows: &[Row]) -> (f64, bool) {
        let along = |length: f64| {
            let (mut slope, mut bend, mut same) = (start_slope + length * curvature, curvature, true);
            for ((row, &residual), &change) in rows.iter().zip(&self.residuals).zip(&self.slopes) {
                let there = residual + length * change;
                same &= (there < 0.0) == (residual < 0.0);
                if there < 0.0 {
                    slope += row.weight * there * change;
                    bend += row.weight * change * change;
                }
            }
            (slope, bend, same)
        };
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let mut length = 1.0;
        for _ in 0..LINE_ITERATIONS {
            let (slope, bend, same) = along(length);
            if length == 1.0 && same {
                return (1.0, true);
            }
            if slope < 0.0 {
                low = length
            } else {
                high = length
            }
            let next = length - slope / bend;
            let next = if next > low && next < high {
                next
            } else if high.is_finite() {
                (low + high) / 2.0
            } else {
                low * 2.0
            };
            if (next - length).abs() < 1e-6 * length {
                return (next, false);
            }
            length = next;
        }
        (length, false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ant::skeleton::LEGS;

    fn unit_mass() -> ArrowMatrix {
        let mut mass = ArrowMatrix { legs: [[1.0, 0.0, 1.0]; LEGS], ..ArrowMatrix::default() };
        for i in 0..BASE {
            mass.base[i][i] = 1.0;
        }
        mass
    }

    fn push(dimension: usize, sign: f64, reference: f64, weight: f64) -> Row {
        let mut base = [0.0; BASE];
        base[dimension] = sign;
        Row { base, leg: 0, hinges: [0.0; 2], reference, weight }
    }

    #[test]
    fn one_row_pulls_by_its_weight() {
        let free = Coordinates { base: [0.0, 0.0, 0.0, 0.0, 0.0, -10.0], ..Coordinates::default() };
        // Minimum of (a + 10)²/2 + 4·(a - 5)²/2 over a < 5.
        let a =
            ConstraintSolver::default().solve(&unit_mass(), &free, &[push(5, 1.0, 5.0, 4.0)], &Coordinates::default());
        assert!((a.base[5] - 2.0).abs() < 1e-12, "{a:?}");
    }

    #[test]
    fn rows_that_are_content_do_nothing() {
        let free = Coordinates { base: [0.0, 0.0, 0.0, 0.0, 0.0, 3.0], ..Coordinates::default() };
        let rows = [push(5, 1.0, -1.0, 50.0), push(5, -1.0, -8.0, 50.0)];
        // The guess is where the second row pushes.
        let guess = Coordinates { base: [0.0, 0.0, 0.0, 0.0, 0.0, 90.0], ..Coordinates::default() };
        let a = ConstraintSolver::default().solve(&unit_mass(), &free, &rows, &guess);
        assert!((a.base[5] - 3.0).abs() < 1e-9, "{a:?}");
    }

    #[test]
    fn opposed_rows_settle_between() {
        let free = Coordinates::default();
        let rows = [push(0, 1.0, 6.0, 1.0), push(0, -1.0, 6.0, 3.0)];
        // Minimum of a²/2 + (a - 6)²/2 + 3·(a + 6)²/2.
        let a = ConstraintSolver::default().solve(&unit_mass(), &free, &rows, &free);
        assert!((a.base[0] + 12.0 / 5.0).abs() < 1e-9, "{a:?}");
    }
}
