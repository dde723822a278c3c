//! The layers along the free edges of a bent strip, in which its cross-section curls until no moment acts across the edge.
//!
//! Under the bend k the strip rests across its width on an elastic foundation of the stiffness E h k². The number of the
//! layers is `z = λ⁴ = E h k² V⁴/(4 D)`: far below 1 they fill the width, far above they are as wide as √(h/k).

use super::wide::Wide;
use num_dual::DualNum;

/// z below which the power series is taken, dimensionless; it converges up to 3600.
const SERIES: f64 = 64.0;
/// Terms of the power series, a number.
const TERMS: usize = 12;
/// Coefficients of Ψ by powers of z.
const PSI: [f64; TERMS] = psi_series();

/// Ψ: the share by which the edge layers relieve the energy `D V F²/2` of a uniform moment F across the strip.
///
/// `Ψ = 1 − (1−Φ) C/(C − 1 + Φ)` with `C = z/180`, where `Φ = (2/λ) (cosh λ − cos λ)/(sinh λ + sin λ)` is the share that a
/// layer relieves of a cross-section that is not free to curl. It is the one function that makes the least energy over a
/// uniform bend across the strip that of Audoly and Neukirch, A one-dimensional model for elastic ribbons, 2021.
pub(crate) fn psi<T: DualNum<Primitive = f64> + Copy>(z: T) -> T {
    if z.re() < SERIES {
        let terms = PSI.iter().rev();
        return terms.fold(T::zero(), |sum, coefficient| sum * z + *coefficient);
    }
    let (phi, c) = (phi(z), z / 180.0);
    (phi - 1.0) * c / (phi + c - 1.0) + 1.0
}

/// Φ, of z well above 0.
fn phi<T: DualNum<Primitive = f64> + Copy>(z: T) -> T {
    let lambda = z.sqrt().sqrt();
    let decay = (-lambda).exp();
    let square = decay * decay;
    let above = square - decay * lambda.cos() * 2.0 + 1.0;
    let below = -square + decay * lambda.sin() * 2.0 + 1.0;
    above / (lambda * below) * 2.0
}

/// Ψ of every lane with its first and second derivative.
#[inline(always)]
pub(super) fn psi_jet(z: Wide) -> [Wide; 3] {
    let narrow = series_jet(z.at_most(SERIES));
    let wide = layers_jet(z.at_least(SERIES));
    let mut jet = [Wide::ZERO; 3];
    for (i, jet) in jet.iter_mut().enumerate() {
        *jet = Wide::where_below(z, SERIES, narrow[i], wide[i]);
    }
    jet
}

/// The power series of Ψ with its first and second derivative.
#[inline(always)]
fn series_jet(z: Wide) -> [Wide; 3] {
    let (mut value, mut first, mut half) = (Wide::ZERO, Wide::ZERO, Wide::ZERO);
    for coefficient in PSI.iter().rev() {
        half = half * z + first;
        first = first * z + value;
        value = value * z + *coefficient;
    }
    [value, first, half * 2.0]
}

/// Ψ with its first and second derivative by Φ and C.
#[inline(always)]
fn layers_jet(z: Wide) -> [Wide; 3] {
    /// C per z.
    const RATE: f64 = 1.0 / 180.0;
    let [phi, phi_1, phi_2] = phi_jet(z);
    let c = z * RATE;
    // Ψ as a quotient.
    let above = [
        (c + 1.0) * phi - 1.0,
        phi * RATE + (c + 1.0) * phi_1,
        phi_1 * (2.0 * RATE) + (c + 1.0) * phi_2,
    ];
    let below = [c + phi - 1.0, phi_1 + RATE, phi_2];
    quotient_jet(&above, &below)
}

/// A quotient with its first and second derivative, from those of two functions.
#[inline(always)]
fn quotient_jet(above: &[Wide; 3], below: &[Wide; 3]) -> [Wide; 3] {
    let per = below[0].recip();
    let value = above[0] * per;
    let first = (above[1] - value * below[1]) * per;
    let second = (above[2] - first * below[1] * 2.0 - value * below[2]) * per;
    [value, first, second]
}

/// Φ with its first and second derivative by z.
#[inline(always)]
fn phi_jet(z: Wide) -> [Wide; 3] {
    let lambda = z.sqrt().sqrt();
    let [c, s] = decaying(z);
    let square = c * c + s * s;
    let ratio = quotient_jet(
        &[
            square - c * 2.0 + 1.0,
            (c + s - square) * 2.0,
            (square - s) * 4.0,
        ],
        &[
            s * 2.0 - square + 1.0,
            (square + c - s) * 2.0,
            -(square + c) * 4.0,
        ],
    );
    // By λ, then by z: λ' = λ/(4 z).
    let per = lambda.recip() * 2.0;
    let phi = ratio[0] * per;
    let first = (ratio[1] - phi * 0.5) * per;
    let second = (ratio[2] - first) * per;
    let rate = lambda * z.recip() * 0.25;
    [
        phi,
        first * rate,
        rate * (second * rate - first * z.recip() * 0.75),
    ]
}

/// `e^(−λ) cos λ` and `e^(−λ) sin λ`, of `z = λ⁴`: a power of the exponential function of a small part of `(i − 1) λ`.
#[inline(always)]
fn decaying(z: Wide) -> [Wide; 2] {
    /// Squares that make the power, a number.
    const SQUARES: i32 = 6;
    /// Greatest λ whose layers are not rounding beside 1, dimensionless.
    const DEEP: f64 = 40.0;
    /// The parts that λ is cut into, a number.
    const PARTS: f64 = (1 << SQUARES) as f64;
    let part = z.at_most(DEEP * DEEP * DEEP * DEEP).sqrt().sqrt() * (1.0 / PARTS);
    let square = part * part;
    let fourth = -(square * square * 4.0);
    // Terms of the exponential series by the rest of their powers after division by 4: the fourth power of the argument is
    // real.
    let mut sums = [Wide::ZERO; 4];
    for (rest, sum) in sums.iter_mut().enumerate() {
        for factorials in FACTORIALS.iter().rev() {
            *sum = *sum * fourth + factorials[rest];
        }
    }
    let [none, one, two, three] = sums;
    let (one, three) = (part * one, part * square * three * 2.0);
    let mut cosine = none - one + three;
    let mut sine = one - square * two * 2.0 + three;
    for _ in 0..SQUARES {
        let both = cosine * sine;
        cosine = cosine * cosine - sine * sine;
        sine = both * 2.0;
    }
    [cosine, sine]
}

/// Inverse factorials from 0! to 19!, four in a row.
const FACTORIALS: [[f64; 4]; 5] = {
    let (mut rows, mut inverse, mut n) = ([[0.0; 4]; 5], 1.0, 0);
    while n < 20 {
        rows[n / 4][n % 4] = inverse;
        n += 1;
        inverse /= n as f64;
    }
    rows
};

/// Coefficients of Ψ from those of its hyperbolic and circular functions.
const fn psi_series() -> [f64; TERMS] {
    const MORE: usize = TERMS + 2;
    let (mut above, mut below) = ([0.0; MORE], [0.0; MORE]);
    // (cosh λ − cos λ)/λ² and (sinh λ + sin λ)/(2 λ), by powers of λ⁴.
    let (mut factorial, mut j) = (1.0, 0);
    while j < MORE {
        let n = 4.0 * j as f64;
        below[j] = 1.0 / factorial;
        above[j] = 2.0 / (factorial * (n + 2.0));
        factorial *= (n + 2.0) * (n + 3.0) * (n + 4.0) * (n + 5.0);
        j += 1;
    }
    let phi = quotient(&above, &below);
    let (mut loss, mut gain) = ([0.0; TERMS], [0.0; TERMS]);
    let mut i = 0;
    while i < TERMS {
        loss[i] = -phi[i + 1] / 180.0;
        gain[i] = phi[i + 2];
        i += 1;
    }
    let mut psi = quotient(&loss, &gain);
    let mut i = 0;
    while i < TERMS {
        psi[i] = -psi[i];
        i += 1;
    }
    psi[0] += 1.0;
    psi
}

/// Coefficients of the quotient of two power series.
const fn quotient<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    let mut out = [0.0; N];
    let mut i = 0;
    while i < N {
        let mut rest = a[i];
        let mut j = 0;
        while j < i {
            rest -= out[j] * b[i - j];
            j += 1;
        }
        out[i] = rest / b[0];
        i += 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use num_dual::second_derivative;

    /// z, then Ψ and its first and second derivative: an independent implementation's, to the digits it prints.
    const REFERENCES: [[f64; 4]; 11] = [
        [0.0, 0.3, -3.69075369075e-05, 1.89610603706e-08],
        [1.0, 0.299963101941, -3.68885835985e-05, 1.89455604602e-08],
        [5.0, 0.299815699006, -3.68129251064e-05, 1.88837309076e-08],
        [
            7.999999,
            0.299705345175,
            -3.67563432619e-05,
            1.88375366985e-08,
        ],
        [
            8.000001,
            0.299705345101,
            -3.6756343224e-05,
            1.88375371413e-08,
        ],
        [20.0, 0.299265620909, -3.65313948018e-05, 1.86542718356e-08],
        [100.0, 0.296401536034, -3.50862251072e-05, 1.74917384039e-08],
        [
            1000.0,
            0.270545504899,
            -2.35919756638e-05,
            9.22929696885e-09,
        ],
        [
            10000.0,
            0.188337546647,
            -3.96706585863e-06,
            4.31962444564e-10,
        ],
        [
            100000.0,
            0.111048115297,
            -2.678472909e-07,
            3.25874495949e-12,
        ],
        [
            1000000.0,
            0.0630875749649,
            -1.56587168689e-08,
            1.94654186831e-14,
        ],
    ];

    #[test]
    fn test_psi_and_its_derivatives_are_those_of_an_independent_implementation() {
        for [z, value, first, second] in REFERENCES {
            let found = second_derivative(psi, z);
            assert_relative_eq!(found.0, value, max_relative = 1e-11);
            assert_relative_eq!(found.1, first, max_relative = 1e-10);
            assert_relative_eq!(found.2, second, max_relative = 1e-7);
        }
    }

    #[test]
    fn test_derivatives_in_lanes_are_those_of_the_definition() {
        // 1e-6 to 1e12, and 0.
        let numbers = (0..=1800).map(|i| 10f64.powf(0.01 * f64::from(i) - 6.0));
        for z in numbers.chain([0.0, 63.999_999, 64.000_001]) {
            let [value, first, second] = psi_jet(Wide::all(z)).map(|lanes| lanes.0[0]);
            let found = second_derivative(psi, z);
            assert_relative_eq!(value, found.0, max_relative = 1e-12);
            assert_relative_eq!(first, found.1, max_relative = 1e-11);
            assert_relative_eq!(second, found.2, max_relative = 1e-9);
        }
    }

    #[test]
    fn test_lanes_do_not_mix_narrow_and_wide_layers() {
        let z = [0.0, 1e12, 63.0, 65.0, 1.0, 1e3, 2e4, 1e6];
        let mixed = psi_jet(Wide(z));
        for (lane, z) in z.into_iter().enumerate() {
            let alone = psi_jet(Wide::all(z));
            for (mixed, alone) in mixed.iter().zip(alone) {
                assert_eq!(mixed.0[lane], alone.0[lane]);
            }
        }
    }

    #[test]
    fn test_psi_of_wide_strips_is_the_share_of_two_layers() {
        for z in [1e8, 1e10, 1e12] {
            let share = 2.0 / z.powf(0.25);
            assert_relative_eq!(psi(z), share, max_relative = 200.0 / z.sqrt());
        }
    }
}
