//! Integrals across the width of a strip: Gauss's rule, and the strain along the strip that its Gauss curvature asks for.

/// Greatest count of points across the width, a number.
pub(crate) const MOST: usize = 12;
/// Greatest count of modes of the strain along the strip, a number.
pub(crate) const MODES: usize = MOST - 2;

/// Gauss's rule on [−1, 1], with the operator that integrates a polynomial through its points twice.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Across {
    /// Number of points.
    pub(crate) points: usize,
    /// Places of the points.
    pub(crate) t: [f64; MOST],
    /// Weights of the points; they sum to 2.
    pub(crate) weight: [f64; MOST],
    /// Values at the points of the twofold integral of a polynomial, but for a linear function, from the polynomial's values
    /// at the points: one row for every point.
    pub(crate) twice: [[f64; MOST]; MOST],
    /// Modes of the strain along the strip from the Gauss curvature at the points: its parts by the Legendre polynomials of
    /// norm 1, one row for every degree from the second on. There are two less than there are points.
    pub(crate) modes: [[f64; MOST]; MODES],
    /// Part of a mode's polynomial in t times the polynomial of the mode before, for every mode.
    pub(crate) beside: [f64; MODES],
}

impl Across {
    /// The rule of a number of points.
    ///
    /// # Panics
    ///
    /// Unless there are 2 to [`MOST`] points.
    pub(crate) fn gauss(points: usize) -> Self {
        assert!((2..=MOST).contains(&points));
        let mut rule = Self {
            points,
            t: [0.0; MOST],
            weight: [0.0; MOST],
            twice: [[0.0; MOST]; MOST],
            modes: [[0.0; MOST]; MODES],
            beside: std::array::from_fn(|i| {
                let degree = (i + 2) as f64;
                degree / (4.0 * degree * degree - 1.0).sqrt()
            }),
        };
        for i in 0..points {
            (rule.t[i], rule.weight[i]) = gauss_point(points, i);
        }
        for i in 0..points {
            for j in 0..points {
                let (at, from) = (legendre(rule.t[i]), legendre(rule.t[j]));
                let terms = (0..points).map(|n| {
                    // ∫∫ of a Legendre polynomial; its linear part is left out.
                    let m = n as f64;
                    let mut integral = at[n + 2] / ((2.0 * m + 1.0) * (2.0 * m + 3.0));
                    if n >= 2 {
                        integral -= 2.0 * at[n] / ((2.0 * m - 1.0) * (2.0 * m + 3.0));
                    }
                    if n >= 4 {
                        integral += at[n - 2] / ((2.0 * m - 1.0) * (2.0 * m + 1.0));
                    }
                    let coefficient = (m + 0.5) * rule.weight[j] * from[n];
                    coefficient * integral
                });
                rule.twice[i][j] = terms.sum();
            }
        }
        rule.find_modes();
        rule
    }

    fn find_modes(&mut self) {
        for degree in 2..self.points {
            let norm = (degree as f64 + 0.5).sqrt();
            for j in 0..self.points {
                let parts = (0..self.points).map(|i| {
                    let polynomial = norm * legendre(self.t[i])[degree];
                    self.weight[i] * polynomial * self.twice[i][j]
                });
                self.modes[degree - 2][j] = -parts.sum::<f64>();
            }
        }
    }
}

/// Place and weight of a point of Gauss's rule: a zero of the Legendre polynomial, by Newton's method.
fn gauss_point(points: usize, i: usize) -> (f64, f64) {
    /// Steps after which Newton's method has converged from its classical start, a number.
    const STEPS: usize = 10;
    let n = points as f64;
    let slope = |t: f64, p: &[f64; MOST + 2]| n * (t * p[points] - p[points - 1]) / (t * t - 1.0);
    let mut t = -(std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
    for _ in 0..STEPS {
        let p = legendre(t);
        t -= p[points] / slope(t, &p);
    }
    let slope = slope(t, &legendre(t));
    (t, 2.0 / ((1.0 - t * t) * slope * slope))
}

/// The Legendre polynomials at a place.
fn legendre(t: f64) -> [f64; MOST + 2] {
    let mut p = [1.0; MOST + 2];
    p[1] = t;
    for n in 1..=MOST {
        let m = n as f64;
        p[n + 1] = ((2.0 * m + 1.0) * t * p[n] - m * p[n - 1]) / (m + 1.0);
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn test_rules_integrate_polynomials_of_degree_below_twice_their_points() {
        for points in 2..=MOST {
            let rule = Across::gauss(points);
            for power in 0..2 * points as i32 {
                let sum: f64 = (0..points)
                    .map(|i| rule.weight[i] * rule.t[i].powi(power))
                    .sum();
                let exact = match power % 2 {
                    0 => 2.0 / (f64::from(power) + 1.0),
                    _ => 0.0,
                };
                assert!((sum - exact).abs() < 1e-14, "{points} {power}");
            }
        }
    }

    #[test]
    fn test_twofold_integrals_are_those_of_powers_but_for_a_linear_function() {
        for points in 3..=MOST {
            let rule = Across::gauss(points);
            for power in 0..points as i32 {
                let n = f64::from(power);
                let off = |i: usize| {
                    let integral: f64 = (0..points)
                        .map(|j| rule.twice[i][j] * rule.t[j].powi(power))
                        .sum();
                    integral - rule.t[i].powi(power + 2) / ((n + 1.0) * (n + 2.0))
                };
                // The difference is linear: its slope is the same between all points.
                let slope = (off(1) - off(0)) / (rule.t[1] - rule.t[0]);
                for i in 2..points {
                    let on_line = off(0) + slope * (rule.t[i] - rule.t[0]);
                    assert_relative_eq!(off(i), on_line, epsilon = 1e-14);
                }
            }
        }
    }
}
