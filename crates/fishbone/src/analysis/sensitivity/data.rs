//! The data of an element, and the derivatives of its energy and its bounds by them.

use crate::strip::bounds::ActiveEdges;
use crate::strip::density::Density;
use crate::strip::element::{Curl, Element, Stock};
use nalgebra::{SMatrix, SVector, Vector1, Vector4, Vector6};
use num_dual::{Dual64, HyperDualSVec64, first_derivative, partial_hessian};

/// Data of an element: R_f at its two Gauss points, its natural bend, half its width, its stretching stiffness over the
/// plate's rigidity, and its Poisson's ratio.
pub(super) type Data = Vector6<f64>;
/// Place of the natural bend in [`Data`], an index; it is the first of what the element is made of.
pub(super) const NATURAL_BEND: usize = 2;
/// Place of the half width in [`Data`], an index.
pub(super) const HALF_WIDTH: usize = 3;
/// Place of the stretching stiffness in [`Data`], an index.
pub(super) const STRETCHING: usize = 4;
/// Place of Poisson's ratio in [`Data`], an index.
pub(super) const POISSON: usize = 5;

/// Second derivatives by the fields at one end of an element and by its data.
type Mixed<const F: usize> = SMatrix<f64, F, 6>;

/// Derivatives of an element's part of the Lagrangian by its data.
#[derive(Debug, Clone)]
pub(super) struct ByData<const F: usize> {
    /// First derivatives.
    pub(super) first: Data,
    /// Second derivatives, by the fields at either end and by the data.
    pub(super) mixed: [Mixed<F>; 2],
    /// Derivatives of the slacks by half the width.
    pub(super) slacks: Vec<f64>,
}

/// An element whose energy and bounds are differentiated at given fields at both ends.
#[derive(Clone, Copy)]
struct At<'a, D, const F: usize> {
    density: &'a D,
    element: &'a Element,
    edges: &'a ActiveEdges,
    fields: [[f64; F]; 2],
}

impl<const F: usize> ByData<F> {
    /// The derivatives at given fields and multipliers of the inequalities.
    pub(super) fn at<D: Density<F>>(
        density: &D,
        element: &Element,
        edges: &ActiveEdges,
        fields: [&SVector<f64, F>; 2],
        multipliers: &[f64],
    ) -> Self {
        let at = At {
            density,
            element,
            edges,
            fields: fields.map(|end| end.data.0[0]),
        };
        let [(first, own), (_, next)] = [0, 1].map(|end| at.by_fields_of(end, multipliers));
        Self {
            first,
            mixed: [own, next],
            slacks: (0..multipliers.len())
                .map(|i| at.slack_by_width(i))
                .collect(),
        }
    }
}

impl<D: Density<F>, const F: usize> At<'_, D, F> {
    /// First derivatives by the data, and second derivatives by the fields at one end and the data.
    fn by_fields_of(&self, end: usize, multipliers: &[f64]) -> (Data, Mixed<F>) {
        let (mut first, mut mixed) = (Data::zeros(), Mixed::<F>::zeros());
        let element = self.element;
        for [t, weight] in self.density.places() {
            let (value, by_fields, by_stock, by_both) = self.by_stock(end, *t);
            let weight = weight * element.length;
            for (i, share) in Element::rigidity_shares(*t).into_iter().enumerate() {
                first[i] += weight * share * value;
                mixed.column_mut(i).axpy(weight * share, &by_fields, 1.0);
            }
            let weight = weight * element.rigidity_at(*t);
            let mut stock = first.fixed_rows_mut::<4>(NATURAL_BEND);
            stock += weight * by_stock;
            let mut stock = mixed.fixed_columns_mut::<4>(NATURAL_BEND);
            stock += weight * by_both;
        }
        if !multipliers.is_empty() {
            let (by_width, by_both) = self.bounds_by_width(end, multipliers);
            first[HALF_WIDTH] -= by_width;
            mixed.column_mut(HALF_WIDTH).axpy(-1.0, &by_both, 1.0);
        }
        (first, mixed)
    }

    /// The density at parameter t with its derivatives by the fields at one end, by what the element is made of, and by both.
    fn by_stock(
        &self,
        end: usize,
        t: f64,
    ) -> (f64, SVector<f64, F>, Vector4<f64>, SMatrix<f64, F, 4>) {
        let stock = self.element.stock();
        let data = Vector4::new(
            stock.curl.bend,
            stock.half_width,
            stock.stretching,
            stock.curl.poisson,
        );
        partial_hessian(
            |(own, data): (SVector<HyperDualSVec64<F, 4>, F>, SVector<_, 4>)| {
                let mut ends = self.fields.map(|end| end.map(HyperDualSVec64::from));
                ends[end] = own.into();
                let [bend, half_width, stretching, poisson] = data.into();
                let mut section = self.density.section(self.element, ends, t);
                section.stock = Stock {
                    half_width,
                    curl: Curl { bend, poisson },
                    stretching,
                };
                self.density.value(&section)
            },
            (&SVector::from(self.fields[end]), &data),
        )
    }

    /// Derivatives of the slacks, each times its multiplier, by half the width, and by this and the fields at one end.
    fn bounds_by_width(&self, end: usize, multipliers: &[f64]) -> (f64, SVector<f64, F>) {
        let (_, _, by_width, by_both) = partial_hessian(
            |(own, half): (SVector<HyperDualSVec64<F, 1>, F>, SVector<_, 1>)| {
                let mut ends = self.fields.map(|end| end.map(HyperDualSVec64::from));
                ends[end] = own.into();
                let slacks = self
                    .density
                    .slacks_of_width(self.element, self.edges, &ends, half[0]);
                let terms = slacks.into_iter().zip(multipliers);
                terms.fold(HyperDualSVec64::from(0.0), |sum, (slack, multiplier)| {
                    sum + slack * *multiplier
                })
            },
            (
                &SVector::from(self.fields[end]),
                &Vector1::new(self.element.half_width),
            ),
        );
        (by_width[0], by_both)
    }

    /// Derivative of a slack by half the width.
    fn slack_by_width(&self, slack: usize) -> f64 {
        let of_width = |half_width| {
            let ends = self.fields.map(|end| end.map(Dual64::from));
            let slacks = self
                .density
                .slacks_of_width(self.element, self.edges, &ends, half_width);
            slacks[slack]
        };
        first_derivative(of_width, self.element.half_width).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose;
    use crate::strip::bounds::{Edge, moved_out};
    use crate::strip::density::{Derivatives, Loaded};
    use crate::strip::developable::DevelopableEnergy;
    use crate::strip::shell::{Gauge, Shell};
    use nalgebra::Vector2;

    fn element() -> Element {
        Element {
            length: 0.0125,
            geodesic: 1.4,
            rigidity: [1.3, 0.7],
            half_width: 0.05,
            curl: Curl {
                bend: 2.0,
                poisson: 0.3,
            },
            stretching: f64::INFINITY,
        }
    }

    /// Energy and slacks times multipliers, and its gradient by the fields at both ends, by the kernels of a solve.
    fn lagrangian<D: Density<F>, const F: usize>(
        density: &D,
        element: &Element,
        edges: &ActiveEdges,
        fields: [&SVector<f64, F>; 2],
        multipliers: &[f64],
    ) -> (f64, [SVector<f64, F>; 2]) {
        let mut block = D::Derivatives::default();
        let (still, nothing) = (Pose::identity(), Vector6::zeros());
        let loaded = Loaded {
            element,
            fields,
            poses: [&still, &still],
            wrench: &nothing,
        };
        block.set(0, density, &loaded);
        block.find(density);
        let (mut value, mut gradient) = (density.energy(element, fields), block.gradient(0));
        let mut slacks = Vec::new();
        density.slacks(element, edges, fields, &mut slacks);
        let mut by_fields = vec![[SVector::zeros(); 2]; slacks.len()];
        let mut second = stagewise::StageMatrix::zeros();
        let rows = &mut by_fields[..];
        density.linearise_slacks(element, edges, fields, multipliers, rows, &mut second);
        for ((slack, by), multiplier) in slacks.iter().zip(&by_fields).zip(multipliers) {
            value -= multiplier * slack;
            for (gradient, by) in gradient.iter_mut().zip(by) {
                *gradient -= *multiplier * by;
            }
        }
        (value, gradient)
    }

    fn with(
        element: &Element,
        edges: &ActiveEdges,
        entry: usize,
        by: f64,
    ) -> (Element, ActiveEdges) {
        let mut other = *element;
        match entry {
            0 | 1 => other.rigidity[entry] += by,
            NATURAL_BEND => other.curl.bend += by,
            HALF_WIDTH => other.half_width += by,
            STRETCHING => other.stretching += by,
            _ => other.curl.poisson += by,
        }
        (
            other,
            moved_out(edges, other.half_width - element.half_width),
        )
    }

    /// Compares the derivatives by the data with differences, with a step for each.
    fn check<D: Density<F>, const F: usize>(
        density: &D,
        element: &Element,
        edges: &ActiveEdges,
        fields: [&SVector<f64, F>; 2],
        multipliers: &[f64],
    ) {
        let exact = ByData::at(density, element, edges, fields, multipliers);
        for entry in 0..6 {
            let h = match entry {
                STRETCHING if element.stretching.is_infinite() => continue,
                STRETCHING => 1e-6 * element.stretching,
                _ => 1e-6,
            };
            let sides = [h, -h].map(|by| with(element, edges, entry, by));
            let [above, below] = [0, 1].map(|side| {
                let (element, edges) = &sides[side];
                lagrangian(density, element, edges, fields, multipliers)
            });
            let first = (above.0 - below.0) / (2.0 * h);
            let (found, size) = (exact.first[entry], first.abs().max(1e-6 / h));
            assert!(
                (first - found).abs() < 1e-6 * size,
                "{entry}: {first} {found}"
            );
            for end in 0..2 {
                let mixed = (above.1[end] - below.1[end]) / (2.0 * h);
                let error = (mixed - exact.mixed[end].column(entry)).amax();
                let size = mixed.amax().max(1e-6 / h);
                assert!(error < 2e-6 * size, "{entry}, end {end}: {error} of {size}");
            }
        }
        let [above, below] = [1e-6, -1e-6].map(|by| {
            let (element, edges) = with(element, edges, HALF_WIDTH, by);
            let mut slacks = Vec::new();
            density.slacks(&element, &edges, fields, &mut slacks);
            slacks
        });
        assert_eq!(exact.slacks.len(), above.len());
        for ((above, below), exact) in above.iter().zip(&below).zip(&exact.slacks) {
            assert!(((above - below) / 2e-6 - exact).abs() < 1e-6);
        }
    }

    #[test]
    fn test_derivatives_by_the_data_of_a_developable_belt_agree_with_differences() {
        let arc = Edge {
            direction: Vector2::x(),
            distance: 0.05,
            curvature: 4.0,
            turn: [-0.5, 0.4],
        };
        let line = Edge::line(Vector2::new(0.8, 0.6), 0.03);
        let fields = [Vector2::new(3.0, 0.3), Vector2::new(2.5, 0.36)];
        for model in [
            DevelopableEnergy::Fishbone,
            DevelopableEnergy::Sadowsky,
            DevelopableEnergy::Wunderlich,
        ] {
            let edges = [None, Some(line), Some(arc)];
            check(
                &model,
                &element(),
                &edges,
                fields.each_ref(),
                &[0.3, 0.5, 0.7, 0.4],
            );
        }
    }

    #[test]
    fn test_derivatives_by_the_data_of_a_thick_strip_agree_with_differences() {
        let element = Element {
            length: 0.025,
            stretching: 12.0 * 0.91 / (1e-3 * 1e-3),
            ..element()
        };
        let fields = [
            SVector::from([3.0, 0.3, 2.0, 0.4, -0.8, 5.0]),
            SVector::from([2.5, 0.36, 2.5, 0.1, -0.6, 3.0]),
        ];
        let multipliers: Vec<f64> = (1..=12).map(|i| 0.1 * f64::from(i)).collect();
        let shell = Shell::new(Gauge::WEAK, 6);
        check(
            &shell,
            &element,
            &[None; 3],
            fields.each_ref(),
            &multipliers,
        );
    }
}
