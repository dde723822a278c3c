//! The augmented Lagrangian of the source's programme, with exact derivatives.
//!
//! All its parts are sums over sites: points of the spine where four quantities are functions of the eight local
//! variables. Each quantity is added to one row; a row is the energy, an equality or an inequality.

use super::basis::{LOCALS, localiser, quadrature};
use super::local::{Local, Scalar, density, euler, frame, misalignment, rates};
use super::newton::Objective;
use super::{Options, Problem, Violation};
use nalgebra::{DMatrix, DVector, SMatrix};
use num_dual::hessian;
use std::ops::Range;

/// Row of the energy, an index.
const ENERGY: usize = 0;
/// First row of the end position, an index.
const POSITION: usize = 1;
/// First row of the start's clamp, an index.
const START: usize = 4;
/// First row of the end's clamp, an index.
const END: usize = 8;
/// First row of the collocated conditions of the ribs, an index.
const RIBS: usize = 12;

/// Least penalty factor of the clamps, in R_f/U: well above the belt's own stiffness, for their multipliers to settle.
const CLAMP_PENALTY: f64 = 1e5;

/// Penalty factor of the clamps over that of the ribs: conditions that can be met rank above conditions that cannot.
/// Dimensionless.
const CLAMP_PRIORITY: f64 = 100.0;

/// Quantities of a site, a number.
const QUANTITIES: usize = 4;

/// Kind of a site: the quantities taken there.
enum Kind {
    /// Quadrature point of this weight: tangent and energy density, Eq. (3), (34).
    Arc(f64),
    /// First clamp: Eq. (45).
    Start,
    /// Last clamp: Eq. (46) or (49), (50).
    End,
    /// Collocation point of Eq. (25), (32), (33).
    Rib,
}

/// A point of the spine, with the kind and the rows of its quantities.
struct Site {
    kind: Kind,
    localiser: DMatrix<f64>,
    rows: [usize; QUANTITIES],
}

impl Site {
    fn local(&self, coefficients: &DVector<f64>) -> Local<f64> {
        Local::from_column_slice((&self.localiser * coefficients).as_slice())
    }
}

/// Kind of a row in the augmented Lagrangian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Row {
    Energy,
    Equality,
    Inequality,
}

fn row(index: usize) -> Row {
    match index {
        ENERGY => Row::Energy,
        RIBS.. if (index - RIBS) % QUANTITIES >= 2 => Row::Inequality,
        _ => Row::Equality,
    }
}

/// The augmented Lagrangian of Hestenes, Powell and, for inequalities, Rockafellar.
///
/// The source does not state how it weighs its conditions against each other. Here the clamps, which can be met, have their
/// own stiffer penalty and multipliers; the penalty and the updates of the options act on Eq. (25), (32) and (33), which
/// cannot be met.
///
/// Source: Sec. III-A, reference [14]
pub(super) struct Lagrangian<'a> {
    problem: &'a Problem,
    sites: Vec<Site>,
    multipliers: DVector<f64>,
    penalty: f64,
}

impl<'a> Lagrangian<'a> {
    /// The Lagrangian with all multipliers zero.
    pub(super) fn new(problem: &'a Problem, options: &Options) -> Self {
        Self {
            problem,
            sites: sites(options.basis, options.points),
            multipliers: DVector::zeros(RIBS + QUANTITIES * options.points),
            penalty: options.penalty,
        }
    }

    /// Updates the multipliers of the clamps by the penalty's forces at these coefficients.
    pub(super) fn update_clamps(&mut self, coefficients: &DVector<f64>) {
        self.update(POSITION..RIBS, coefficients);
    }

    /// Updates the multipliers of Eq. (25), (32) and (33) likewise.
    pub(super) fn update_ribs(&mut self, coefficients: &DVector<f64>) {
        self.update(RIBS..self.multipliers.len(), coefficients);
    }

    fn update(&mut self, range: Range<usize>, coefficients: &DVector<f64>) {
        let forces = self.forces(&self.rows(coefficients));
        for index in range {
            self.multipliers[index] = forces[index];
        }
    }

    /// Gradient max-norm at which a minimum is found: rounding of the stiffest term, but not below 1e-6 R_f/U.
    pub(super) fn tolerance(&self) -> f64 {
        (1e-12 * self.clamp_penalty()).max(1e-6)
    }

    /// The elastic energy alone.
    pub(super) fn energy(&self, coefficients: &DVector<f64>) -> f64 {
        self.rows(coefficients)[ENERGY]
    }

    /// Violation of the conditions.
    pub(super) fn violation(&self, coefficients: &DVector<f64>) -> Violation {
        let rows = self.rows(coefficients);
        let ribs = |quantity: usize| rows.iter().skip(RIBS + quantity).step_by(QUANTITIES);
        let largest = |worst: f64, value: &f64| worst.max(value.abs());
        Violation {
            geometric: rows.rows_range(POSITION..RIBS).amax(),
            geodesic: ribs(0).fold(0.0, largest),
            rib_slope: ribs(1).fold(0.0, largest),
            rib_crossing: ribs(2)
                .chain(ribs(3))
                .fold(0.0, |worst, value| worst.max(*value)),
        }
    }

    /// Every row: the energy, the residuals of equalities, the excess of inequalities.
    fn rows(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        let mut rows = DVector::zeros(self.multipliers.len());
        for site in &self.sites {
            let quantities = self.quantities(&site.kind, &site.local(coefficients));
            for (row, quantity) in site.rows.iter().zip(quantities) {
                rows[*row] += quantity;
            }
        }
        for axis in 0..3 {
            rows[POSITION + axis] -= self.problem.end_position[axis];
        }
        rows
    }

    /// The four quantities of a site.
    fn quantities<D: Scalar>(&self, kind: &Kind, q: &Local<D>) -> [D; QUANTITIES] {
        match kind {
            Kind::Arc(weight) => self.arc(q).map(|quantity| quantity * *weight),
            Kind::Start => [q[0], q[2], q[4], q[6]],
            Kind::End => {
                let [x, y, z] = misalignment(&self.problem.end_orientation, euler(q));
                [x, y, z, q[6]]
            }
            Kind::Rib => self.rib(q),
        }
    }

    /// Tangent and energy density.
    fn arc<D: Scalar>(&self, q: &Local<D>) -> [D; QUANTITIES] {
        let tangent = frame(euler(q)).column(1).into_owned();
        let density = density(self.problem.energy, self.problem.width_over_length, q);
        [tangent[0], tangent[1], tangent[2], density]
    }

    /// Residuals of Eq. (25) and (32), excess of Eq. (33).
    fn rib<D: Scalar>(&self, q: &Local<D>) -> [D; QUANTITIES] {
        let [geodesic, torsion, bend] = rates(q);
        let bound = 2.0 / self.problem.width_over_length;
        [geodesic, torsion + bend * q[6], q[7] - bound, -q[7] - bound]
    }

    /// Derivative of the augmented Lagrangian by each row.
    fn forces(&self, rows: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(rows.len(), |i, _| self.force(i, rows[i]))
    }

    fn clamp_penalty(&self) -> f64 {
        CLAMP_PENALTY.max(CLAMP_PRIORITY * self.penalty)
    }

    fn penalty(&self, index: usize) -> f64 {
        if index < RIBS {
            self.clamp_penalty()
        } else {
            self.penalty
        }
    }

    fn force(&self, index: usize, value: f64) -> f64 {
        let force = self.multipliers[index] + self.penalty(index) * value;
        match row(index) {
            Row::Energy => 1.0,
            Row::Equality => force,
            Row::Inequality => force.max(0.0),
        }
    }

    /// Second derivative of the augmented Lagrangian by each row.
    fn stiffness(&self, index: usize, value: f64) -> f64 {
        match row(index) {
            Row::Energy => 0.0,
            Row::Inequality if self.force(index, value) == 0.0 => 0.0,
            _ => self.penalty(index),
        }
    }

    /// The term of a row in the augmented Lagrangian.
    fn term(&self, index: usize, value: f64) -> f64 {
        let (force, multiplier) = (self.force(index, value), self.multipliers[index]);
        match row(index) {
            Row::Energy => value,
            _ => (force * force - multiplier * multiplier) / (2.0 * self.penalty(index)),
        }
    }

    /// Jacobian of all rows, and the Hessian of their sum weighted by `forces`.
    ///
    /// Shapes: (rows, 4n), (4n, 4n).
    fn expansion(
        &self,
        coefficients: &DVector<f64>,
        forces: &DVector<f64>,
    ) -> (DMatrix<f64>, DMatrix<f64>) {
        let size = coefficients.len();
        let mut jacobian = DMatrix::zeros(forces.len(), size);
        let mut curvature = DMatrix::zeros(size, size);
        for site in &self.sites {
            let weighted = self.expand(site, coefficients, forces, &mut jacobian);
            curvature += site.localiser.tr_mul(&(weighted * &site.localiser));
        }
        (jacobian, curvature)
    }

    /// Adds a site's share of the Jacobian; returns the site's weighted Hessian in the local variables.
    fn expand(
        &self,
        site: &Site,
        coefficients: &DVector<f64>,
        forces: &DVector<f64>,
        jacobian: &mut DMatrix<f64>,
    ) -> SMatrix<f64, LOCALS, LOCALS> {
        let local = site.local(coefficients);
        let expansions = hessian(|q| self.quantities(&site.kind, &q), &local);
        let mut weighted = SMatrix::zeros();
        for (&row, (_, gradient, hessian)) in site.rows.iter().zip(expansions) {
            let mut target = jacobian.row_mut(row);
            target += gradient.transpose() * &site.localiser;
            weighted += hessian * forces[row];
        }
        weighted
    }
}

impl Objective for Lagrangian<'_> {
    fn value(&self, coefficients: &DVector<f64>) -> f64 {
        let rows = self.rows(coefficients);
        rows.iter()
            .enumerate()
            .map(|(i, value)| self.term(i, *value))
            .sum()
    }

    fn derivatives(&self, coefficients: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let rows = self.rows(coefficients);
        let forces = self.forces(&rows);
        let (jacobian, mut hessian) = self.expansion(coefficients, &forces);
        let mut stiff = jacobian.clone();
        for (i, mut row) in stiff.row_iter_mut().enumerate() {
            row *= self.stiffness(i, rows[i]);
        }
        hessian += jacobian.tr_mul(&stiff);
        (jacobian.tr_mul(&forces), hessian)
    }
}

/// All sites, for n basis functions and this number of collocation points.
fn sites(n: usize, points: usize) -> Vec<Site> {
    let site = |kind, u, rows| Site {
        kind,
        localiser: localiser(n, u),
        rows,
    };
    let arc_rows = [POSITION, POSITION + 1, POSITION + 2, ENERGY];
    let mut sites = vec![
        site(Kind::Start, 0.0, consecutive(START)),
        site(Kind::End, 1.0, consecutive(END)),
    ];
    let rule = quadrature(n).into_iter();
    sites.extend(rule.map(|(u, weight)| site(Kind::Arc(weight), u, arc_rows)));
    let spacing = 1.0 / (points - 1) as f64;
    let rib = |i| {
        site(
            Kind::Rib,
            i as f64 * spacing,
            consecutive(RIBS + QUANTITIES * i),
        )
    };
    sites.extend((0..points).map(rib));
    sites
}

fn consecutive(first: usize) -> [usize; QUANTITIES] {
    std::array::from_fn(|i| first + i)
}

#[cfg(test)]
mod tests {
    use super::super::tests::examples;
    use super::super::{DevelopableEnergy, Orientation, Side};
    use super::*;
    use approx::assert_relative_eq;
    use num_dual::{Dual2_64, second_derivative};
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

    /// Numbers without a pattern, the same on every run.
    fn scattered(count: usize, scale: f64) -> DVector<f64> {
        DVector::from_fn(count, |i, _| scale * (12.9898 * (i + 1) as f64).sin())
    }

    fn options(basis: usize) -> Options {
        Options {
            basis,
            penalty: 30.0,
            ..Options::default()
        }
    }

    /// A Lagrangian with no multiplier zero, and coefficients whose ribs cross at some of the points.
    fn busy(problem: &Problem) -> (Lagrangian<'_>, DVector<f64>) {
        let mut lagrangian = Lagrangian::new(problem, &options(10));
        lagrangian.multipliers = scattered(lagrangian.multipliers.len(), 3.0);
        lagrangian.multipliers[ENERGY] = 0.0;
        let mut coefficients = scattered(40, 0.4);
        coefficients.rows_range_mut(30..).scale_mut(10.0);
        (lagrangian, coefficients)
    }

    /// The augmented Lagrangian along a line, by its textbook formula.
    fn along(
        lagrangian: &Lagrangian,
        from: &DVector<f64>,
        by: &DVector<f64>,
        t: Dual2_64,
    ) -> Dual2_64 {
        let mut rows = vec![Dual2_64::from(0.0); lagrangian.multipliers.len()];
        for axis in 0..3 {
            rows[POSITION + axis] -= lagrangian.problem.end_position[axis];
        }
        for site in &lagrangian.sites {
            let step = site.local(by).map(Dual2_64::from) * t;
            let local = site.local(from).map(Dual2_64::from) + step;
            for (row, quantity) in site
                .rows
                .iter()
                .zip(lagrangian.quantities(&site.kind, &local))
            {
                rows[*row] += quantity;
            }
        }
        let textbook = |(i, g): (usize, Dual2_64)| {
            let (multiplier, penalty) = (lagrangian.multipliers[i], lagrangian.penalty(i));
            match row(i) {
                Row::Energy => g,
                Row::Inequality if multiplier + penalty * g.re <= 0.0 => {
                    Dual2_64::from(-multiplier * multiplier / (2.0 * penalty))
                }
                _ => g * multiplier + g * g * (0.5 * penalty),
            }
        };
        rows.into_iter().enumerate().map(textbook).sum()
    }

    #[test]
    fn derivatives_agree_with_automatic_ones_of_the_whole() {
        for problem in examples() {
            let (lagrangian, x) = busy(&problem);
            let (gradient, hessian) = lagrangian.derivatives(&x);
            for seed in 1..4 {
                let d = scattered(40 * seed, 1.0)
                    .rows(40 * (seed - 1), 40)
                    .into_owned();
                let (value, first, second) =
                    second_derivative(|t| along(&lagrangian, &x, &d, t), 0.0);
                assert_relative_eq!(value, lagrangian.value(&x), max_relative = 1e-12);
                assert_relative_eq!(first, gradient.dot(&d), max_relative = 1e-10);
                assert_relative_eq!(second, d.dot(&(&hessian * &d)), max_relative = 1e-10);
            }
        }
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        for problem in examples() {
            let (lagrangian, x) = busy(&problem);
            let (gradient, hessian) = lagrangian.derivatives(&x);
            let h = 1e-6;
            for k in 0..x.len() {
                let at = |t: f64| &x + DVector::from_fn(40, |i, _| if i == k { t } else { 0.0 });
                let slope = (lagrangian.value(&at(h)) - lagrangian.value(&at(-h))) / (2.0 * h);
                assert_relative_eq!(gradient[k], slope, epsilon = 1e-7 * gradient.amax());
                let column = (lagrangian.derivatives(&at(h)).0 - lagrangian.derivatives(&at(-h)).0)
                    / (2.0 * h);
                let error = (hessian.column(k) - column).amax();
                assert!(error < 1e-6 * hessian.amax(), "column {k} off by {error}");
            }
        }
    }

    /// Coefficients ψ = bend u and β = slope.
    fn cylinder(bend: f64, slope: f64) -> DVector<f64> {
        let mut coefficients = DVector::zeros(40);
        (coefficients[21], coefficients[30]) = (bend, slope);
        coefficients
    }

    #[test]
    fn energy_of_a_cylinder_is_the_closed_form() {
        let [problem, _] = examples();
        for (bend, slope) in [(2.0, 0.0), (-3.0, 0.75)] {
            let energy = |energy| {
                let problem = Problem {
                    energy,
                    ..problem.clone()
                };
                Lagrangian::new(&problem, &options(10)).energy(&cylinder(bend, slope))
            };
            let stretch: f64 = 1.0 + slope * slope;
            let plate = 0.5 * (bend * stretch).powi(2);
            assert_relative_eq!(
                energy(DevelopableEnergy::Fishbone),
                plate * stretch.sqrt(),
                max_relative = 1e-13
            );
            assert_relative_eq!(
                energy(DevelopableEnergy::Sadowsky),
                plate,
                max_relative = 1e-13
            );
            assert_relative_eq!(
                energy(DevelopableEnergy::Wunderlich),
                plate,
                max_relative = 1e-13
            );
        }
    }

    #[test]
    fn violation_of_a_slanted_cylinder_is_bend_times_slope() {
        let [problem, _] = examples();
        let violation = Lagrangian::new(&problem, &options(10)).violation(&cylinder(2.0, 0.75));
        assert_relative_eq!(violation.rib_slope, 1.5, max_relative = 1e-13);
        assert_eq!((violation.geodesic, violation.rib_crossing), (0.0, 0.0));
    }

    fn equalities(rows: usize) -> Vec<usize> {
        (0..rows).filter(|i| row(*i) == Row::Equality).collect()
    }

    #[test]
    fn there_are_the_sources_11_and_64_conditions_of_which_43_are_equalities() {
        let [problem, _] = examples();
        let rows = Lagrangian::new(&problem, &options(10)).multipliers.len();
        assert_eq!((RIBS - POSITION, rows - RIBS), (11, 64));
        assert_eq!(equalities(rows).len(), 43);
    }

    /// Scattered coefficients moved to meet the eight conditions on the angles and slopes of both ends.
    fn at_the_clamps(n: usize, angles: [f64; 3]) -> DVector<f64> {
        let [problem, _] = examples();
        let end_orientation = Orientation::Angles(angles);
        let problem = Problem {
            end_orientation,
            ..problem
        };
        let lagrangian = Lagrangian::new(&problem, &options(n));
        let x = scattered(4 * n, 0.3);
        let rows = lagrangian.rows(&x);
        let jacobian = lagrangian
            .expansion(&x, &rows)
            .0
            .rows_range(START..RIBS)
            .into_owned();
        let inverse = jacobian.pseudo_inverse(1e-12).unwrap();
        x - inverse * rows.rows_range(START..RIBS)
    }

    /// Independent equalities among `problem`'s, at coefficients that meet the clamps.
    fn rank(problem: &Problem, n: usize, angles: [f64; 3]) -> usize {
        let lagrangian = Lagrangian::new(problem, &options(n));
        let x = at_the_clamps(n, angles);
        let rows = lagrangian.rows(&x);
        assert!(rows.rows_range(START..RIBS).amax() < 1e-12);
        let jacobian = lagrangian
            .expansion(&x, &rows)
            .0
            .select_rows(&equalities(rows.len()));
        jacobian.rank(1e-9 * jacobian.amax())
    }

    #[test]
    fn equalities_outnumber_the_coefficients() {
        let [first, second] = examples();
        let natural = [0.0; 3];
        let tilted = [-FRAC_PI_2, FRAC_PI_6, FRAC_PI_2];
        // Twice the basis has room for all of the equations, so that the rank is the number of independent ones.
        assert_eq!(rank(&first, 20, natural), 41);
        assert_eq!(rank(&second, 20, tilted), 42);
        assert_eq!(rank(&first, 10, natural), 40);
        assert_eq!(rank(&second, 10, tilted), 40);
    }

    #[test]
    fn mirror_images_have_the_same_value() {
        let [problem, _] = examples();
        let mirrored = Problem {
            bulge: Side::Minus,
            ..problem.clone()
        };
        let (lagrangian, mirrored) = (
            Lagrangian::new(&problem, &options(10)),
            Lagrangian::new(&mirrored, &options(10)),
        );
        let x = scattered(40, 0.4);
        let mut reflected = -x.clone();
        reflected.rows_range_mut(30..).neg_mut();
        assert_relative_eq!(
            lagrangian.value(&x),
            mirrored.value(&reflected),
            max_relative = 1e-13
        );
    }
}
