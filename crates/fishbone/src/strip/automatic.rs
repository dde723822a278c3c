//! Motions and derivatives of elements by automatic differentiation, for any density.

use super::density::{self, Density, LANES, Loaded, element_energy};
use super::element::Element;
use crate::geometry::{Pose, SHORTENING, gauss_points};
use nalgebra::{Matrix3, SVector, Vector3, Vector6};
use num_dual::{Dual64, DualNum, HyperDual64};
use stagewise::{Stage, StageMatrix};

type Triple<T> = [T; 3];

/// A pose in any kind of number: the frame row by row, and the position.
#[derive(Clone, Copy)]
struct Motion<T> {
    frame: [Triple<T>; 3],
    position: Triple<T>,
}

/// Motions of elements, one after the other.
#[derive(Debug, Clone)]
pub struct Motions<const F: usize> {
    elements: [Option<(Element, [[f64; F]; 2])>; LANES],
    motions: [Pose; LANES],
}

impl<const F: usize> Default for Motions<F> {
    fn default() -> Self {
        Self {
            elements: [None; LANES],
            motions: [Pose::identity(); LANES],
        }
    }
}

impl<D: Density<F>, const F: usize> density::Motions<D, F> for Motions<F> {
    fn set(&mut self, lane: usize, element: &Element, ends: [&SVector<f64, F>; 2]) {
        self.elements[lane] = Some((*element, ends.map(|end| end.data.0[0])));
    }

    fn find(&mut self, density: &D) {
        for (element, into) in self.elements.iter().zip(&mut self.motions) {
            let Some((element, ends)) = element else {
                continue;
            };
            let motion = motion(density, element, ends);
            *into = Pose {
                frame: Matrix3::from_fn(|i, j| motion.frame[i][j]),
                position: Vector3::from(motion.position),
            };
        }
    }

    fn at(&self, lane: usize) -> Pose {
        self.motions[lane]
    }
}

/// Derivatives of elements, one after the other.
#[derive(Debug, Clone)]
pub struct Derivatives<const F: usize> {
    lanes: [Lane<F>; LANES],
}

/// The derivatives of one element.
#[derive(Debug, Clone, Copy)]
struct Lane<const F: usize> {
    /// Twist of the second node by the fields at either end.
    growth: [[Vector6<f64>; F]; 2],
    /// Second derivative by the first node's twist and the fields.
    mixed: [[Vector6<f64>; F]; 2],
    gradient: [SVector<f64, F>; 2],
    hessian: StageMatrix<F>,
}

impl<const F: usize> Default for Derivatives<F> {
    fn default() -> Self {
        Self {
            lanes: [Lane {
                growth: [[Vector6::zeros(); F]; 2],
                mixed: [[Vector6::zeros(); F]; 2],
                gradient: [SVector::zeros(); 2],
                hessian: StageMatrix::zeros(),
            }; LANES],
        }
    }
}

impl<D: Density<F>, const F: usize> density::Derivatives<D, F> for Derivatives<F> {
    fn set(&mut self, lane: usize, density: &D, loaded: &Loaded<'_, F>) {
        self.lanes[lane] = Lane::of(density, loaded);
    }

    /// Nothing is left to compute: `set` finds the derivatives.
    fn find(&mut self, _: &D) {}

    fn gradient(&self, lane: usize) -> [SVector<f64, F>; 2] {
        self.lanes[lane].gradient
    }

    fn hessian(&self, lane: usize) -> StageMatrix<F> {
        self.lanes[lane].hessian
    }

    fn carry<const N: usize>(&self, lane: usize, stage: &mut Stage<F, N>) {
        let Lane { growth, mixed, .. } = &self.lanes[lane];
        for j in 0..F {
            for row in 0..6 {
                stage.growth_by_first[(row, j)] = growth[0][j][row];
                stage.growth_by_second[(row, j)] = growth[1][j][row];
                stage.state_first[(row, j)] = mixed[0][j][row];
                stage.state_second[(row, j)] = mixed[1][j][row];
            }
        }
    }
}

impl<const F: usize> Lane<F> {
    fn of<D: Density<F>>(density: &D, loaded: &Loaded<'_, F>) -> Self {
        let ends = loaded.fields.map(|end| end.data.0[0]);
        let wrench = loaded.wrench;
        let mut lane = Derivatives::<F>::default().lanes[0];
        for a in 0..2 * F {
            let mut seeded = ends.map(|end| end.map(Dual64::from));
            seeded[a / F][a % F].eps = 1.0;
            let twist = twist(density, loaded, &seeded).map(|x| x.eps);
            let growth = Vector6::from(twist);
            lane.growth[a / F][a % F] = growth;
            lane.mixed[a / F][a % F] = half_bracket(&growth, wrench);
            for b in 0..=a {
                let mut seeded = ends.map(|end| end.map(HyperDual64::from));
                seeded[a / F][a % F].eps1 = 1.0;
                seeded[b / F][b % F].eps2 = 1.0;
                let moved = self::twist(density, loaded, &seeded);
                let work = (0..6).map(|i| moved[i] * wrench[i]);
                let value = work.fold(
                    element_energy(density, loaded.element, seeded),
                    |sum, work| sum + work,
                );
                lane.gradient[a / F][a % F] = value.eps1;
                lane.set_hessian(a, b, value.eps1eps2);
            }
        }
        lane
    }

    /// Sets the second derivative by two fields. Fields are numbered through both ends, the first end's before the second's.
    fn set_hessian(&mut self, a: usize, b: usize, value: f64) {
        let (i, j) = (a % F, b % F);
        match (a / F, b / F) {
            (0, _) => {
                self.hessian.first[(i, j)] = value;
                self.hessian.first[(j, i)] = value;
            }
            (_, 0) => self.hessian.mixed[(j, i)] = value,
            _ => {
                self.hessian.second[(i, j)] = value;
                self.hessian.second[(j, i)] = value;
            }
        }
    }
}

/// Half the work of a wrench on the bracket of every unit twist with a twist.
fn half_bracket(twist: &Vector6<f64>, wrench: &Vector6<f64>) -> Vector6<f64> {
    let [shift, turn] = [0, 3].map(|from| twist.fixed_rows::<3>(from).into_owned());
    let [force, moment] = [0, 3].map(|from| wrench.fixed_rows::<3>(from).into_owned());
    let by_shift = 0.5 * turn.cross(&force);
    let by_turn = 0.5 * (shift.cross(&force) + turn.cross(&moment));
    Vector6::from_iterator(by_shift.iter().chain(&by_turn).copied())
}

/// The twist X, about the origin in world axes, of `M(w) = exp(X) M(w₀)` for the second node's pose M, to second order in
/// w − w₀.
fn twist<D, T, const F: usize>(density: &D, loaded: &Loaded<'_, F>, ends: &[[T; F]; 2]) -> [T; 6]
where
    D: Density<F>,
    T: DualNum<Primitive = f64> + Copy,
{
    let [first, second] = loaded.poses;
    let motion = motion(density, loaded.element, ends);
    let sum = |terms: [T; 3]| terms[0] + terms[1] + terms[2];
    let world = |column: &dyn Fn(usize) -> T| -> Triple<T> {
        std::array::from_fn(|i| sum(std::array::from_fn(|k| column(k) * first.frame[(i, k)])))
    };
    let columns: [Triple<T>; 3] = std::array::from_fn(|j| world(&|k| motion.frame[k][j]));
    let position = world(&|k| motion.position[k]);
    let position: Triple<T> = std::array::from_fn(|i| position[i] + first.position[i]);
    // R(w) R(w₀)ᵀ, of which the skew part is the rotation vector to second order.
    let turned = |i: usize, j: usize| {
        sum(std::array::from_fn(|k| {
            columns[k][i] * second.frame[(j, k)]
        }))
    };
    let turn = [(2, 1), (0, 2), (1, 0)].map(|(i, j)| (turned(i, j) - turned(j, i)) * 0.5);
    let shift: Triple<T> = std::array::from_fn(|i| {
        position[i] - sum(std::array::from_fn(|j| turned(i, j) * second.position[j]))
    });
    let back = cross(turn, shift);
    std::array::from_fn(|i| match i {
        0..3 => shift[i] - back[i] * 0.5,
        _ => turn[i - 3],
    })
}

/// The motion along an element: the exponential of its fourth-order Magnus step.
fn motion<D, T, const F: usize>(density: &D, element: &Element, ends: &[[T; F]; 2]) -> Motion<T>
where
    D: Density<F>,
    T: DualNum<Primitive = f64> + Copy,
{
    let h = element.length;
    let weight = 3f64.sqrt() / 12.0 * h * h;
    let [a, b] = gauss_points().map(|t| {
        let fields = density.section(element, *ends, t).fields;
        let [torsion, bend] = density.torsion_and_bend(&fields);
        [T::from(element.geodesic), torsion, bend]
    });
    let commutator = cross(a, b);
    let phi: Triple<T> =
        std::array::from_fn(|i| (a[i] + b[i]) * (0.5 * h) + commutator[i] * weight);
    // Commutator of the rates with the translation along η.
    let rise = b[2] - a[2];
    let along = rise * rise * (-SHORTENING * h * h * h) + h;
    let rho = [rise * weight, along, (a[0] - b[0]) * weight];
    let square = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2];
    let [sine, cosine, cubic] = [0, 1, 2].map(|order| even_series(square, order));
    let once = cross(phi, rho);
    let twice = cross(phi, once);
    let cross_matrix = [
        [T::zero(), -phi[2], phi[1]],
        [phi[2], T::zero(), -phi[0]],
        [-phi[1], phi[0], T::zero()],
    ];
    let frame = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let unit = if i == j {
                T::one() - cosine * square
            } else {
                T::zero()
            };
            unit + sine * cross_matrix[i][j] + cosine * phi[i] * phi[j]
        })
    });
    Motion {
        frame,
        position: std::array::from_fn(|i| rho[i] + cosine * once[i] + cubic * twice[i]),
    }
}

/// Σ (−θ²)ⁿ/(2n + 1 + order)!: sin θ/θ, (1 − cos θ)/θ² and (θ − sin θ)/θ³, by θ². Exact for elements that turn by up to π.
fn even_series<T: DualNum<Primitive = f64> + Copy>(square: T, order: u32) -> T {
    /// Terms of the series, a number.
    const TERMS: u32 = 16;
    let mut factorial: f64 = (1..=order + 1).map(f64::from).product();
    let mut coefficients = [0.0; TERMS as usize];
    for (n, coefficient) in (0..TERMS).zip(&mut coefficients) {
        *coefficient = if n % 2 == 0 { 1.0 } else { -1.0 } / factorial;
        let next = 2 * n + 2 + order;
        factorial *= f64::from(next) * f64::from(next + 1);
    }
    coefficients
        .iter()
        .rev()
        .fold(T::zero(), |sum, coefficient| sum * square + *coefficient)
}

fn cross<T: DualNum<Primitive = f64> + Copy>(a: Triple<T>, b: Triple<T>) -> Triple<T> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
