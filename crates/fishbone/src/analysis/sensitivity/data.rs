//! What an element is made of, and how its energy and its bounds depend on that.

use crate::geometry::gauss_points;
use crate::strip::developable::{Curl, EnergyModel};
use crate::strip::element::Element;
use crate::strip::ribs::{Across, Edge, Strips};
use nalgebra::{Matrix4, SVector, Vector2, Vector4};
use num_dual::{DualNum, HyperDualSVec64, partial_hessian};

/// Of an element: R_f at its two Gauss points, its natural bend, and half its width.
pub(super) type Data = Vector4<f64>;
/// Places in [`Data`].
pub(super) const NATURAL_BEND: usize = 2;
pub(super) const HALF_WIDTH: usize = 3;

/// Derivatives of an element's part of the Lagrangian by its data.
#[derive(Debug, Clone)]
pub(super) struct ByData {
    /// First ones.
    pub(super) first: Data,
    /// Second ones, by the four unknowns and by the data.
    pub(super) mixed: Matrix4<f64>,
    /// Derivatives of the slacks by half the width, of those that bound something.
    pub(super) slacks: Vec<f64>,
}

impl ByData {
    /// At some fields, with the multipliers of the slacks that bound something.
    pub(super) fn at(
        element: &Element,
        model: EnergyModel,
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
                strips(element, half[0]).slacks(slopes.into())
            },
            (
                &Vector2::new(fields[1], fields[3]),
                &SVector::from([element.half_width]),
            ),
        );
        let bounds: Vec<usize> = element.strips().bounds().collect();
        for (bound, multiplier) in bounds.iter().zip(multipliers) {
            let (_, _, by_width, by_both) = &jets[*bound];
            first[HALF_WIDTH] -= multiplier * by_width[0];
            mixed[(1, HALF_WIDTH)] -= multiplier * by_both[0];
            mixed[(3, HALF_WIDTH)] -= multiplier * by_both[1];
        }
        Self {
            first,
            mixed,
            slacks: bounds.iter().map(|bound| jets[*bound].2[0]).collect(),
        }
    }
}

/// The energy of an element made of other data.
fn energy<D: DualNum<Primitive = f64> + Copy>(
    element: &Element,
    model: EnergyModel,
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
///
/// The edges of the board are half a width off its spine. Where they end on another edge does not matter but for the
/// last tangent of an arc, which is kept.
fn strips<D: DualNum<Primitive = f64> + Copy>(element: &Element, half_width: D) -> Strips<D> {
    let more = half_width - element.half_width;
    let wider = |edge: &Edge, side: f64| Edge {
        direction: edge.direction,
        distance: more * side + edge.distance,
        curvature: match edge.curvature == 0.0 {
            true => D::zero(),
            // Further edges that curve are inner ones: the wider the belt, the less their radius.
            false => (more * -side + 1.0 / edge.curvature).recip(),
        },
        turn: edge.turn,
    };
    let [minus, plus, own] = &element.further;
    Strips {
        half_width,
        geodesic: element.geodesic,
        length: element.length,
        further: [
            minus.as_ref().map(|edge| wider(edge, -1.0)),
            plus.as_ref().map(|edge| wider(edge, 1.0)),
            own.as_ref()
                .map(|edge| wider(edge, edge.curvature.signum())),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::reach::further_edges;
    use crate::board::samples::{Part, Plan};
    use crate::geometry::Pose;
    use crate::strip::density::{Derivatives, Loaded};
    use crate::strip::kernel::Block;
    use crate::strip::ribs::FURTHER;
    use nalgebra::Vector6;
    use num_dual::Dual64;

    fn element(further: [Option<Edge>; FURTHER]) -> Element {
        Element {
            length: 0.0125,
            geodesic: 1.4,
            rigidity: [1.3, 0.7],
            half_width: 0.05,
            curl: Curl {
                bend: 2.0,
                poisson: 0.3,
            },
            further,
        }
    }

    /// Energy and its gradient by the fields.
    fn energy(element: &Element, model: EnergyModel, fields: &Vector4<f64>) -> (f64, Vector4<f64>) {
        let [a, b] = [0, 2].map(|from| fields.fixed_rows::<2>(from).into_owned());
        let mut block = Block::default();
        let loaded = Loaded {
            element,
            fields: [&a, &b],
            poses: [&Pose::identity(), &element.increment(fields)],
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
    fn test_further_edges_move_with_the_width_as_those_of_the_board_do() {
        let leg = Part::Straight(0.4);
        let parts = [leg, Part::Corner(1.0), leg, Part::Arc(0.2, 4.0), leg];
        let mirrored = [leg, Part::Corner(-1.0), leg, Part::Arc(0.2, -4.0), leg];
        let step = 1e-6;
        let mut seen = [0, 0];
        for parts in [parts, mirrored] {
            let mut spine = Plan::open(0.1, &parts).spine();
            let mut of_width = |width: f64| {
                spine.width = width;
                further_edges(&spine)
            };
            let [below, at, above] = [-step, 0.0, step].map(|by| of_width(0.1 + 2.0 * by));
            for ((below, at), above) in below.iter().zip(&at).zip(&above) {
                let wider = strips(&element(at.1), Dual64::from(0.05).derivative());
                for (i, edge) in wider.further.iter().enumerate() {
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
        let element = element([None, Some(line), Some(arc)]);
        let fields = Vector4::new(3.0, 0.3, 2.5, 0.36);
        let bounds = [0.3, 0.5, 0.7, 0.4];
        let used: Vec<usize> = element.strips().bounds().collect();
        assert_eq!(used, [0, 1, 3, 4]);
        let with = |entry: usize, by: f64| {
            let mut other = element;
            match entry {
                0 | 1 => other.rigidity[entry] += by,
                NATURAL_BEND => other.curl.bend += by,
                _ => {
                    other.half_width += by;
                    let wider = strips(&element, element.half_width + by);
                    other.further = wider.further;
                }
            }
            other
        };
        for model in [
            EnergyModel::Fishbone,
            EnergyModel::Sadowsky,
            EnergyModel::Wunderlich,
        ] {
            let lagrangian = |element: &Element| {
                let (mut value, mut gradient) = energy(element, model, &fields);
                let slacks = element.slack_jets(&fields);
                for (slack, multiplier) in used.iter().map(|bound| &slacks[*bound]).zip(bounds) {
                    value -= multiplier * slack.value;
                    gradient -= multiplier * slack.gradient;
                }
                (value, gradient)
            };
            let exact = ByData::at(&element, model, &fields, &bounds);
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
                    let [above, below] = [&more, &less].map(|element| element.slacks(&fields));
                    for (bound, exact) in used.iter().zip(&exact.slacks) {
                        let (above, below) = (above[*bound], below[*bound]);
                        assert!(((above - below) / (2.0 * h) - exact).abs() < 1e-6);
                    }
                }
            }
        }
    }
}
