//! The density at a place of the spine with its first and second derivatives, for a block of elements at once.
//!
//! The derivatives are by what the curvature along a rib depends on, [`Rib`](super::Rib): k, m, β, q, s, g and the rates of m,
//! s and g. All of the curvature's dependence on v is in three functions: the area J = 1 − s v, b(t,d) and b(t,t). So the
//! energy at a point is a function of five numbers. Most of its second derivative is a sum of squares: of the mean curvature
//! at every point, and of the modes of the strain along the strip, which are linear in the Gauss curvature of all points.

#![expect(
    clippy::needless_range_loop,
    reason = "indices of matrices, as they stand in formulas"
)]

mod point;

use super::Gauge;
use super::across::{Across, MODES, MOST};
use super::edge_layer::psi_jet;
use super::gauge::Term;
use super::wide::Wide;
use point::{Point, View};

/// Numbers that the curvature along a rib depends on.
pub(super) const INPUTS: usize = 9;

/// Places of the numbers: every field of the element beside its rates.
pub(super) const BEND: usize = 0;
pub(super) const SLOPE: usize = 1;
pub(super) const CONVERGENCE: usize = 2;
pub(super) const CONVERGENCE_RATE: usize = 3;
pub(super) const TWIST: usize = 4;
pub(super) const TWIST_RATE: usize = 5;
pub(super) const ACROSS: usize = 6;
pub(super) const GROWTH: usize = 7;
pub(super) const GROWTH_RATE: usize = 8;

/// The numbers that b(t,d) depends on.
const MIXED: [usize; 3] = [CONVERGENCE, TWIST, GROWTH];
/// The numbers that the moment of the edge layers depends on.
const LAYERS: [usize; 4] = [BEND, SLOPE, TWIST, ACROSS];
/// Greatest count of squares in the second derivative.
const SQUARES: usize = MOST + MODES;
/// Columns whose sums are found at a time: as many as registers hold.
const CHUNK: usize = 3;

/// A row of derivatives by all numbers.
type Row = [Wide; INPUTS];

/// The plates of a block.
#[derive(Debug, Clone)]
pub(super) struct Plates {
    pub(super) half_width: Wide,
    pub(super) geodesic: Wide,
    pub(super) natural: Wide,
    pub(super) poisson: Wide,
    pub(super) stretching: Wide,
}

impl Plates {
    /// Stretching stiffness times the fourth power of the half width.
    #[inline(always)]
    fn stiffness(&self) -> Wide {
        self.stretching * self.half_width.square().square()
    }
}

/// A density with its first and second derivatives.
#[derive(Debug, Clone)]
pub(super) struct Jet {
    pub(super) gradient: Row,
    /// Valid on the diagonal and right of it.
    pub(super) hessian: [Row; INPUTS],
}

impl Jet {
    pub(super) const ZERO: Self = Self {
        gradient: [Wide::ZERO; INPUTS],
        hessian: [[Wide::ZERO; INPUTS]; INPUTS],
    };

    #[inline(always)]
    pub(super) fn second(&self, i: usize, j: usize) -> Wide {
        self.hessian[i.min(j)][i.max(j)]
    }

    #[inline(always)]
    pub(super) fn add(&mut self, i: usize, j: usize, value: Wide) {
        self.hessian[i.min(j)][i.max(j)] += value;
    }

    /// Adds a row and the same column, which meet in twice their common entry.
    #[inline(always)]
    fn add_cross(&mut self, i: usize, row: &Row) {
        for (j, entry) in row.iter().enumerate() {
            self.add(i, j, *entry);
        }
        self.add(i, i, row[i]);
    }
}

/// Arrays that [`differentiate`] writes and reads.
#[derive(Debug, Clone)]
pub(super) struct Work {
    points: [Point; MOST],
    gauss: [Wide; MOST],
    /// Factors of the derivatives of b(t,t) at every point: in the gradient, and in the rows of q, β and s.
    pulls: [[Wide; 4]; MOST],
    by_gauss: [Row; MOST],
    /// Rows whose products sum up to the second derivative.
    left: [Row; SQUARES],
    right: [Row; SQUARES],
}

impl Work {
    pub(super) const EMPTY: Self = Self {
        points: [Point::NONE; MOST],
        gauss: [Wide::ZERO; MOST],
        pulls: [[Wide::ZERO; 4]; MOST],
        by_gauss: [[Wide::ZERO; INPUTS]; MOST],
        left: [[Wide::ZERO; INPUTS]; SQUARES],
        right: [[Wide::ZERO; INPUTS]; SQUARES],
    };
}

/// The strain along the strip as a sum of Legendre polynomials of norm 1, from the second degree on.
///
/// What is left of the strain without a resultant force and a moment does work by the products of these polynomials on the
/// area 1 − y t of the rib, `y = s V/2`. Multiplied by t a polynomial is a sum of its neighbours; what is linear in t moves
/// the polynomial of the second degree alone.
struct Strain {
    count: usize,
    y: Wide,
    /// What the linear part takes of the work of the second degree, with two derivatives by y.
    linear: [Wide; 3],
}

impl Strain {
    #[inline(always)]
    fn of(x: &Row, plates: &Plates, rule: &Across) -> Self {
        let y = x[CONVERGENCE] * plates.half_width;
        let y2 = y * y;
        let left = (-(y2 * (1.0 / 3.0)) + 1.0).recip();
        let factor = left * (4.0 / 15.0);
        Self {
            count: rule.points - 2,
            y,
            linear: [
                y2 * factor,
                y * factor * left * 2.0,
                (y2 + 1.0) * factor * left * left * 2.0,
            ],
        }
    }

    /// The modes of the strain, from the Gauss curvature at the points.
    #[inline(always)]
    fn modes(&self, gauss: &[Wide], rule: &Across) -> [Wide; MODES] {
        let mut modes = [Wide::ZERO; MODES];
        for (mode, factors) in modes.iter_mut().zip(&rule.modes).take(self.count) {
            let mut sum = Wide::ZERO;
            for (gauss, factor) in gauss.iter().zip(factors) {
                sum += *gauss * *factor;
            }
            *mode = sum;
        }
        modes
    }

    /// Minus the products with the rates of the areas by y; `linear` is the rate of the linear part.
    #[inline(always)]
    fn narrowed(&self, modes: &[Wide; MODES], linear: Wide, rule: &Across) -> [Wide; MODES] {
        let mut out = [Wide::ZERO; MODES];
        out[0] = linear * modes[0];
        for n in 1..self.count {
            out[n - 1] += modes[n] * rule.beside[n];
            out[n] += modes[n - 1] * rule.beside[n];
        }
        out
    }
}

/// The density of every lane at numbers x; infinite where ribs come closer than they may.
#[inline(always)]
pub(super) fn density(x: &Row, plates: &Plates, rule: &Across, gauge: Gauge) -> Wide {
    let mut gauss = [Wide::ZERO; MOST];
    let (view, strain) = (View::of(x, plates), Strain::of(x, plates, rule));
    let mut sum = Wide::ZERO;
    for i in 0..rule.points {
        let point = Point::at::<true>(x, plates, rule.t[i]);
        let [mean, _] = view.mean(&point);
        sum += view.energy(&point, mean) * point.area * (0.5 * rule.weight[i]);
        gauss[i] = point.gauss;
    }
    let modes = strain.modes(&gauss[..rule.points], rule);
    let mut work = -(strain.linear[0] * modes[0] * modes[0]);
    for n in 0..strain.count {
        work += modes[n] * modes[n];
    }
    for n in 1..strain.count {
        work -= strain.y * modes[n] * modes[n - 1] * (2.0 * rule.beside[n]);
    }
    let layers = Layers::of(x, plates);
    sum += plates.stiffness() * work * 0.25;
    sum -= layers.moment * layers.moment * layers.share[0] * 0.5;
    sum + Term::of(gauge, plates, ribs(x)).value
}

/// The density of every lane at numbers x, with its derivatives by them; `CURVED` where a board of the block is curved in its
/// plane.
#[inline(always)]
pub(super) fn differentiate<const CURVED: bool>(
    x: &Row,
    plates: &Plates,
    rule: &Across,
    gauge: Gauge,
    work: &mut Work,
    into: &mut Jet,
) {
    for i in 0..rule.points {
        let point = Point::at::<CURVED>(x, plates, rule.t[i]);
        (work.gauss[i], work.points[i]) = (point.gauss, point);
    }
    let strain = Strain::of(x, plates, rule);
    let stiffness = plates.stiffness() * 0.5;
    let modes = strain.modes(&work.gauss[..rule.points], rule);
    let linear = strain.linear;
    let (by_area, lead) = (
        strain.narrowed(&modes, linear[1], rule),
        strain.narrowed(&modes, Wide::ZERO, rule),
    );
    let mut pressed = [Wide::ZERO; MODES];
    for n in 0..strain.count {
        pressed[n] = stiffness * (modes[n] - strain.y * lead[n]);
    }
    pressed[0] -= stiffness * linear[0] * modes[0];
    *into = Jet::ZERO;
    let mut moments = Moments::ZERO;
    add_points(x, plates, rule, &pressed, work, &mut moments, into);
    add_modes(rule, &strain, stiffness, work);
    multiply(&work.left, &work.right, rule.points + strain.count, into);
    add_columns(rule.points, work, into);
    moments.add::<CURVED>(x, plates.geodesic, into);
    // The work of the strain as the area narrows.
    let narrowing = stiffness * plates.half_width;
    let mut row = [Wide::ZERO; INPUTS];
    let mut slope = Wide::ZERO;
    for n in 0..strain.count {
        let factor = -(narrowing * by_area[n]);
        slope += factor * modes[n];
        for (entry, by) in row.iter_mut().zip(&work.left[rule.points + n]) {
            *entry += factor * *by;
        }
    }
    into.gradient[CONVERGENCE] += slope * 0.5;
    into.add_cross(CONVERGENCE, &row);
    let twice = narrowing * plates.half_width * linear[2] * modes[0] * modes[0];
    into.add(CONVERGENCE, CONVERGENCE, -(twice * 0.5));
    Layers::of(x, plates).add(x, plates.poisson, into);
    let term = Term::of(gauge, plates, ribs(x));
    for (place, [first, second]) in [
        (CONVERGENCE, term.by_convergence),
        (SLOPE, term.by_slope),
        (CONVERGENCE_RATE, term.by_rate),
    ] {
        into.gradient[place] += first;
        into.add(place, place, second);
    }
}

/// Convergence, slope and the convergence's rate, on which the term of the gauge depends.
#[inline(always)]
fn ribs(x: &Row) -> [Wide; 3] {
    [x[CONVERGENCE], x[SLOPE], x[CONVERGENCE_RATE]]
}

/// Adds the points' part of the derivatives but for the derivatives of b(t,t), whose factors are kept, and for the squares of
/// the mean curvature, whose rows are.
#[inline(always)]
fn add_points(
    x: &Row,
    plates: &Plates,
    rule: &Across,
    pressed: &[Wide; MODES],
    work: &mut Work,
    moments: &mut Moments,
    into: &mut Jet,
) {
    let view = View::of(x, plates);
    let View {
        beta,
        across,
        stretch,
        shear,
        natural,
    } = view;
    let twist = beta * 2.0;
    for i in 0..rule.points {
        let point = &work.points[i];
        let mut pull = Wide::ZERO;
        for (pressed, factors) in pressed.iter().zip(&rule.modes).take(rule.points - 2) {
            pull += *pressed * factors[i];
        }
        let [mean, turned] = view.mean(point);
        let held = mean + shear * natural;
        // The energy's derivatives by b(t,t), b(t,d), q and β.
        let by = [
            mean * stretch - shear * (across - natural * beta * beta),
            twist * mean + shear * (point.mixed + natural * beta) * 2.0,
            mean - shear * (point.along - natural),
            turned * held * 2.0,
        ];
        let area = point.area * (0.5 * rule.weight[i]);
        let narrowing = point.v * (-0.5 * rule.weight[i]);
        let along = area * by[0] + pull * across;
        let mixed = area * by[1] - pull * point.mixed * 2.0;
        let lean = area * held * 2.0;
        let shared = pull - shear * area;
        work.pulls[i] = [along, shared, lean * beta, narrowing * by[0]];
        into.gradient[CONVERGENCE] += narrowing * view.energy(point, mean);
        into.gradient[ACROSS] += area * by[2] + pull * point.along;
        into.gradient[SLOPE] += area * by[3];
        into.add(CONVERGENCE, ACROSS, narrowing * by[2]);
        into.add(SLOPE, CONVERGENCE, narrowing * by[3]);
        into.add(SLOPE, SLOPE, lean * point.along);
        for a in 0..3 {
            let by_mixed = point.by_mixed[a];
            into.gradient[MIXED[a]] += mixed * by_mixed;
            into.add(SLOPE, MIXED[a], lean * by_mixed);
            let factor = if a == 0 { 2.0 } else { 1.0 };
            into.add(CONVERGENCE, MIXED[a], narrowing * by[1] * by_mixed * factor);
            let own = shared * by_mixed * -2.0;
            for b in a..3 {
                into.add(MIXED[a], MIXED[b], own * point.by_mixed[b]);
            }
        }
        moments.take(point, along, mixed);
        let mut row = point.by_along;
        for entry in &mut row {
            *entry = *entry * stretch;
        }
        for (place, by_mixed) in MIXED.into_iter().zip(point.by_mixed) {
            row[place] += twist * by_mixed;
        }
        row[ACROSS] += Wide::all(1.0);
        row[SLOPE] += turned * 2.0;
        work.left[i] = row;
        for (right, left) in work.right[i].iter_mut().zip(&row) {
            *right = area * *left;
        }
        work.by_gauss[i] = point.by_gauss(across);
    }
}

/// Sums over the points of the factors that second derivatives of b(t,t) and b(t,d) have in common.
struct Moments {
    bent: Wide,
    square: Wide,
    /// Of v²/J³, and times v.
    turned: [Wide; 2],
    /// Of v³/J⁴, and times v.
    twice_turned: [Wide; 2],
    /// By s and by s, m and g.
    by_convergence: [Wide; 3],
}

impl Moments {
    const ZERO: Self = Self {
        bent: Wide::ZERO,
        square: Wide::ZERO,
        turned: [Wide::ZERO; 2],
        twice_turned: [Wide::ZERO; 2],
        by_convergence: [Wide::ZERO; 3],
    };

    /// Takes in a point, from the energy's derivatives by b(t,t) and b(t,d) there.
    #[inline(always)]
    fn take(&mut self, point: &Point, along: Wide, mixed: Wide) {
        let turned = along * point.turned;
        let twice_turned = turned * point.reach;
        self.bent += along * point.bent;
        self.square += along * point.square;
        self.turned[0] += turned;
        self.turned[1] += turned * point.v;
        self.twice_turned[0] += twice_turned;
        self.twice_turned[1] += twice_turned * point.v;
        self.by_convergence[0] += along * point.along_twice;
        for (sum, twice) in self.by_convergence.iter_mut().zip(point.mixed_twice) {
            *sum += mixed * twice;
        }
    }

    #[inline(always)]
    fn add<const CURVED: bool>(&self, x: &Row, geodesic: Wide, into: &mut Jet) {
        let [_, beta, s, ds, m, _, _, g, _] = *x;
        let [turned, turned_away] = self.turned;
        let [twice, twice_away] = self.twice_turned;
        let [own, by_twist, by_growth] = self.by_convergence;
        into.add(BEND, CONVERGENCE, self.bent);
        into.add(CONVERGENCE, CONVERGENCE, own);
        into.add(CONVERGENCE, TWIST_RATE, turned * 2.0);
        into.add(CONVERGENCE, GROWTH_RATE, turned_away);
        into.add(TWIST, CONVERGENCE_RATE, turned);
        into.add(GROWTH, CONVERGENCE_RATE, turned_away * 0.5);
        into.add(CONVERGENCE, TWIST, by_twist + ds * twice * 3.0);
        into.add(CONVERGENCE, GROWTH, by_growth + ds * twice_away * 1.5);
        let by_rate = m * twice * 3.0 + g * twice_away * 1.5;
        into.add(CONVERGENCE, CONVERGENCE_RATE, by_rate);
        if CURVED {
            let (turned, twice) = (geodesic * turned, geodesic * twice * 3.0);
            let wound = g * 0.5 + s * m;
            into.add(ACROSS, CONVERGENCE, -(geodesic * self.square));
            into.add(CONVERGENCE, TWIST, beta * (twice * s + turned));
            into.add(CONVERGENCE, GROWTH, twice * beta * 0.5);
            into.add(SLOPE, CONVERGENCE, twice * wound + turned * m);
            into.add(SLOPE, TWIST, turned * s);
            into.add(SLOPE, GROWTH, turned * 0.5);
        }
    }
}

/// Finds the rows of the modes of the strain, and their products with the areas between the modes.
#[inline(always)]
fn add_modes(rule: &Across, strain: &Strain, stiffness: Wide, work: &mut Work) {
    let (points, count) = (rule.points, strain.count);
    for n in 0..count {
        for from in (0..INPUTS).step_by(CHUNK) {
            let mut sums = [Wide::ZERO; CHUNK];
            for (by, factor) in work.by_gauss[..points].iter().zip(&rule.modes[n]) {
                for j in 0..CHUNK {
                    sums[j] += by[from + j] * *factor;
                }
            }
            work.left[points + n][from..from + CHUNK].copy_from_slice(&sums);
        }
    }
    let press = stiffness * strain.y;
    for n in 0..count {
        let mut own = stiffness;
        if n == 0 {
            own -= stiffness * strain.linear[0];
        }
        for j in 0..INPUTS {
            let mut sum = own * work.left[points + n][j];
            if n > 0 {
                sum -= press * work.left[points + n - 1][j] * rule.beside[n];
            }
            if n + 1 < count {
                sum -= press * work.left[points + n + 1][j] * rule.beside[n + 1];
            }
            work.right[points + n][j] = sum;
        }
    }
}

/// Adds the sum of the products of rows to the second derivative.
#[inline(always)]
fn multiply(left: &[Row; SQUARES], right: &[Row; SQUARES], count: usize, into: &mut Jet) {
    for i in 0..INPUTS {
        for from in (i / CHUNK * CHUNK..INPUTS).step_by(CHUNK) {
            let mut sums = [Wide::ZERO; CHUNK];
            for (left, right) in left[..count].iter().zip(right) {
                for j in 0..CHUNK {
                    sums[j] += left[i] * right[from + j];
                }
            }
            for j in 0..CHUNK {
                into.hessian[i][from + j] += sums[j];
            }
        }
    }
}

/// Adds the derivatives of b(t,t) at all points, each times its factors, to the gradient and to the rows of q, β and s.
#[inline(always)]
fn add_columns(points: usize, work: &Work, into: &mut Jet) {
    let mut rows = [[Wide::ZERO; INPUTS]; 3];
    for n in 0..INPUTS {
        let mut sums = [Wide::ZERO; 4];
        for (point, pulls) in work.points[..points].iter().zip(&work.pulls) {
            for (sum, pull) in sums.iter_mut().zip(pulls) {
                *sum += point.by_along[n] * *pull;
            }
        }
        into.gradient[n] += sums[0];
        for (row, sum) in rows.iter_mut().zip(&sums[1..]) {
            row[n] = *sum;
        }
    }
    into.add_cross(ACROSS, &rows[0]);
    into.add_cross(SLOPE, &rows[1]);
    into.add_cross(CONVERGENCE, &rows[2]);
}

/// What the layers along the free edges relieve: half of the moment's square times a share.
struct Layers {
    moment: Wide,
    /// The share, with two derivatives by k.
    share: [Wide; 3],
}

impl Layers {
    #[inline(always)]
    fn of(x: &Row, plates: &Plates) -> Self {
        let (k, beta, m, q) = (x[BEND], x[SLOPE], x[TWIST], x[ACROSS]);
        let scale = plates.stiffness() * 4.0;
        let [share, first, second] = psi_jet(scale * k * k);
        let rate = scale * k * 2.0;
        let poisson = plates.poisson;
        Self {
            moment: (beta * beta + poisson) * k + beta * m * 2.0 + q - poisson * plates.natural,
            share: [
                share,
                first * rate,
                second * rate * rate + first * scale * 2.0,
            ],
        }
    }

    #[inline(always)]
    fn add(&self, x: &Row, poisson: Wide, into: &mut Jet) {
        let (k, beta, m) = (x[BEND], x[SLOPE], x[TWIST]);
        let Self { moment, share } = self;
        let held = *moment * share[0];
        let by = [
            beta * beta + poisson,
            (beta * k + m) * 2.0,
            beta * 2.0,
            Wide::all(1.0),
        ];
        let by_bend = *moment * share[1];
        let half = *moment * *moment * 0.5;
        into.gradient[BEND] -= half * share[1];
        into.add(BEND, BEND, -(by_bend * by[0] + half * share[2]));
        for a in 0..LAYERS.len() {
            into.gradient[LAYERS[a]] -= held * by[a];
            into.add(BEND, LAYERS[a], -(by_bend * by[a]));
            let own = by[a] * share[0];
            for b in a..LAYERS.len() {
                into.add(LAYERS[a], LAYERS[b], -(own * by[b]));
            }
        }
        into.add(BEND, SLOPE, -(held * beta * 2.0));
        into.add(TWIST, SLOPE, -(held * 2.0));
        into.add(SLOPE, SLOPE, -(held * k * 2.0));
    }
}
