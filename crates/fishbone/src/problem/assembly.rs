//! The assembly of a scenario into a programme: nodes of supports, links and loads; lengths in U and energy in mean R_f/U.

use super::Problem;
use crate::geometry::Pose;
use crate::problem::belt::{Break, Division};
use crate::problem::program::{
    self, BeltPoint, BeltProgram, DeadForce, Hold, NodeLink, NodeLoad, NodeSupport, Tie,
};
use crate::scenario::{Axis, Place, SAME_PLACE, SupportSpec};
use crate::strip::density::Density;
use crate::strip::spine::{CurvedRibs, Piece, Sheet, Spine};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::PI;

impl Problem {
    /// The programme on a mesh of about `count` elements of equal length, without active edges.
    ///
    /// Its supports are the scenario's in their order, or one at the start if the scenario has none; its links are the
    /// scenario's, then the seam of a closed belt.
    pub fn program(&self, count: usize) -> BeltProgram {
        let program = self.program_divided(&self.divided(count));
        program.expect("a division for every stretch")
    }

    /// The stretches of the belt, divided into about `count` elements of equal length.
    pub(super) fn divided(&self, count: usize) -> Vec<Division> {
        self.belt.divided(count, &self.breaks())
    }

    /// The stretches of the belt, divided into the pieces of a programme.
    pub(super) fn division_of(&self, pieces: &[program::Piece]) -> Vec<Division> {
        self.belt.division_of(pieces, &self.breaks())
    }

    /// Lengths of the stretches of the belt, in U.
    pub(super) fn lengths_of_stretches(&self) -> Vec<f64> {
        self.belt.lengths_of_stretches(&self.breaks())
    }

    /// The programme with given divisions, one a stretch; `None` where the belt has another number of stretches.
    pub(super) fn program_divided(&self, divisions: &[Division]) -> Option<BeltProgram> {
        let pieces = self.belt.pieces(divisions, &self.breaks())?;
        Some(self.program_of(pieces))
    }

    fn program_of(&self, pieces: Vec<program::Piece>) -> BeltProgram {
        let mut bare = BeltProgram::new(pieces, self.scenario.energy_model().developable());
        bare.half_turns = self.belt.half_turns;
        let places = Places::of(&bare);
        let mut supports: Vec<_> = self
            .scenario
            .supports
            .iter()
            .map(|support| self.node_support(support, &places))
            .collect();
        if supports.is_empty() {
            supports.push(at_rest());
        }
        let mut links = self.node_links(&places);
        if let Some(half_turns) = self.belt.half_turns {
            links.extend(self.seam(half_turns, places.last()));
        }
        let mut program = bare.with_supports(supports);
        program.links = links;
        program.loads = self.node_loads(&places);
        program.weight = self.weight();
        program
    }

    /// The spine of a shape of one of the problem's programmes, in the units of the scenario.
    pub(crate) fn spine<D: Density<F>, const F: usize, const N: usize>(
        &self,
        program: &BeltProgram<D, F, N>,
        point: &BeltPoint<F>,
    ) -> Spine {
        let length = self.units.length;
        let piece = |piece: &program::Piece| match piece {
            program::Piece::Strip(element) => Piece::Strip {
                geodesic: element.geodesic / length,
            },
            program::Piece::Rigid { .. } => Piece::Rigid,
            program::Piece::Joint { angle } => Piece::Joint { angle: *angle },
        };
        let nodes = program.nodes();
        let mut spine = Spine {
            width: self.belt.width,
            pieces: program.pieces.iter().map(piece).collect(),
            half_turns: self.belt.half_turns,
            u: nodes.iter().map(|u| u * length).collect(),
            pose: point.poses.clone(),
            bend: vec![0.0; nodes.len()],
            rib_slope: vec![0.0; nodes.len()],
            curved: program
                .model
                .curved(&point.fields, length)
                .map(|fields| self.curved_ribs(fields, &program.pieces)),
        };
        self.move_spine(&mut spine, point);
        spine
    }

    /// Gives the spine of a developable belt another shape of the same programme.
    pub(super) fn move_spine<const F: usize>(&self, spine: &mut Spine, point: &BeltPoint<F>) {
        let length = self.units.length;
        for (into, pose) in spine.pose.iter_mut().zip(&point.poses) {
            *into = Pose {
                frame: pose.frame,
                position: self.origin + pose.position * length,
            };
        }
        let fields = spine.bend.iter_mut().zip(&mut spine.rib_slope);
        for ((bend, slope), fields) in fields.zip(&point.fields) {
            (*bend, *slope) = (fields[0] / length, fields[1]);
        }
    }

    /// The curved ribs of given fields, in the units of the scenario.
    fn curved_ribs(&self, fields: [Vec<f64>; 4], pieces: &[program::Piece]) -> CurvedRibs {
        let length = self.units.length;
        let sheet = |piece: &program::Piece| match piece {
            program::Piece::Strip(element) => Sheet {
                poisson: element.curl.poisson,
                stretching: element.stretching / (length * length),
                natural: -element.curl.bend / length,
            },
            program::Piece::Rigid { .. } | program::Piece::Joint { .. } => Sheet::RIGID,
        };
        let [slope_rate, twist, across, across_rate] = fields;
        CurvedRibs {
            slope_rate,
            twist,
            across,
            across_rate,
            sheets: pieces.iter().map(sheet).collect(),
            faces: self.scenario.belt.faces(),
        }
    }

    /// Difference between the loads' potential with its zero at the world's origin and the potential with its zero at the
    /// programme's origin.
    pub(crate) fn potential_of_origin(&self) -> f64 {
        let gravity = Vector3::from(self.scenario.loads.gravity.unwrap_or_default());
        let weight = gravity * self.belt.density * self.belt.length();
        let forces = self.scenario.loads.points.iter();
        let total = forces
            .map(|load| Vector3::from(load.force))
            .sum::<Vector3<f64>>()
            + weight;
        -total.dot(&self.origin)
    }

    /// Arc lengths that must be nodes.
    fn breaks(&self) -> Vec<Break> {
        let at = |place: &Place, jump| Break {
            u: place.arc_length(self.units.length),
            jump,
        };
        let supports = self.scenario.supports.iter();
        let links = self.scenario.links.iter();
        let loads = self.scenario.loads.points.iter();
        let bears = !self.is_left_alone();
        supports
            .map(|support| at(&support.at, bears && support.frame().is_some()))
            .chain(links.flat_map(|link| [at(&link.from, false), at(&link.to, false)]))
            .chain(loads.map(|load| at(&load.at, load.lever != [0.0; 3])))
            .collect()
    }

    /// Whether a closed belt is free of loads and links and has at most one support, which then bears nothing.
    pub(crate) fn is_left_alone(&self) -> bool {
        let loads = &self.scenario.loads;
        let unloaded = self.weight() == Vector3::zeros() && loads.points.is_empty();
        self.belt.half_turns.is_some() && self.scenario.supports.len() <= 1 && unloaded
    }

    fn moment_acts_at_seam(&self) -> bool {
        let length = self.units.length;
        let breaks = self.breaks().into_iter().filter(|b| b.jump);
        let mut ways = breaks.map(|b| b.u.min(length - b.u));
        ways.any(|way| way <= SAME_PLACE * length)
    }

    fn node_support(&self, support: &SupportSpec, places: &Places) -> NodeSupport {
        let length = self.units.length;
        NodeSupport {
            node: places.node(support.at.arc_length(length) / length),
            position: [0, 1, 2].map(|i| Some((support.components()[i]? - self.origin[i]) / length)),
            hold: hold(support, support.moment.unwrap_or(0.0) / self.units.energy),
            square_rib: self.scenario.is_square_rib(support),
        }
    }

    fn node_links(&self, places: &Places) -> Vec<NodeLink> {
        let length = self.units.length;
        let node = |place: &Place| places.node(place.arc_length(length) / length);
        let links = self.scenario.links.iter();
        links
            .map(|link| NodeLink {
                nodes: [node(&link.from), node(&link.to)],
                tie: Tie::Offset(Vector3::from(link.offset) / length),
            })
            .collect()
    }

    fn node_loads(&self, places: &Places) -> Vec<NodeLoad> {
        let length = self.units.length;
        let loads = self.scenario.loads.points.iter();
        loads
            .map(|load| NodeLoad {
                node: places.node(load.at.arc_length(length) / length),
                load: DeadForce {
                    force: Vector3::from(load.force) / self.units.force(),
                    lever: Vector3::from(load.lever) / length,
                },
            })
            .collect()
    }

    fn weight(&self) -> Vector3<f64> {
        let gravity = Vector3::from(self.scenario.loads.gravity.unwrap_or_default());
        gravity * (self.belt.density * self.units.length / self.units.force())
    }

    /// The two links of the seam, between the start and the end of a closed belt.
    fn seam(&self, half_turns: i32, last: usize) -> [NodeLink; 2] {
        let turn = UnitQuaternion::from_scaled_axis(PI * f64::from(half_turns) * Vector3::y());
        let sign = self.belt.seam_sign();
        let [bend, slope] = self.belt.goes_on_through_seam();
        let goes_on = [bend && !self.moment_acts_at_seam(), slope];
        let [bend, slope] = goes_on.map(|goes_on| goes_on.then_some(sign));
        let factors = [bend, slope, None, None, None, None];
        [Tie::Pose(turn), Tie::Fields(factors)].map(|tie| NodeLink {
            nodes: [0, last],
            tie,
        })
    }
}

/// The support of a belt that has none: its start in the natural pose.
fn at_rest() -> NodeSupport {
    NodeSupport {
        node: 0,
        position: [Some(0.0); 3],
        hold: Hold::Frame(UnitQuaternion::identity()),
        square_rib: false,
    }
}

/// The hold of a support, with the moment about its hinge in the units of the programme.
fn hold(support: &SupportSpec, moment: f64) -> Hold {
    let quaternion = |frame: Matrix3<f64>| {
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(frame))
    };
    match (support.frame().map(quaternion), support.hinge) {
        (None, _) => Hold::Free,
        (Some(frame), None) => Hold::Frame(frame),
        (Some(frame), Some(axis)) => Hold::Hinge {
            frame,
            axis: match axis {
                Axis::Xi => 0,
                Axis::Eta => 1,
                Axis::Zeta => 2,
            },
            moment,
        },
    }
}

/// Nodes by arc length.
struct Places(Vec<f64>);

impl Places {
    fn of(program: &BeltProgram) -> Self {
        Self(program.nodes())
    }

    fn last(&self) -> usize {
        self.0.len() - 1
    }

    /// The node at an arc length in U; of two nodes there, the one before the jump. At the end, the last node.
    fn node(&self, u: f64) -> usize {
        if u >= 1.0 {
            return self.last();
        }
        let after = self.0.partition_point(|node| *node < u - SAME_PLACE);
        after.min(self.last())
    }
}
