//! The data of an element, and the derivatives of its energy and its bounds by them.

use crate::geometry::gauss_points;
use crate::strip::bounds::{ActiveEdges, Edge, RibBounds};
use crate::strip::developable::DevelopableEnergy;
use crate::strip::element::Curl;
use crate::strip::element::Element;
use crate::strip::ribs::{Across, Strips};
use nalgebra::{Matrix4, SVector, Vector2, Vector4};
use num_dual::{DualNum, HyperDualSVec64, partial_hessian};

/// Data of an element: R_f at its two Gauss points, its natural bend, and half its width.
pub(super) type Data = Vector4<f64>;
/// Place of the natural bend in [`Data`], an index.
pub(super) const NATURAL_BEND: usize = 2;
/// Place of the half width in [`Data`], an index.
pub(super) const HALF_WIDTH: usize = 3;

/// Derivatives of an element's part of the Lagrangian by its data.
#[derive(Debug, Clone)]
pub(super) struct ByData {
    /// First derivatives.
    pub(super) first: Data,
    /// Second derivatives, by the four unknowns and by the data.
    pub(super) mixed: Matrix4<f64>,
    /// Derivatives of the slacks by half the width.
    pub(super) slacks: Vec<f64>,
}

impl ByData {
    /// The derivatives at given fields and multipliers of the inequalities.
    pub(super) fn at(
        element: &Element,
        bounds: &RibBounds,
        model: DevelopableEnergy,
        fields: &Vector4<f64>,
        multipliers: &[f64],
    ) -> Self {
        let [first_rigidity, second_rigidity] = element.rigidity;
        let data = Data::new(
            first_rigidity,
            second_rigidity,
            element.curl.bend,
            element.half_width,
        );
        let (_, _, mut first, mut mixed) = partial_hessian(
            |(fields, data): (SVector<HyperDualSVec64<4, 4>, 4>, SVector<_, 4>)| {
                energy(element, model, fields.into(), data.into())
            },
            (fields, &data),
        );
        let jets = partial_hessian(
            |(slopes, half): (SVector<HyperDualSVec64<2, 1>, 2>, SVector<_, 1>)| {
                let widened = RibBounds {
                    strips: strips(element, half[0]),
                    edges: &wider(bounds.edges, half[0] - element.half_width),
                };
                widened.slacks(slopes.into())
            },
            (
                &Vector2::new(fields[1], fields[3]),
                &SVector::from([element.half_width]),
            ),
        );
        for (place, multiplier) in bounds.places().zip(multipliers) {
            let (_, _, by_width, by_both) = &jets[place];
            first[HALF_WIDTH] -= multiplier * by_width[0];
            mixed[(1, HALF_WIDTH)] -= multiplier * by_both[0];
            mixed[(3, HALF_WIDTH)] -= multiplier * by_both[1];
        }
        Self {
            first,
            mixed,
            slacks: bounds.places().map(|place| jets[place].2[0]).collect(),
        }
    }
}

/// The energy of an element with other data.
fn energy<D: DualNum<Primitive = f64> + Copy>(
    element: &Element,
    model: DevelopableEnergy,
    fields: [D; 4],
    data: [D; 4],
) -> D {
    let [bend, slope, next_bend, next_slope] = fields;
    let [first_rigidity, second_rigidity, natural_bend, half_width] = data;
    let across = match model.knows_width() {
        true => strips(element, half_width).across([slope, next_slope]),
        false => Across::PLAIN.map(D::from),
    };
    let curl = Curl {
        bend: natural_bend,
        poisson: element.curl.poisson,
    };
    let between = |a: D, b: D, t: f64| a * (1.0 - t) + b * t;
    let [first, second] = gauss_points().map(|t| {
        model.value(
            between(bend, next_bend, t),
            between(slope, next_slope, t),
            &curl,
            &across,
        )
    });
    (first * first_rigidity + second * second_rigidity) * (0.5 * element.length)
}

/// The strips of an element of another width.
fn strips<D>(element: &Element, half_width: D) -> Strips<D> {
    Strips {
        half_width,
        geodesic: element.geodesic,
        length: element.length,
    }
}

/// The active edges of a board of a larger half width.
///
/// The edges of the board are half a width off its spine. Where they end on another edge does not matter but for the
/// last tangent of an arc, which is kept.
fn wider<D: DualNum<Primitive = f64> + Copy>(edges: &ActiveEdges, more: D) -> ActiveEdges<D> {
    let moved = |edge: &Edge, side: f64| Edge {
        direction: edge.direction,
        distance: more * side + edge.distance,
        curvature: match edge.curvature == 0.0 {
            true => D::zero(),
            // Active edges that curve are inner ones: the wider the belt, the less their radius.
            false => (more * -side + 1.0 / edge.curvature).recip(),
        },
        turn: edge.turn,
    };
    let [minus, plus, own] = edges;
    [
        minus.as_ref().map(|edge| moved(edge, -1.0)),
        plus.as_ref().map(|edge| moved(edge, 1.0)),
        own.as_ref()
            .map(|edge| moved(edge, edge.curvature.signum())),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::reach::edges_in_reach;
    use crate::board::samples::{Part, Plan};
    use crate::geometry::Pose;
    use crate::strip::density::{Derivatives, Loaded};
    use crate::strip::element::increment;
    use crate::strip::energy::Jet;
    use crate::strip::kernel::Block;
    use nalgebra::Vector6;
    use num_dual::Dual64;

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

    /// Energy and its gradient by the fields.
    fn energy(
        element: &Element,
        model: DevelopableEnergy,
        fields: &Vector4<f64>,
    ) -> (f64, Vector4<f64>) {
        let [a, b] = [0, 2].map(|from| fields.fixed_rows::<2>(from).into_owned());
        let mut block = Block::default();
        let loaded = Loaded {
            element,
            fields: [&a, &b],
            poses: [
                &Pose::identity(),
                &increment(element.length, element.geodesic, fields),
            ],
            wrench: &Vector6::zeros(),
        };
        block.set(0, &model, &loaded);
        block.find(&model);
        let [a, b] = block.gradient(0);
        (
            element.energy(model, fields),
            Vector4::new(a[0], a[1], b[0], b[1]),
        )
    }

    #[test]
    fn test_active_edges_move_with_the_width_as_those_of_the_board_do() {
        let leg = Part::Straight(0.4);
        let parts = [leg, Part::Corner(1.0), leg, Part::Arc(0.2, 4.0), leg];
        let mirrored = [leg, Part::Corner(-1.0), leg, Part::Arc(0.2, -4.0), leg];
        let step = 1e-6;
        let mut seen = [0, 0];
        for parts in [parts, mirrored] {
            let mut spine = Plan::open(0.1, &parts).spine();
            let mut of_width = |width: f64| {
                spine.width = width;
                edges_in_reach(&spine)
            };
            let [below, at, above] = [-step, 0.0, step].map(|by| of_width(0.1 + 2.0 * by));
            for ((below, at), above) in below.iter().zip(&at).zip(&above) {
                let wider = wider(&at.1, Dual64::from(0.0).derivative());
                for (i, edge) in wider.iter().enumerate() {
                    let (Some(edge), Some(below), Some(above)) = (edge, below.1[i], above.1[i])
                    else {
                        continue;
                    };
                    let distance = (above.distance - below.distance) / (2.0 * step);
                    assert!((edge.distance.eps - distance).abs() < 1e-6, "{edge:?}");
                    let curvature = (above.curvature - below.curvature) / (2.0 * step);
                    assert!((edge.curvature.eps - curvature).abs() < 1e-4, "{edge:?}");
                    seen[usize::from(edge.curvature.re != 0.0)] += 1;
                }
            }
        }
        assert!(seen.iter().all(|count| *count >= 8), "{seen:?}");
    }

    #[test]
    fn test_derivatives_by_the_data_agree_with_finite_differences() {
        let arc = Edge {
            direction: Vector2::x(),
            distance: 0.05,
            curvature: 4.0,
            turn: [-0.5, 0.4],
        };
        let line = Edge::line(Vector2::new(0.8, 0.6), 0.03);
        let (element, edges) = (element(), [None, Some(line), Some(arc)]);
        let fields = Vector4::new(3.0, 0.3, 2.5, 0.36);
        let multipliers = [0.3, 0.5, 0.7, 0.4];
        let bounds = RibBounds {
            strips: element.strips(),
            edges: &edges,
        };
        let used: Vec<usize> = bounds.places().collect();
        assert_eq!(used, [0, 1, 3, 4]);
        let jets = |element: &Element| {
            let bounds = RibBounds {
                strips: element.strips(),
                edges: &wider(&edges, element.half_width - 0.05),
            };
            bounds.slack_jets([fields[1], fields[3]]).map(Jet::from)
        };
        let with = |entry: usize, by: f64| {
            let mut other = element;
            match entry {
                0 | 1 => other.rigidity[entry] += by,
                NATURAL_BEND => other.curl.bend += by,
                _ => other.half_width += by,
            }
            other
        };
        for model in [
            DevelopableEnergy::Fishbone,
            DevelopableEnergy::Sadowsky,
            DevelopableEnergy::Wunderlich,
        ] {
            let lagrangian = |element: &Element| {
                let (mut value, mut gradient) = energy(element, model, &fields);
                let slacks = jets(element);
                for (slack, multiplier) in used.iter().map(|place| &slacks[*place]).zip(multipliers)
                {
                    value -= multiplier * slack.value;
                    gradient -= multiplier * slack.gradient;
                }
                (value, gradient)
            };
            let exact = ByData::at(&element, &bounds, model, &fields, &multipliers);
            for entry in 0..4 {
                let h = 1e-6;
                let [more, less] = [h, -h].map(|by| with(entry, by));
                let [above, below] = [&more, &less].map(lagrangian);
                let first = (above.0 - below.0) / (2.0 * h);
                assert!((first - exact.first[entry]).abs() < 1e-6 * first.abs().max(1.0));
                let mixed = (above.1 - below.1) / (2.0 * h);
                let error = (mixed - exact.mixed.column(entry)).amax();
                assert!(error < 1e-6 * mixed.amax().max(1.0), "{model:?} {entry}");
                if entry == HALF_WIDTH {
                    let [above, below] = [&more, &less].map(jets);
                    for (place, exact) in used.iter().zip(&exact.slacks) {
                        let difference = above[*place].value - below[*place].value;
                        assert!((difference / (2.0 * h) - exact).abs() < 1e-6);
                    }
                }
            }
        }
    }
}
