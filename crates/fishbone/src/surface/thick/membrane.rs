//! The strain of the board's middle plane that its Gauss curvature asks for.
//!
//! Airy's function χ with `∇⁴χ = −K`, and χ = χ_v = 0 at the free edges: `χ_vv`, `χ_uu` and `−χ_uv` are the forces over E h.
//! It is a sum of cosines along u times `(1−t²)²` and Legendre polynomials across. On an arc u and v count as straight.

use super::rows::{ROWS, Rows};
use nalgebra::{DMatrix, SMatrix, SVector};
use std::f64::consts::PI;

/// Functions across the width, a number.
const TERMS: usize = 16;
/// Length beside a part of a long board on which it is felt, in half widths.
const BESIDE: f64 = 4.0;
/// Length of a part with what is beside it, over the length beside it on one end, a number.
const PART: usize = 7;

/// Second derivatives of Airy's function, by cells and rows.
pub(super) struct Airy {
    pub(super) uu: DMatrix<f64>,
    pub(super) uv: DMatrix<f64>,
    pub(super) vv: DMatrix<f64>,
}

/// Airy's function of the Gauss curvature by cells and rows.
///
/// A long board is taken in parts, and so much beside each that their ends are not felt: what is cut off decays as
/// `e^{−4.2 u/V}`.
pub(super) fn airy(gauss: &DMatrix<f64>, cell: f64, half_width: f64, rows: &Rows) -> Airy {
    let beside = (BESIDE * half_width / cell).ceil() as usize;
    let count = gauss.nrows();
    let window = count.min(PART * beside);
    let solver = Solver {
        waves: Waves::new(window, cell),
        shapes: Shapes::new(rows, half_width),
    };
    let mut airy = Airy {
        uu: DMatrix::zeros(count, ROWS),
        uv: DMatrix::zeros(count, ROWS),
        vv: DMatrix::zeros(count, ROWS),
    };
    let mut done = 0;
    while done < count {
        let first = done.saturating_sub(beside).min(count - window);
        let until = if first + window == count {
            count
        } else {
            first + window - beside
        };
        let part = solver.airy(&gauss.rows(first, window).into_owned());
        let copy = |from: &DMatrix<f64>, into: &mut DMatrix<f64>| {
            let found = from.rows(done - first, until - done);
            into.rows_mut(done, until - done).copy_from(&found);
        };
        copy(&part.uu, &mut airy.uu);
        copy(&part.uv, &mut airy.uv);
        copy(&part.vv, &mut airy.vv);
        done = until;
    }
    airy
}

/// The sums of cosines and functions across of a board of so many cells.
struct Solver {
    waves: Waves,
    shapes: Shapes,
}

impl Solver {
    fn airy(&self, gauss: &DMatrix<f64>) -> Airy {
        let [value, rate, second] = &self.shapes.at_rows;
        let loads = self.waves.cosines.tr_mul(&(gauss * &self.shapes.weighted));
        let coefficients = self.waves.coefficients(&loads, &self.shapes);
        let times = |power: i32| {
            let mut scaled = coefficients.clone();
            for (mut row, wave) in scaled.row_iter_mut().zip(&self.waves.numbers) {
                row *= -wave.powi(power);
            }
            scaled
        };
        Airy {
            uu: &self.waves.cosines * times(2) * value,
            uv: &self.waves.sines * times(1) * rate,
            vv: &self.waves.cosines * &coefficients * second,
        }
    }
}

/// The functions across the width.
struct Shapes {
    /// Values at the rows, and first and second derivatives by v. Shapes: functions by rows.
    at_rows: [DMatrix<f64>; 3],
    /// Integrals over v of products of two functions, of two first and of two second derivatives.
    products: [SMatrix<f64, TERMS, TERMS>; 3],
    /// The operator that integrates products with the functions over v. Shapes: rows by functions.
    weighted: DMatrix<f64>,
}

impl Shapes {
    fn new(rows: &Rows, half_width: f64) -> Self {
        let columns = rows.t.map(shapes);
        let at_rows = [0, 1, 2].map(|order| {
            let scale = half_width.powi(-(order as i32));
            DMatrix::from_fn(TERMS, ROWS, |j, row| scale * columns[row][order][j])
        });
        let products = [0, 1, 2].map(|order| {
            let terms = (0..ROWS).map(|row| {
                let column = SVector::from(columns[row][order]);
                column * column.transpose() * rows.weight[row]
            });
            terms.sum::<SMatrix<_, _, _>>() * half_width.powi(1 - 2 * order as i32)
        });
        let weighted = DMatrix::from_fn(ROWS, TERMS, |row, j| {
            half_width * rows.weight[row] * columns[row][0][j]
        });
        Self {
            at_rows,
            products,
            weighted,
        }
    }
}

/// The functions (1−t²)² P_j(t) at a place: values, first and second derivatives by t.
fn shapes(t: f64) -> [[f64; TERMS]; 3] {
    let [mut p, mut rate, mut second] = [[0.0; TERMS]; 3];
    (p[0], p[1], rate[1]) = (1.0, t, 1.0);
    for n in 1..TERMS - 1 {
        let m = n as f64;
        let odd = 2.0 * m + 1.0;
        p[n + 1] = (odd * t * p[n] - m * p[n - 1]) / (m + 1.0);
        rate[n + 1] = rate[n - 1] + odd * p[n];
        second[n + 1] = second[n - 1] + odd * rate[n];
    }
    let inside = 1.0 - t * t;
    let [w, w1, w2] = [inside * inside, -4.0 * t * inside, 12.0 * t * t - 4.0];
    [
        std::array::from_fn(|j| w * p[j]),
        std::array::from_fn(|j| w1 * p[j] + w * rate[j]),
        std::array::from_fn(|j| w2 * p[j] + 2.0 * w1 * rate[j] + w * second[j]),
    ]
}

/// The cosines along the board, half as many as cells.
struct Waves {
    /// Wave numbers.
    numbers: Vec<f64>,
    /// Cosines at the middles of the cells. Shapes: cells by waves.
    cosines: DMatrix<f64>,
    /// Sines at the middles of the cells.
    sines: DMatrix<f64>,
}

impl Waves {
    fn new(cells: usize, cell: f64) -> Self {
        let (round, waves) = (4 * cells, cells.div_ceil(2));
        let table: Vec<f64> = (0..round)
            .map(|k| (2.0 * PI * k as f64 / round as f64).cos())
            .collect();
        let wave = |i: usize, n: usize, behind: usize| table[(n * (2 * i + 1) + behind) % round];
        let length = cells as f64 * cell;
        Self {
            numbers: (0..waves).map(|n| PI * n as f64 / length).collect(),
            cosines: DMatrix::from_fn(cells, waves, |i, n| wave(i, n, 0)),
            sines: DMatrix::from_fn(cells, waves, |i, n| wave(i, n, 3 * cells)),
        }
    }

    /// Coefficients of Airy's function from the sums over cells of Gauss curvature times cosine and function across. Shapes:
    /// waves by functions.
    fn coefficients(&self, loads: &DMatrix<f64>, shapes: &Shapes) -> DMatrix<f64> {
        let cells = self.cosines.nrows() as f64;
        let mut coefficients = DMatrix::zeros(self.numbers.len(), TERMS);
        for (n, wave) in self.numbers.iter().enumerate() {
            let mean = if n == 0 { 1.0 / cells } else { 2.0 / cells };
            let load = SVector::<f64, TERMS>::from_fn(|j, _| -mean * loads[(n, j)]);
            let [value, rate, second] = &shapes.products;
            let square = wave * wave;
            let matrix = second + rate * (2.0 * square) + value * (square * square);
            let factor = matrix.cholesky().expect("the energy of forces is positive");
            coefficients.set_row(n, &factor.solve(&load).transpose());
        }
        coefficients
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn test_uniform_gauss_curvature_stretches_by_the_known_energy() {
        // ½ E h ∫ e² dv = E h V⁵ K²/1440, and e is K (V²/24 − v²/2).
        let (rows, half_width, gauss) = (Rows::new(), 0.05, 7.0);
        let found = airy(&DMatrix::repeat(30, ROWS, gauss), 0.01, half_width, &rows);
        let squares = (0..ROWS).map(|row| rows.weight[row] * found.vv[(11, row)].powi(2));
        let energy = 0.5 * half_width * squares.sum::<f64>();
        let width = 2.0 * half_width;
        assert_relative_eq!(
            energy,
            width.powi(5) * gauss * gauss / 1440.0,
            max_relative = 1e-10
        );
        for row in 0..ROWS {
            let v = half_width * rows.t[row];
            let strain = gauss * (width * width / 24.0 - 0.5 * v * v);
            assert_relative_eq!(found.vv[(5, row)], strain, epsilon = 1e-10);
            assert!(found.uu[(5, row)].abs() < 1e-10 && found.uv[(5, row)].abs() < 1e-10);
        }
    }

    #[test]
    fn test_parts_of_a_long_board_are_those_of_the_whole() {
        let (rows, a, cell, count) = (Rows::new(), 0.05, 0.01, 300);
        let gauss = DMatrix::from_fn(count, ROWS, |i, row| {
            (0.07 * i as f64).sin() + rows.t[row] * (0.31 * i as f64).cos()
        });
        let in_parts = airy(&gauss, cell, a, &rows);
        let solver = Solver {
            waves: Waves::new(count, cell),
            shapes: Shapes::new(&rows, a),
        };
        let whole = solver.airy(&gauss);
        let scale = whole.vv.amax();
        assert!((in_parts.uu - whole.uu).amax() < 1e-3 * scale);
        assert!((in_parts.uv - whole.uv).amax() < 1e-3 * scale);
        assert!((in_parts.vv - whole.vv).amax() < 1e-3 * scale);
    }

    #[test]
    fn test_a_wave_of_airys_function_is_found_from_its_gauss_curvature() {
        // χ = cos(αu) (1−t²)² has ∇⁴χ = cos(αu) (24/a⁴ − 2 α² (12t²−4)/a² + α⁴ (1−t²)²).
        let (rows, a, cells, cell) = (Rows::new(), 0.05f64, 60, 0.01);
        let wave = 6.0 * PI / (cells as f64 * cell);
        let phase = |i: usize| wave * (i as f64 + 0.5) * cell;
        let gauss = DMatrix::from_fn(cells, ROWS, |i, row| {
            let t = rows.t[row];
            let inside = (1.0 - t * t).powi(2);
            let second = (12.0 * t * t - 4.0) / a.powi(2);
            -phase(i).cos()
                * (24.0 / a.powi(4) - 2.0 * wave * wave * second + wave.powi(4) * inside)
        });
        let found = airy(&gauss, cell, a, &rows);
        for (i, row) in [(3, 0), (17, 8), (31, 20), (44, 33)] {
            let t = rows.t[row];
            let [value, rate, second] = shapes(t).map(|order| order[0]);
            let (sine, cosine) = phase(i).sin_cos();
            assert_relative_eq!(
                found.uu[(i, row)],
                -wave * wave * cosine * value,
                epsilon = 1e-7
            );
            assert_relative_eq!(found.uv[(i, row)], -wave * sine * rate / a, epsilon = 1e-7);
            assert_relative_eq!(
                found.vv[(i, row)],
                cosine * second / (a * a),
                epsilon = 1e-7
            );
        }
    }
}
