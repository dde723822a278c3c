//! The result schema `fishbone.result/1`: an equilibrium in JSON.

use crate::equilibrium::{Equilibrium, LinkForce, MeshError, Status};
use crate::geometry::Wrench;
use crate::scenario::EnergyModel;
use crate::scenario::Scenario;
use crate::surface;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// Name and version of the result schema, a word.
const SCHEMA: &str = "fishbone.result/1";

type Point = [f64; 3];

/// A result as it stands in JSON, in the units of the scenario.
///
/// All arrays with one entry a node have the length of `u`; frames are row-major matrices whose columns are ξ, η, ζ.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Record<'a> {
    schema: &'static str,
    status: Status,
    message: &'a str,
    warnings: Vec<String>,
    energy: f64,
    elastic_energy: f64,
    energy_model: EnergyModel,
    u: &'a [f64],
    position: Vec<Point>,
    frame: Vec<[Point; 3]>,
    bend: &'a [f64],
    torsion: &'a [f64],
    rib_slope: &'a [f64],
    rib_angle: Vec<f64>,
    curvature: Vec<f64>,
    edges: Edges,
    internal: Internal,
    supports: Vec<Support>,
    links: Vec<Link>,
    highest_point: HighestPoint,
    side: i8,
    least_bend_radius: LeastBendRadius,
    least_spine_radius: LeastSpineRadius,
    bend_radius: BendRadius,
    strain: Option<Strain>,
    rib_margin: RibMargin,
    crosses_itself: Option<[f64; 2]>,
    twist: f64,
    half_turns: Option<i32>,
    stable: Option<bool>,
    negative_modes: Option<usize>,
    zero_modes: Option<usize>,
    residuals: Residuals,
    error: Option<Error>,
    iterations: usize,
    scenario: &'a Scenario,
}

#[derive(Debug, Clone, Serialize)]
struct Edges {
    minus: Vec<Point>,
    plus: Vec<Point>,
}

#[derive(Debug, Clone, Serialize)]
struct Internal {
    force: Vec<Point>,
    moment: Vec<Point>,
}

#[derive(Debug, Clone, Serialize)]
struct Support {
    at: f64,
    force: Point,
    moment: Point,
}

#[derive(Debug, Clone, Serialize)]
struct Link {
    force: Point,
}

impl Link {
    fn new(link: &LinkForce) -> Self {
        Self {
            force: link.force.into(),
        }
    }
}

#[derive(Debug, Clone, Serialize)]
struct HighestPoint {
    u: f64,
    position: Point,
}

/// All null of a flat belt: JSON has no infinity.
#[derive(Debug, Clone, Serialize)]
struct LeastBendRadius {
    value: Option<f64>,
    u: Option<f64>,
    v: Option<f64>,
}

/// All null of a flat belt.
#[derive(Debug, Clone, Serialize)]
struct LeastSpineRadius {
    value: Option<f64>,
    u: Option<f64>,
}

/// Null where infinite.
#[derive(Debug, Clone, Serialize)]
struct BendRadius {
    spine: LeastSpineRadius,
    area: Area,
}

/// Radii exceeded, or strains not exceeded, on 99.9, 99 and 95 % of the board's area.
#[derive(Debug, Clone, Serialize)]
struct Area {
    p999: Option<f64>,
    p99: Option<f64>,
    p95: Option<f64>,
}

/// Null of a belt of no thickness.
#[derive(Debug, Clone, Serialize)]
struct Strain {
    membrane: StrainExtremes,
    layers: Vec<StrainExtremes>,
}

/// All but the area's null where no part of the board is far enough from clamps.
#[derive(Debug, Clone, Serialize)]
struct StrainExtremes {
    value: Option<f64>,
    u: Option<f64>,
    v: Option<f64>,
    area: Area,
}

#[derive(Debug, Clone, Serialize)]
struct RibMargin {
    value: f64,
    u: f64,
}

#[derive(Debug, Clone, Serialize)]
struct Residuals {
    stationarity: f64,
    constraint: f64,
    complementarity: f64,
}

/// Estimated relative errors by the mesh; null where a quantity is not determined.
#[derive(Debug, Clone, Serialize)]
struct Error {
    energy: Option<f64>,
    position: Option<f64>,
    force: Option<f64>,
    radius: Option<f64>,
}

impl Error {
    fn new(error: MeshError) -> Self {
        let known = |error: f64| Some(error).filter(|error| !error.is_nan());
        Self {
            energy: known(error.energy),
            position: known(error.position),
            force: known(error.force),
            radius: known(error.radius),
        }
    }
}

impl Equilibrium {
    /// The result as one JSON object, schema `fishbone.result/1`; the same text for the same equilibrium.
    pub fn to_json(&self) -> String {
        serde_json::to_string(&Record::new(self)).expect("numbers and strings alone")
    }
}

impl<'a> Record<'a> {
    /// The record of an equilibrium.
    pub(crate) fn new(equilibrium: &'a Equilibrium) -> Self {
        let spine = &equilibrium.spine;
        let highest = equilibrium.highest_point();
        let margin = surface::rib_margin(spine);
        let spine_radius = surface::least_spine_radius(spine);
        let crosses_itself = surface::crosses_itself(spine);
        Self {
            schema: SCHEMA,
            status: equilibrium.status,
            message: &equilibrium.message,
            warnings: equilibrium.warnings_with(crosses_itself),
            energy: equilibrium.energy,
            elastic_energy: equilibrium.elastic_energy,
            energy_model: equilibrium.scenario().energy_model(),
            u: &spine.u,
            position: spine.pose.iter().map(|p| p.position.into()).collect(),
            frame: spine.pose.iter().map(|p| row_major(&p.frame)).collect(),
            bend: &spine.bend,
            torsion: &equilibrium.torsion,
            rib_slope: &spine.rib_slope,
            rib_angle: spine.rib_angle(),
            curvature: spine.curvature(),
            edges: Edges::new(&surface::edges(spine)),
            internal: Internal::new(&equilibrium.internal),
            supports: equilibrium.reactions.iter().map(Support::new).collect(),
            links: equilibrium.links.iter().map(Link::new).collect(),
            highest_point: HighestPoint {
                u: highest.u,
                position: highest.position.into(),
            },
            side: equilibrium.side(),
            least_bend_radius: LeastBendRadius::new(surface::least_bend_radius(spine)),
            least_spine_radius: LeastSpineRadius::new(spine_radius),
            bend_radius: BendRadius {
                spine: LeastSpineRadius::new(spine_radius),
                area: Area::new(surface::BendDistribution::of(spine).quantiles()),
            },
            strain: surface::strain(spine).map(|strain| Strain::new(&strain)),
            rib_margin: RibMargin {
                value: margin.value,
                u: margin.u,
            },
            crosses_itself,
            half_turns: equilibrium.half_turns,
            twist: spine.twist(),
            stable: equilibrium.stable(),
            negative_modes: equilibrium.stability.map(|s| s.negative_modes),
            zero_modes: equilibrium.stability.map(|s| s.zero_modes),
            residuals: Residuals {
                stationarity: equilibrium.residuals.stationarity,
                constraint: equilibrium.residuals.constraint,
                complementarity: equilibrium.residuals.complementarity,
            },
            error: equilibrium.error().map(Error::new),
            iterations: equilibrium.iterations,
            scenario: equilibrium.scenario(),
        }
    }
}

impl Edges {
    fn new(edges: &surface::Edges) -> Self {
        Self {
            minus: points(&edges.minus),
            plus: points(&edges.plus),
        }
    }
}

impl Internal {
    fn new(wrenches: &[Wrench]) -> Self {
        Self {
            force: wrenches.iter().map(|w| w.force.into()).collect(),
            moment: wrenches.iter().map(|w| w.moment.into()).collect(),
        }
    }
}

impl Support {
    fn new(reaction: &crate::equilibrium::Reaction) -> Self {
        Self {
            at: reaction.at,
            force: reaction.wrench.force.into(),
            moment: reaction.wrench.moment.into(),
        }
    }
}

impl LeastBendRadius {
    fn new(radius: Option<surface::Extreme>) -> Self {
        Self {
            value: radius.map(|radius| radius.value),
            u: radius.map(|radius| radius.u),
            v: radius.map(|radius| radius.v),
        }
    }
}

impl LeastSpineRadius {
    fn new(radius: Option<surface::SpineRadius>) -> Self {
        Self {
            value: radius.map(|radius| radius.value),
            u: radius.map(|radius| radius.u),
        }
    }
}

impl Area {
    fn new(quantiles: [f64; 3]) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        let [p999, p99, p95] = quantiles.map(finite);
        Self { p999, p99, p95 }
    }
}

impl Strain {
    fn new(strain: &surface::Strain) -> Self {
        Self {
            membrane: StrainExtremes::new(&strain.membrane),
            layers: strain.layers.iter().map(StrainExtremes::new).collect(),
        }
    }
}

impl StrainExtremes {
    fn new(strain: &surface::StrainExtremes) -> Self {
        Self {
            value: strain.largest.map(|largest| largest.value),
            u: strain.largest.map(|largest| largest.u),
            v: strain.largest.map(|largest| largest.v),
            area: Area::new(strain.area),
        }
    }
}

fn points(points: &[Vector3<f64>]) -> Vec<Point> {
    points.iter().map(|p| (*p).into()).collect()
}

fn row_major(frame: &Matrix3<f64>) -> [Point; 3] {
    [0, 1, 2].map(|i| [frame[(i, 0)], frame[(i, 1)], frame[(i, 2)]])
}
